"""Cost of decoding what is asked: whole pictures, thumbnails, regions; beside plugins of Pillow.

The table that it prints has CPU-milliseconds of one thread, in this process after a first picture,
and the peak of memory, in a process of its own. Peers decode the same picture at about the same
number of bytes; what is no part of a request (a region, a smaller size) they decode and drop, but
for the reduced sizes that they offer by `Image.draft`. Pictures of this package are encoded with
`--effort`, and with four layers; the large one is a mosaic of the pictures in ``photo2k/``.
"""

from __future__ import annotations

import argparse
import io
import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import proxyimg_codec as pxi
from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.encoder.pyramid.tiles import with_tiles
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.native import kernel
from proxyimg_codec.render import thumbnail

from .common import Pixels, header, read_rgb, run_limited

PEERS = {"AVIF": ("pillow_avif", "AVIF"), "HEIF": ("pillow_heif", "HEIF"),
         "JPEG XL": ("pillow_jxl", "JXL"), "JPEG": ("", "JPEG")}  # fmt: skip
"""Module that brings a format to Pillow, and its name there."""

QUALITIES = (10, 20, 30, 40, 50, 60, 70, 80, 90)
"""Qualities of peers, of which the one with the closest number of bytes is taken."""

THUMBNAIL = 256
"""Longer side of thumbnails in pixels."""


def masks(height: int, width: int) -> dict[str, Any]:
    """Three ellipses as layers in front of a back."""
    y, x = np.mgrid[:height, :width]
    places = {"a": (0.3, 0.4, 0.15, 0.25), "b": (0.6, 0.5, 0.2, 0.3), "c": (0.75, 0.7, 0.1, 0.15)}
    return {
        name: ((x / width - cx) / rx) ** 2 + ((y / height - cy) / ry) ** 2 < 1
        for name, (cx, cy, rx, ry) in places.items()
    }


def mosaic(folder: Path) -> Pixels:
    """Picture of 4000x3000 pixels from six of a folder."""
    parts = [read_rgb(path)[60:1060, :2000] for path in sorted(folder.glob("*.webp"))[:6]]
    return np.vstack([np.hstack(parts[k : k + 2]) for k in (0, 2, 4)]).astype(np.uint8)


def cost(work: Callable[[], Any], times: int) -> float:
    """Median of the CPU-milliseconds of some work."""
    spent = []
    for _ in range(times):
        start = time.process_time()
        work()
        spent.append(1000 * (time.process_time() - start))
    return statistics.median(spent)


def memory(path: Path, request: dict[str, Any]) -> float:
    """Megabytes that a process which draws a request of a file takes at most; on Linux only."""
    code = f"import proxyimg_codec as pxi; pxi.open({str(path)!r}).render(**{request!r})\n"
    # Unlike what getrusage tells, this has nothing of the process that started it.
    code += "print(*(v.split()[1] for v in open('/proc/self/status') if v.startswith('VmHWM')))"
    return float(run_limited(code, 1)[0].strip()) / 1024


def requests(width: int, height: int, side: int) -> dict[str, dict[str, Any]]:
    """Requests by name: all, a thumbnail, and a region in the middle."""
    small = {"width": THUMBNAIL} if width >= height else {"height": THUMBNAIL}
    region = (width // 2 - side // 3, height // 2 - side // 3, side, side)
    return {"full": {}, "thumbnail": small, f"region {side}": {"region": region}}


def _drawn(data: bytes, request: dict[str, Any]) -> Pixels:
    return pxi.from_bytes(data).render(**request)


def measured(data: bytes, path: Path, side: int, times: int) -> list[list[str]]:
    """Rows of the table for a file of this package."""
    path.write_bytes(data)
    image = pxi.from_bytes(data)
    rows = []
    for name, request in requests(image.width, image.height, side).items():
        spent = cost(partial(_drawn, data, request), times)
        note = f"{memory(path, request):.0f} MB"
        if name == "thumbnail":
            found = image.render(**request)
            with mock.patch.object(thumbnail, "raster", return_value=None):
                exact = pxi.from_bytes(data).render(**request)
            error = psnr_8bit(found, exact)
            note += ", equal" if error is None else f", {error:.1f} dB to that of all levels"
        rows.append([path.stem, f"{len(data):,}", name, f"{spent:.0f}", note])
    return rows


def peer(name: str, pixels: Pixels, size: int, side: int, times: int) -> list[list[str]]:
    """Rows of the table for a format of Pillow."""
    from PIL import Image as pillow

    module, kind = PEERS[name]
    if module:
        try:
            own = __import__(module)
        except ImportError:
            return [[name, "", "", "", "absent"]]
        getattr(own, "register_heif_opener", lambda: None)()
    source, files = pillow.fromarray(pixels), []
    for quality in QUALITIES:
        out = io.BytesIO()
        source.save(out, kind, quality=quality)
        files.append(out.getvalue())
        if len(files[-1]) > 2 * size:
            break
    data = min(files, key=lambda v: abs(len(v) - size))
    height, width = pixels.shape[:2]

    def draw(request: dict[str, Any]) -> Any:
        opened = pillow.open(io.BytesIO(data))
        if "region" in request:
            x, y, w, h = request["region"]
            return np.asarray(opened.crop((x, y, x + w, y + h)))
        if request:
            opened.thumbnail((THUMBNAIL, THUMBNAIL))
        return np.asarray(opened)

    return [
        [name, f"{len(data):,}", what, f"{cost(partial(draw, how), times):.0f}", ""]
        for what, how in requests(width, height, side).items()
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with kodak/ and photo2k/")
    parser.add_argument("--out", type=Path, default=Path("decode-files"), help="folder for files")
    parser.add_argument("--effort", type=int, default=1, help="effort of the encoder")
    parser.add_argument("--times", type=int, default=5, help="runs of which the median is taken")
    args = parser.parse_args(argv)
    args.out.mkdir(parents=True, exist_ok=True)
    print(header(args.data))
    print("kernel:", "yes" if kernel.available() else "no")
    pictures = [
        (name, read_rgb(args.data / "kodak" / f"{name}.png"), 64) for name in ("kodim23", "kodim05")
    ]
    pictures.append(("mosaic", mosaic(args.data / "photo2k"), 512))
    for name, pixels, side in pictures:
        path = args.out / f"{name}.pxi"
        if not path.exists():
            shapes = masks(*pixels.shape[:2])
            pxi.encode(pixels, effort=args.effort, masks=shapes).save(path)
        image = pxi.open(path)
        rows = measured(path.read_bytes(), path, side, args.times)
        parts = path.with_stem(f"{name} in tiles")
        tiled = with_tiles(image.picture, Settings(tiles="always"))
        rows += measured(to_bytes(tiled), parts, side, args.times)
        for other in PEERS:
            rows += peer(other, pixels, path.stat().st_size, side, args.times)
        print(f"\n{name}, {pixels.shape[1]}x{pixels.shape[0]}")
        print(f"{'file':<20}{'bytes':>12}  {'request':<12}{'CPU-ms':>8}  remarks")
        for row in rows:
            print(f"{row[0]:<20}{row[1]:>12}  {row[2]:<12}{row[3]:>8}  {row[4]}")


if __name__ == "__main__":
    main()
