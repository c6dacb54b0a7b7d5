"""Section *explicit*: flat pictures and photographs, with as many parameters as ten shapes have."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import InputError
from .items import Earlier, Effort, Item, Pixels, Row
from .pictures import over_white
from .tables import Column, Table

if TYPE_CHECKING:
    from ..peers import Codec

SHAPES, SHAPE_PARAMETERS = 10, 28
"""Shapes, and parameters of one as LIVE counts: 12 points of a closed path of four cubic segments,
and a colour with opacity."""

PARAMETERS = SHAPES * SHAPE_PARAMETERS

BYTES = 4 * PARAMETERS
"""Bytes of so many 32-bit numbers, which files may have."""

FOLDERS = ("emoji", "clipart", "kodak")

TABLE = Table(
    rows=("folder", "method"),
    columns=(
        Column("mse", "MSE ×10⁻³", "{:.3f}"),
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("ssim", "SSIM", "{:.4f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("parameters", "parameters", "{:.0f}"),
        Column("bytes", "bytes", "{:.0f}"),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="psnr",
    paper=(
        {"folder": "emoji", "method": "ProxyImg (paper)", "mse": 0.12},
        {"folder": "icons", "method": "ProxyImg (paper)", "mse": 0.11},
    ),
    notes=(
        f"Ten shapes are counted as LIVE does: {SHAPE_PARAMETERS} numbers each (12 points of a "
        f"closed path of four cubic segments, red, green, blue and opacity), {PARAMETERS} in all, "
        f"or {BYTES} bytes of 32-bit numbers. How the paper counts is not known here.",
        "The paper's pictures are others, and its icons are not cliparts; its MSE is taken to be "
        "of colours in 0..1, as here.",
        "Pictures with transparency are drawn over white. Larger ones are central crops.",
        "There are as many Gaussians as fit the parameters, fitted with twice the steps until that "
        "gains less than 0.1 dB or a bound is reached. Files are whole files of about the same "
        "bytes; one that is much larger could not be smaller.",
        "LPIPS is not measured: its backbones are not to be had here. Differentiable Bézier "
        "renderers (DiffVG, LIVE) and tracers are still missing.",
    ),
)


def items(data: Path, effort: Effort) -> list[Item]:
    """Items of pictures of ``emoji/``, ``clipart/`` and ``kodak/``, as far as they are there.

    Raises:
        InputError: None of the folders is there, or a picture is damaged.
    """
    there = [folder for folder in FOLDERS if (data / folder).is_dir()]
    if not there:
        raise InputError(f"{data}: holds none of the folders {', '.join(FOLDERS)}")
    runs: dict[str, Any] = {
        "gaussians": partial(_gaussians, first=effort.first, most=effort.most),
        "pyramid": partial(_file, layers=1, effort=effort.effort),
        "layers": partial(_file, layers=4, effort=effort.effort),
        "webp": _webp,
    }
    return [
        Item("explicit", f"{folder} {name}", label, repr(effort), pixels, partial(run, folder))
        for folder in there
        for name, pixels in over_white(data / folder, effort.pictures, effort.side)
        for label, run in runs.items()
    ]


def _row(folder: str, method: str, pixels: Pixels, shown: Pixels, more: Mapping[str, Any]) -> Row:
    from ..measure import mean_square, ms_ssim, psnr, ssim

    return {
        "folder": folder, "method": method,
        "mse": round(1000 * mean_square(pixels, shown) / 255**2, 5),
        "psnr": round(psnr(pixels, shown), 4), "ssim": round(ssim(pixels, shown), 6),
        "ms_ssim": round(ms_ssim(pixels, shown), 6), **more,
    }  # fmt: skip


def _gaussians(
    folder: str, pixels: Pixels, earlier: Earlier, *, first: int, most: int
) -> list[Row]:
    from ..rivals import fitting, gaussians

    height, width = pixels.shape[:2]
    make = partial(gaussians.Gaussians, PARAMETERS, width, height)
    found = fitting.fit_converged(make, pixels, first, most)
    assert found.shown is not None, "what is fitted is drawn"
    more = {"parameters": found.parameters, "seconds": round(found.seconds, 2)}
    return [_row(folder, "2-D Gaussians", pixels, found.shown, more)]


def _file(folder: str, pixels: Pixels, earlier: Earlier, *, layers: int, effort: int) -> list[Row]:
    from .ours import of_size

    started = time.process_time()
    image = of_size(pixels, BYTES, max_layers=layers, effort=effort)
    more = {"bytes": len(image.to_bytes()), "seconds": round(time.process_time() - started, 2)}
    method = "pxi pyramid" if layers == 1 else "pxi pyramid, found layers"
    return [_row(folder, method, pixels, image.render(), more)]


def _webp(folder: str, pixels: Pixels, earlier: Earlier) -> list[Row]:
    from ..peers import codecs

    webp = codecs()["webp"]
    started = time.process_time()
    data = largest(webp, pixels, BYTES)
    seconds = round(time.process_time() - started, 2)
    return [_row(folder, "WebP", pixels, webp.decode(data), {"bytes": len(data),
                                                            "seconds": seconds})]  # fmt: skip


def largest(codec: Codec, pixels: Pixels, size: int) -> bytes:
    """File of the highest whole quality that has at most `size` bytes; else the lowest quality."""
    low, high = (int(q) for q in codec.limits)
    best = codec.encode(pixels, low)
    while low < high:
        middle = (low + high + 1) // 2
        data = codec.encode(pixels, middle)
        if len(data) <= size:
            low, best = middle, data
        else:
            high = middle - 1
    return best
