"""How fluent the studio is: wall times in headless Chromium, worked by a real pointer.

The picture is kodim23 with its red parrot as a layer. Frames are counted while the pointer moves 60
times a second; without a graphics card a 2-D canvas draws, so these figures are lower bounds. What
the page measures is in `studio.times`: the milliseconds between frames, from the pointer's event to
the frame that shows it, and from letting go to the exact picture.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import proxyimg_codec as pxi
from proxyimg_codec.geometry import mesher
from proxyimg_codec.model import Layers
from tests.support.studio import LARGE, Studio, chromium, opened, served

from .common import header, read_rgb

RED = (540.0, 380.0)
"""Point of the canvas in the red parrot."""

NODES = 600
"""Least number of nodes of the mesh that is bent."""

SECONDS = 2.0
"""Time for which something is dragged, or played."""


def layered(photo: Path, folder: Path) -> Path:
    """File of the picture with its parrot as a layer, whose mesh has at least `NODES` nodes."""
    pixels = read_rgb(photo)
    regions = pxi.find_layers(pixels, points={"red": [RED]})
    picture = pxi.encode(pixels, masks=regions, effort=1).picture
    layers = list(picture.layers)
    red = layers[-1]
    edge = 0.06
    mesh = mesher.derived(red.boundary, picture.size, edge)
    while len(mesh.refined.nodes) < NODES:
        edge *= 0.9
        mesh = mesher.derived(red.boundary, picture.size, edge)
    layers[-1] = replace(red, mesh=mesh)
    path = folder / "parrots.pxi"
    pxi.Image(replace(picture, layers=Layers(layers))).save(path)
    return path


def dragged(studio: Studio, start: tuple[float, float], reach: float) -> dict[str, list[float]]:
    """Drags from a point of the canvas to and fro; what the page measured meanwhile."""
    mouse = studio.page.mouse
    x, y = studio.at(*start)
    mouse.move(x, y)
    mouse.down()
    studio.ask("Object.values(studio.times).forEach((v) => v.length && v.splice(0))")
    begun, k = time.monotonic(), 0
    while time.monotonic() < begun + SECONDS:
        k += 1
        mouse.move(x + reach * (k % 60 - 30) / 30, y + reach * (k % 40 - 20) / 40)
        time.sleep(max(0.0, begun + k / 60 - time.monotonic()))
    times: dict[str, list[float]] = studio.ask("structuredClone(studio.times)")
    mouse.up()
    return times


def middle(studio: Studio) -> tuple[float, float]:
    """Point of the canvas in the middle of the parrot, wherever it has been dragged."""
    x0, y0, x1, y1 = studio.state["layers"][-1]["bounds"]
    return (x0 + x1) / 2, (y0 + y1) / 2


def until_exact(studio: Studio, by: float) -> float:
    """Milliseconds from letting go of the parrot, dragged to the right, to the exact picture."""
    x, y = middle(studio)
    studio.ask("studio.times.exact.splice(0)")
    studio.drag((x, y), (x + by, y))
    studio.until("studio.times.exact.length > 0")
    return float(studio.ask("studio.times.exact.at(-1)"))


def shown(what: str, frames: list[float], pointer: list[float] | None = None) -> str:
    """Row of a table: frames a second, and milliseconds from the pointer to the picture."""
    rate = f"{1000 / statistics.mean(frames):.0f} frames/s"
    if not pointer:
        return f"| {what} | {rate} |"
    worst = statistics.quantiles(pointer, n=20)[-1]
    middle = statistics.median(pointer)
    return f"| {what} | {rate}; pointer to picture {middle:.0f} ms, 95 % within {worst:.0f} |"


def measure(studio: Studio, photo: Path, file: Path) -> None:
    """Prints a row for everything that is measured."""
    page = studio.page
    begun = time.monotonic()
    studio.drop(photo)
    studio.until("studio.store.state.regions?.length > 1")
    page.wait_for_selector(".overlay .region")
    print(f"| photograph dropped to first outlines | {time.monotonic() - begun:.1f} s |")
    page.click("#got-it")
    studio.choose(file, lambda: page.click("#open"))
    studio.until("studio.store.state.stage === 'editing' && studio.ready()")
    page.click("#got-it")
    page.wait_for_selector(".exact:not([hidden])")
    studio.click(*RED)
    times = dragged(studio, RED, 60)
    print(shown("dragging the parrot", times["frames"], times["pointer"]))
    print(f"| draw calls a frame | {studio.ask('studio.times.calls')} |")
    page.wait_for_timeout(1000)
    rests = [until_exact(studio, by) for by in (9, -9, 5, -5, 9)]
    print(f"| rest to the exact picture | {statistics.median(rests):.0f} ms |")
    page.click("#tool-pins")
    studio.until("document.querySelector('.overlay .mesh')")
    page.get_by_label("Show the mesh").uncheck()
    x, y = middle(studio)
    for dx, dy in ((-30, 90), (60, 90), (0, 0)):
        studio.click(x + dx, y + dy)
    times = dragged(studio, (x, y), 40)
    nodes = max(v["nodes"] for v in studio.state["layers"])
    print(shown(f"bending it, {nodes} nodes", times["frames"], times["pointer"]))
    studio.press("v")
    page.click("#mode-motion")
    page.get_by_role("button", name="Sway").click()
    studio.until("studio.player.running && studio.player.time > 0.5")
    studio.ask("studio.times.frames.splice(0)")
    page.wait_for_timeout(1000 * SECONDS)
    print(shown("a preset playing", studio.ask("studio.times.frames")))


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with kodak/")
    parser.add_argument("--draw", choices=["gl", "flat"], help="how to draw, by WebGL or a canvas")
    args = parser.parse_args()
    photo = args.data / "kodak" / "kodim23.png"
    query = f"?draw={args.draw}" if args.draw else ""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        file = layered(photo, folder)
        with served(folder / "kept") as address, chromium() as browser:
            print(header(args.data), "\n\n| What | Measured |\n|---|---|", sep="")
            with opened(browser, address, size=LARGE, query=query) as studio:
                measure(studio, photo, file)


if __name__ == "__main__":
    main()
