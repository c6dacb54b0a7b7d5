"""Flat graphics and screenshots: whole files beside lossless ones of WebP, PNG and JPEG XL.

    python -m benchmarks.flat DATA [--count N] [-e EFFORT] [-j N]

Pictures of `clipart/` and `emoji/` of DATA, and screens that are drawn here: a text editor, a table
with a chart, and a dialog over a gradient. PNG is written by OpenCV at level 9, with a palette by
Pillow where there are at most 256 colours, and the smaller one counts. Ours, and AVIF 4:4:4, are
lossy: their bytes are those at 45 dB, where flat areas look exact, interpolated between qualities.
"""

from __future__ import annotations

import argparse
import io
import statistics
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

import proxyimg_codec as pxi
from benchmarks.common import Pixels, header
from proxyimg_codec.bench.measure import front, pchip, psnr
from proxyimg_codec.bench.peers import codecs, pillow_decode
from proxyimg_codec.bench.rd import load

LEVEL = 45.0
"""PSNR in dB at which lossy files count."""

SCREEN = (1237, 703)
"""Columns and rows of a screen."""

LOSSLESS, LOSSY = ("PNG", "WebP", "JPEG XL"), ("pxi", "AVIF 4:4:4")

QUALITIES = {"pxi": (40.0, 60.0, 75.0, 88.0, 96.0), "AVIF 4:4:4": (50.0, 65.0, 80.0, 90.0, 97.0)}


def editor() -> Pixels:
    """A window with lines of text."""
    page = Pillow.new("RGB", SCREEN, (30, 32, 38))
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(15)
    draw.rectangle((0, 0, SCREEN[0], 34), fill=(44, 47, 55))
    for x in (18, 38, 58):
        draw.ellipse((x - 6, 11, x + 6, 23), fill=(200 - x, 60 + 2 * x, 80))
    words = [
        "for",
        "each",
        "layer",
        "of",
        "the",
        "picture",
        "draw",
        "its",
        "mesh",
        "and",
        "sample",
        "what",
        "it",
        "shows",
        "there",
    ]
    rng = np.random.default_rng(3)
    for row in range(34):
        x = 58 + 28 * int(rng.integers(0, 4))
        draw.text((14, 44 + 19 * row), f"{row + 1:3}", (98, 104, 118), font)
        for word in rng.choice(words, int(rng.integers(0, 12))):
            colour = [(214, 218, 226), (198, 120, 221), (97, 175, 239), (152, 195, 121)]
            draw.text((x, 44 + 19 * row), word, colour[int(rng.integers(0, 4))], font)
            x += int(draw.textlength(word + " ", font))
    return np.asarray(page)


def table() -> Pixels:
    """A sheet of numbers with a chart of bars."""
    page = Pillow.new("RGB", SCREEN, "white")
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(13)
    rng = np.random.default_rng(4)
    for row in range(30):
        draw.line((0, 23 * row, 720, 23 * row), (216, 218, 222))
        for column in range(8):
            value = f"{rng.normal(0, 400):.1f}"
            draw.text((90 * column + 8, 23 * row + 4), value, (30, 30, 30), font)
    for column in range(9):
        draw.line((90 * column, 0, 90 * column, 690), (216, 218, 222))
    for k, height in enumerate(rng.integers(40, 480, 12)):
        box = 760 + 38 * k, 600 - int(height), 788 + 38 * k, 600
        draw.rectangle(box, fill=[(66, 133, 244), (219, 68, 55), (244, 180, 0)][k % 3])
    draw.line((750, 600, 1220, 600), (60, 60, 60), 2)
    return np.asarray(page)


def dialog() -> Pixels:
    """A window with buttons over a wallpaper that changes smoothly."""
    y, x = np.mgrid[: SCREEN[1], : SCREEN[0]] / SCREEN[0]
    wall = np.stack([40 + 90 * x, 70 + 60 * y, 130 + 80 * (1 - x) * (1 - y)], -1)
    page = Pillow.fromarray(np.rint(wall).astype(np.uint8))
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(17)
    draw.rounded_rectangle((330, 190, 910, 500), 14, (246, 246, 248), (180, 182, 188))
    draw.text((360, 220), "Save changes to the picture before closing?", (20, 20, 24), font)
    for k, label in enumerate(("Discard", "Cancel", "Save")):
        box = 360 + 180 * k, 430, 520 + 180 * k, 470
        draw.rounded_rectangle(box, 8, (0, 110, 230) if k == 2 else (226, 227, 232))
        ink = "white" if k == 2 else (20, 20, 24)
        draw.text((410 + 180 * k, 439), label, ink, font)
    return np.asarray(page)


