"""Quality at the borders of pictures whose sides are no multiples of 64.

    python -m benchmarks.borders DATA [--count N] [--efforts 1,3,5] [--qualities 30,60,90]
        [--only edges rd] [--kinds colour grey deep alpha] [--write DIR] [-j N]

*edges*: a cut of a picture is encoded, and once more when it is cut 64 samples larger on all sides.
The PSNR of the outer 16 samples on each side of the cut is compared with that of the same samples
in the larger one. *rd*: BD-rates of cuts with such sides, and of cuts of the same pictures at the
same places with sides that are multiples of 64. `--write` writes these cuts to two folders, for
`pxi-bench rd`. Cuts are of Kodak and of `photo/`; their sides are 1 .. 63 above a multiple of 64,
with all residues of 8.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import Pixels, header, kodak, read_rgb
from proxyimg_codec import encode
from proxyimg_codec.bench import measure, peers
from proxyimg_codec.io import raster

RING, BEYOND = 16, 64
"""Samples at a border that are judged, and samples by which the larger cut reaches further."""

EDGE_SIDES, RD_SIDES = (128, 128), (320, 256)
"""Multiples of 64 to which the sides of cuts, across and down, add 1 .. 63."""

KINDS = ("colour", "grey", "deep", "alpha")
PEERS = ("jpeg", "webp", "avif420", "avif444")
RATES = (0.15, 1.2)
"""Bits a pixel between which BD-rates are taken."""


class Cut(NamedTuple):
    """Part of a picture.

    Attributes:
        file: The picture file.
        x: First column.
        y: First row.
        width: Number of columns.
        height: Number of rows.
    """

    file: Path
    x: int
    y: int
    width: int
    height: int

    def of(self, pixels: Pixels, by: int = 0) -> Pixels:
        """The part of `pixels` [H, W, C], `by` samples larger on all sides."""
        rows = slice(self.y - by, self.y + self.height + by)
        return np.ascontiguousarray(pixels[rows, self.x - by : self.x + self.width + by])


def cuts(data: Path, count: int, sides: tuple[int, int], margin: int) -> Iterator[Cut]:
    """Yields cuts of pictures of `data` with at least `margin` samples around them."""
    files = sorted((data / "photo").glob("*.*")) + kodak(data)
    large = [f for f in files if min(read_rgb(f).shape[:2]) >= max(sides) + 63 + 2 * margin]
    rng = np.random.default_rng(0)
    for k in range(count):
        file = large[k % len(large)]
        size = [side + 1 + (7 * k + 5 * i) % 63 for i, side in enumerate(sides)]
        room = [n - s - 2 * margin for n, s in zip(read_rgb(file).shape[1::-1], size, strict=True)]
        x, y = (margin + int(rng.integers(0, r + 1)) for r in room)
        yield Cut(file, x, y, *size)


def source(file: Path, kind: str) -> Pixels:
    """Reads a picture as one of `KINDS`: [H, W, 3 or 4] uint8 or uint16."""
    pixels = read_rgb(file)
    if kind == "grey":
        return pixels[..., 1:2].repeat(3, 2)
    if kind == "deep":
        # Means of neighbours have more than 8 bits.
        return np.asarray(cv2.blur(pixels.astype(np.float32) * 257, (2, 2)).round(), np.uint16)
    if kind == "alpha":
        smooth = cv2.GaussianBlur(pixels[..., 1].astype(np.float32), (0, 0), 6)
        alpha = np.clip((smooth - np.median(smooth)) * 6 + 160, 0, 255).astype(np.uint8)
        return np.dstack([pixels, alpha])
    return pixels


def shown(pixels: Pixels, effort: int, quality: float) -> NDArray[np.float64]:
    """Encodes and decodes a picture; its error squared, [H, W], in squares of 8-bit levels."""
    image = encode(pixels, effort=effort, quality=quality, max_layers=1, jobs=1, texture="pyramid")
    scale = 255 / np.iinfo(pixels.dtype).max
    pair = [p.astype(np.float64) * scale for p in (pixels, image.render(dtype=pixels.dtype.type))]
    if pixels.shape[2] == 3:
        return np.asarray(((pair[0] - pair[1]) ** 2).mean(2))
    grounds = []
    for ground in (0, 255):  # over black and over white
        a, b = (p[..., :3] * (s := p[..., 3:] / 255) + ground * (1 - s) for p in pair)
        grounds.append(((a - b) ** 2).mean(2))
    return np.asarray((grounds[0] + grounds[1]) / 2)


def decibel(error: NDArray[np.float64]) -> float:
    """PSNR in dB of squared errors."""
    return 10 * math.log10(255**2 / max(float(error.mean()), 1e-4))


def edges(job: tuple[Cut, str, int, float]) -> list[float]:
    """Differences in dB on the left, on top, on the right, below: the cut less the larger one."""
    cut, kind, effort, quality = job
    pixels = source(cut.file, kind)
    own = shown(cut.of(pixels), effort, quality)
    other = shown(cut.of(pixels, BEYOND), effort, quality)[BEYOND:-BEYOND, BEYOND:-BEYOND]
    ring = slice(None, RING), slice(-RING, None)
    sides = [(slice(None), ring[0]), (ring[0],), (slice(None), ring[1]), (ring[1],)]
    return [decibel(own[side]) - decibel(other[side]) for side in sides]


def rounded(cut: Cut) -> Cut:
    """The same cut with sides that are the nearest multiples of 64."""
    width, height = (64 * max(round(n / 64), 1) for n in (cut.width, cut.height))
    return cut._replace(width=width, height=height)


def curve(job: tuple[Cut, str, int]) -> list[tuple[float, float]]:
    """Rates in bpp and PSNR in dB of a cut by a codec, at all its qualities."""
    cut, name, effort = job
    codec = peers.codecs(effort)[name]
    pixels = cut.of(read_rgb(cut.file))
    points = []
    for quality in codec.qualities:
        data = codec.encode(pixels, quality)
        rate = 8 * len(data) / (cut.width * cut.height)
        points.append((rate, measure.psnr(pixels, codec.decode(data))))
    return points


def report_edges(run: Any, args: argparse.Namespace) -> None:
    """Prints the differences at borders, by kind, effort and quality."""
    chosen = list(cuts(args.data, args.count, EDGE_SIDES, BEYOND))
    everything = []
    for kind, effort, quality in product(args.kinds, args.efforts, args.qualities):
        some = chosen if kind == "colour" else chosen[::4]
        found = np.array(list(run(edges, [(cut, kind, effort, quality) for cut in some])))
        everything.append(found)
        sides = " ".join(f"{v:+.2f}" for v in found.mean(0))
        print(f"{kind:6} effort {effort} quality {quality:g}: mean {found.mean():+.2f} dB, worst "
              f"{found.min():+.2f} (left, top, right, below: {sides}; {len(some)} cuts)",
              flush=True)  # fmt: skip
    whole = np.concatenate(everything)
    print(f"all: mean {whole.mean():+.2f} dB, worst {whole.min():+.2f}")


def report_rd(run: Any, args: argparse.Namespace) -> None:
    """Prints BD-rates of both kinds of cuts."""
    chosen = list(cuts(args.data, args.count, RD_SIDES, 1))
    both = chosen, [rounded(cut) for cut in chosen]
    for effort in args.efforts:
        rates: dict[str, list[float]] = {}
        for some in both:
            names = ("pxi", *PEERS)
            curves = {n: list(run(curve, [(cut, n, effort) for cut in some])) for n in names}
            for name in PEERS:
                each = [
                    measure.bd_rate(a, b, RATES)
                    for a, b in zip(curves["pxi"], curves[name], strict=True)
                ]
                rates.setdefault(name, []).append(float(np.nanmean(each)))
        for name, (odd, even) in rates.items():
            print(f"effort {effort}, BD-rate vs {name}: {odd:+.1f} % odd, {even:+.1f} % multiples "
                  f"of 64, difference {odd - even:+.2f}", flush=True)  # fmt: skip


def write(args: argparse.Namespace) -> None:
    """Writes the cuts of *rd* as PNG files to `DIR/odd` and `DIR/even`."""
    for cut in cuts(args.data, args.count, RD_SIDES, 1):
        for kind, part in (("odd", cut), ("even", rounded(cut))):
            folder = args.write / kind
            folder.mkdir(parents=True, exist_ok=True)
            name = f"{cut.file.stem}_{part.width}x{part.height}.png"
            raster.write(folder / name, part.of(read_rgb(cut.file)))


def main() -> None:
    """Entry point."""
    numbers = partial(str.split, sep=",")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--efforts", type=lambda s: [int(v) for v in numbers(s)], default=[1, 3, 5])
    parser.add_argument("--qualities", type=lambda s: [float(v) for v in numbers(s)],
                        default=[30.0, 60.0, 90.0])  # fmt: skip
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--only", nargs="+", choices=("edges", "rd"), default=("edges", "rd"))
    parser.add_argument("--write", type=Path)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    args = parser.parse_args()
    if args.write:
        write(args)
        return
    print(header(args.data))
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        run = partial(pool.map, chunksize=1)
        if "edges" in args.only:
            report_edges(run, args)
        if "rd" in args.only:
            report_rd(run, args)


if __name__ == "__main__":
    main()
