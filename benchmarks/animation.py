"""Animation: what a frame costs, what a motion adds to a file, and how steady the frames are.

    python -m benchmarks.animation DATA [--only speed loops stored export flow features]

DATA holds the Kodak pictures, their label maps and the emoji. The scene is the middle 512 x 512 of
kodim23. Its two objects, and an emoji in front of them, are layers that move. Times are wall times,
so that one thread and two can be compared: the least of several runs.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import proxyimg_codec as pxi
from benchmarks import consistency
from benchmarks.common import Pixels, header, run_limited
from benchmarks.editing import PICTURE, regions
from proxyimg_codec.animate.animate import amplitude, preset
from proxyimg_codec.animate.motion import PRESETS
from proxyimg_codec.animate.sequence import frames, times
from proxyimg_codec.api import Image
from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.export.clip import write_clip
from proxyimg_codec.geometry.mesher import derived
from proxyimg_codec.io import raster
from proxyimg_codec.model import Layers
from proxyimg_codec.native import kernel

EMOJI = "emoji_fluent3d_1f98a.webp"
SIDE, CORNER = 240, (136, 264)
"""Side of the emoji, and x, y of its corner, in pixels."""

EDGE = 0.028
"""Edge length of the meshes, relative to the diagonal of a layer."""

SECONDS, FPS, RUNS = 4.0, 24, 3
FLAGS = ("--preset", "breeze", "--separate", "--quiet")
KINDS = ("mp4", "webm", "webp", "gif", "apng")
MUST = {("implicit", "numpy"): 4, ("implicit", "native"): 15, ("pyramid", "native"): 20}
"""Frames per second that each coder and engine must reach on two threads."""


def scene(data: Path) -> tuple[Pixels, list[Region]]:
    """Makes the picture, uint8 [512, 512, 3], and its three layers."""
    import cv2

    pixels, masks = regions(data, PICTURE)
    emoji = raster.read(data / "emoji" / EMOJI).pixels
    emoji = cv2.resize(emoji, (SIDE, SIDE), interpolation=cv2.INTER_AREA).astype(float)
    (x, y), alpha = CORNER, emoji[..., 3:] / 255
    part = pixels[y : y + SIDE, x : x + SIDE]
    part[:] = np.rint(part + (emoji[..., :3] - part) * alpha)
    mask = np.zeros(pixels.shape[:2], bool)
    mask[y : y + SIDE, x : x + SIDE] = alpha[..., 0] >= 0.5
    return pixels, [*masks, Region("emoji", mask)]


def encoded(data: Path, texture: str) -> Image:
    """Encodes the scene, with meshes that are the same for every coder."""
    pixels, masks = scene(data)
    picture = pxi.encode(pixels, masks=masks, texture=texture, effort=2, mesh="none").picture
    back, *fronts = picture.layers
    meshed = [replace(v, mesh=derived(v.boundary, picture.size, EDGE)) for v in fronts]
    return Image(replace(picture, layers=Layers([back, *meshed])))


def moving(image: Image, name: str, progress: Callable[[int, int], None] | None = None) -> Image:
    """Gives a picture the motion of a preset, with each layer as a body of its own."""
    motion = preset(image, name, together=False, duration=SECONDS, fps=FPS)
    return image.animated(motion, progress=progress)


def speed(paths: dict[str, Path]) -> None:
    """Prints frames per second and times by stage, for each engine and number of threads.

    Each of these runs in a process of its own.
    """
    print(
        f"frames a second, {SECONDS:g} s of breeze at {FPS}; ms a frame by stage, on one thread: "
        "simulation, fit of tracks, tracks and outlines, back layer, moving layers, MP4"
    )
    engines = ["numpy", "native"] if kernel.available() else ["numpy"]
    for texture, path in paths.items():
        for engine in engines:
            for threads in (1, 2):
                call = f"time_frames({str(path)!r}, {engine!r}, {threads})"
                code = f"from benchmarks.animation import time_frames; {call}"
                # With two threads, those of numpy are left at their default, as users have them.
                said = run_limited(code, threads=1 if threads == 1 else None)[0]
                must = MUST.get((texture, engine)) if threads == 2 else None
                note = f"  (must reach {must})" if must else ""
                print(f"  {texture:8s} {engine:6s} {threads} {said}{note}", flush=True)


def time_frames(path: str, engine: str, threads: int) -> None:
    """Prints the times of one engine; `speed` runs this in a process of its own."""
    image = pxi.open(path)
    start = time.perf_counter()
    image.render(engine=engine)
    first = time.perf_counter() - start
    simulation, fit, moved = min((_animated(image) for _ in range(RUNS)), key=lambda v: v[0] + v[1])
    at = times(moved)
    drawing = _least(lambda: list(frames(moved, at, jobs=threads, engine=engine)))
    whole = simulation + fit + drawing
    line = f"{len(at) / whole:5.1f} frames/s, drawing alone {len(at) / drawing:5.1f}"
    if threads == 1:
        parts = [simulation / len(at), fit / len(at), *_stages(moved, at, engine)]
        line += f"; first frame {first:.2f} s; " + ", ".join(f"{1000 * p:.1f}" for p in parts)
    print(line)


def _stages(moved: Image, at: list[float], engine: str) -> list[float]:
    """Seconds per frame: tracks and outlines, back layer, moving layers, MP4."""
    few = at[:: len(at) // 16]

    def placed() -> None:
        for t in few:
            for layer in moved.at(t).layers:
                _ = layer.outline

    def drawn(**options: Any) -> Callable[[], object]:
        return lambda: [moved.render(t=t, engine=engine, **options) for t in few]

    front = drawn(layers=list(range(1, len(moved.layers))), background=False)
    parts = [_least(work) / len(few) for work in (placed, drawn(layers=[0]), front)]
    shown = list(frames(moved, at, engine=engine))
    return [*parts, _least(lambda: _clip(shown, "mp4")) / len(at)]


def _least(work: Callable[[], object]) -> float:
    """Seconds that some work takes: the least of `RUNS` runs."""
    spent = []
    for _ in range(RUNS):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)


def _animated(image: Image) -> tuple[float, float, Image]:
    """Animates a picture; returns seconds of simulation and of fitting tracks, and the result."""
    start = done = time.perf_counter()

    def progress(now: int, total: int) -> None:
        nonlocal done
        done = time.perf_counter()

    moved = moving(image, "breeze", progress)
    return done - start, time.perf_counter() - done, moved


def _clip(shown: list[NDArray[np.uint8]], kind: str) -> int:
    """Writes frames as a clip, and returns its bytes."""
    height, width = shown[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / f"clip.{kind}")
        return write_clip(path, shown, fps=FPS, size=(width, height), alpha=False)


def loops(image: Image) -> Iterator[str]:
    """Yields lines on the seam of the loop, for each preset."""
    yield (
        "loops: frame at the end less frame at the beginning, most in 8-bit levels; RMS step over "
        "the seam, relative to the largest of other steps; displacement of nodes, mean in px"
    )
    for name in PRESETS:
        moved = moving(image, name)
        first, last = (moved.render(t=t, dtype=np.float32) for t in (0.0, SECONDS))
        away = 255 * float(np.abs(last - first).max())
        shown = [f.astype(np.float32) for f in frames(moved, times(moved))]
        steps = [consistency.rms(shown[k] - shown[k - 1]) for k in range(len(shown))]
        seam = steps[0] / max(steps[1:])
        yield f"  {name:7s} {away:.3f}  seam {seam:.2f}  {amplitude(moved):.1f} px"


def stored(image: Image) -> Iterator[str]:
    """Yields lines on the bytes that a motion adds to a file, for each preset."""
    yield f"stored motion of {SECONDS:g} s in bytes (at most 30000): chunk mOTN, and with meshes"
    picture = image.picture
    bare = Layers(replace(v, mesh=None) for v in picture.layers)
    before = len(to_bytes(replace(picture, layers=bare)))
    for name in PRESETS:
        moved = moving(image, name)
        size = next(c.size for c in moved.chunks if c.type == "mOTN")
        yield f"  {name:7s} {size:6d} {len(moved.to_bytes()) - before:6d}"


def export(paths: dict[str, Path]) -> Iterator[str]:
    """Yields lines on the seconds that ``pxi-animate`` takes to make a clip, and on its bytes."""
    from proxyimg_codec.cli.animate import main as command

    yield f"pxi-animate {' '.join(FLAGS)}, {SECONDS:g} s, 512x512: seconds (at most 30), bytes"
    for texture, path in paths.items():
        for kind in KINDS:
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / f"clip.{kind}"
                start = time.perf_counter()
                code = command([str(path), str(out), *FLAGS])
                spent = time.perf_counter() - start
                size = out.stat().st_size if code == 0 else 0
            yield f"  {texture:8s} {kind:4s} {spent:5.1f} s {size:9d}" + " FAILED" * (code != 0)


def main() -> None:
    """Runs the command line."""
    sections = ("speed", "loops", "stored", "export", "flow", "features")
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path)
    p.add_argument("--only", nargs="+", choices=sections, default=sections)
    args = p.parse_args()
    print(header(args.data))
    images = {texture: encoded(args.data, texture) for texture in ("implicit", "pyramid")}
    nodes = [len(v.mesh.refined.nodes) for v in images["pyramid"].layers if v.mesh]
    print(f"{PICTURE} and {EMOJI}, 512x512, nodes {' + '.join(map(str, nodes))} = {sum(nodes)}")
    with tempfile.TemporaryDirectory() as folder:
        paths = {texture: Path(folder) / f"{texture}.pxi" for texture in images}
        for texture, path in paths.items():
            images[texture].save(path)
        if "speed" in args.only:
            away = amplitude(moving(images["pyramid"], "breeze"))
            print(f"displacement of nodes, mean {away:.1f} px")
            speed(paths)
        lines: dict[str, Callable[[], Iterator[str]]] = {
            "loops": lambda: loops(images["pyramid"]),
            "stored": lambda: stored(images["pyramid"]),
            "export": lambda: export(paths),
            "flow": lambda: consistency.flow(images, moving),
            "features": lambda: consistency.features(images, moving, args.data),
        }
        for section, work in lines.items():
            if section in args.only:
                for line in work():
                    print(line, flush=True)


if __name__ == "__main__":
    main()