def pictures(data: Path, count: int | None) -> list[tuple[str, str, Pixels]]:
    """Group, name and pixels uint8 [H, W, 3 or 4] of all pictures."""
    found = [(f, p.stem, load(p)) for f in ("clipart", "emoji")
             for p in sorted((data / f).glob("*.png"))[:count]]  # fmt: skip
    return [*found, *(("screens", d.__name__, d()) for d in (editor, table, dialog))]


def png(pixels: Pixels) -> int:
    """Bytes of the smaller one of two PNG files."""
    order = cv2.COLOR_RGBA2BGRA if pixels.shape[2] == 4 else cv2.COLOR_RGB2BGR
    flags = [cv2.IMWRITE_PNG_COMPRESSION, 9]
    best = len(cv2.imencode(".png", cv2.cvtColor(pixels, order), flags)[1])
    image = Pillow.fromarray(pixels)
    if image.getcolors(256) and pixels.shape[2] == 3:
        file = io.BytesIO()
        image.convert("P", palette=Pillow.Palette.ADAPTIVE).save(file, "PNG", optimize=True)
        best = min(best, len(file.getvalue()))
    return best


def webp(pixels: Pixels) -> int:
    """Bytes of a lossless WebP file."""
    file = io.BytesIO()
    Pillow.fromarray(pixels).save(file, "WEBP", lossless=True, quality=100, method=6)
    return len(file.getvalue())


def jpegxl(pixels: Pixels) -> int:
    """Bytes of a lossless JPEG XL file."""
    import imagecodecs

    return len(imagecodecs.jpegxl_encode(pixels, lossless=True, effort=7, numthreads=1))


def lossy(name: str, effort: int, pixels: Pixels) -> float:
    """Bytes of a lossy file at `LEVEL`; NaN if no quality reaches it."""
    points = []
    for quality in QUALITIES[name]:
        if name == "pxi":
            image = pxi.encode(pixels, quality=quality, effort=effort, max_layers=1, jobs=1)
            file, decoded = image.to_bytes(), image.render()
        else:
            file = codecs()["avif444"].encode(pixels, quality)
            decoded = pillow_decode(file)
        points.append((float(len(file)), psnr(pixels, decoded)))
        if points[-1][1] > LEVEL and len(points) > 1:
            break
    points = front(points)
    if not points or not points[0][1] <= LEVEL <= points[-1][1]:
        return points[0][0] if points and points[0][1] > LEVEL else float("nan")
    x, y = np.array([p[1] for p in points]), np.log([p[0] for p in points])
    return float(np.exp(pchip(x, y, np.array([LEVEL]))[0]))


def measured(job: tuple[str, str, Pixels], effort: int) -> tuple[str, str, dict[str, float]]:
    """Group, name and bytes by format of a picture."""
    group, name, pixels = job
    sizes: dict[str, float] = {"PNG": png(pixels), "WebP": webp(pixels), "JPEG XL": jpegxl(pixels)}
    return group, name, sizes | {k: lossy(k, effort, pixels) for k in LOSSY}


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--count", type=int, help="pictures of each folder; default all")
    parser.add_argument("-e", "--effort", type=int, default=5)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    args = parser.parse_args()
    print(header(args.data), flush=True)
    rows = []
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        work = partial(measured, effort=args.effort)
        for group, name, sizes in pool.map(work, pictures(args.data, args.count)):
            rows.append((group, sizes))
            cells = ", ".join(f"{k} {v:.0f}" for k, v in sizes.items())
            print(f"{group}/{name}: {cells} bytes", flush=True)
    for group in dict.fromkeys(g for g, _ in rows):
        mine = [sizes for g, sizes in rows if g == group]
        for other in (*LOSSLESS, "AVIF 4:4:4"):
            ratios = [s["pxi"] / s[other] for s in mine if s["pxi"] > 0 and s[other] > 0]
            twice = sum(r > 2 for r in ratios)
            print(f"{group}: pxi at {LEVEL:g} dB has {statistics.median(ratios):.2f} times the "
                  f"bytes of {other} (median of {len(ratios)} of {len(mine)}); more than twice: "
                  f"{twice}")  # fmt: skip


if __name__ == "__main__":
    main()
