"""Section *explicit*: flat pictures and photographs, with as many parameters as ten shapes have."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ...errors import InputError
from ..rivals import traced
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import over_white
from .tables import Column, Table, mean

if TYPE_CHECKING:
    from ..peers import Codec

SHAPES, SHAPE_PARAMETERS = 10, 28
"""Shapes, and parameters of one as LIVE counts: 12 points of a closed path of four cubic segments,
and a colour with opacity."""

PARAMETERS = SHAPES * SHAPE_PARAMETERS

BYTES = 4 * PARAMETERS
"""Bytes of so many 32-bit numbers, which files may have."""

FOLDERS = ("emoji", "clipart", "kodak")

FLAT = ("emoji", "clipart")
"""Folders of flat art, which is traced."""


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on the paper's figures, where they are missed, and on what could not run."""
    said = []
    for folder, (kind, most) in PAPER_MSE.items():
        means = {names[1]: mean(group, "mse") for names, group in TABLE.grouped(rows).items()
                 if names[0] == folder}  # fmt: skip
        known = {m: v for m, v in means.items() if v is not None}
        ours = {m: v for m, v in known.items() if m.startswith("pxi")}
        if ours:
            best, first = min(ours, key=lambda m: ours[m]), min(known, key=lambda m: known[m])
            verdict = "reached" if ours[best] <= most else "not reached"
            said.append(
                f"{folder}: {best} has {ours[best]:.2f}e-3; the paper's {most}e-3 of {kind} is "
                f"{verdict} with as many bytes. Lowest of all: {first}."
            )
    if not any(r["method"].startswith("VTracer") for r in rows):
        said.append("VTracer is missing: `pip install vtracer` brings it.")
    return said


PAPER_MSE = {"emoji": ("emoji", 0.12), "clipart": ("icons", 0.11)}
"""Kind and MSE ×10⁻³ of the paper's flat pictures, by the folder of ours that is like them."""

TABLE = Table(
    rows=("folder", "method"),
    columns=(
        Column("mse", "MSE ×10⁻³", "{:.3f}"),
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("ssim", "SSIM", "{:.4f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("gradients", "HOG distance", "{:.3f}"),
        Column("parameters", "parameters", "{:.0f}"),
        Column("bytes", "bytes", "{:.0f}"),
        Column("seconds", "CPU s", "{:.1f}"),
    ),
    charted="psnr",
    paper=(
        *({"folder": k, "method": "ProxyImg (paper)", "mse": v} for k, v in PAPER_MSE.values()),
    ),
    conclusions=conclusions,
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
        "Bézier paths are a short implementation in the manner of LIVE: ten paths, added one by "
        "one where the picture is worst, with squared errors alone and edges that are ramps. "
        "VTracer traces flat art with the best of 27 settings that fit the numbers of ten shapes "
        "(the smallest where none does), and with the best of all.",
        "The distance of gradients (HOG) stands where the paper has LPIPS: unit vectors of "
        "histograms of oriented gradients in cells of 8, 16 and 32 px. It is no learned measure. "
        "The linear heads of the `lpips` package need backbones that no package brings; "
        "`--weights lpips=FILE` measures it in the section on editing.",
    ),
)


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of pictures of ``emoji/``, ``clipart/`` and ``kodak/``, as far as they are there.

    Raises:
        InputError: None of the folders is there, or a picture is damaged.
    """
    there = [folder for folder in FOLDERS if (given.data / folder).is_dir()]
    if not there:
        raise InputError(f"{given.data}: holds none of the folders {', '.join(FOLDERS)}")
    runs: dict[str, Any] = {
        "gaussians": partial(_gaussians, first=effort.first, most=effort.most),
        "pyramid": partial(_file, layers=1, effort=effort.effort),
        "layers": partial(_file, layers=4, effort=effort.effort),
        "paths": partial(_paths, steps=effort.paths),
        "webp": _webp,
    }
    if traced.available():
        runs["traced"] = _traced
    return [
        Item("explicit", f"{folder} {name}", label, repr(effort), pixels, partial(run, folder))
        for folder in there
        for name, pixels in over_white(given.data / folder, effort.pictures, effort.side)
        for label, run in runs.items()
        if label != "traced" or folder in FLAT
    ]


def _row(folder: str, method: str, pixels: Pixels, shown: Pixels, more: Mapping[str, Any]) -> Row:
    from ..features import distance
    from ..measure import mean_square, ms_ssim, psnr, ssim

    return {
        "folder": folder, "method": method,
        "mse": round(1000 * mean_square(pixels, shown) / 255**2, 5),
        "psnr": round(psnr(pixels, shown), 4), "ssim": round(ssim(pixels, shown), 6),
        "ms_ssim": round(ms_ssim(pixels, shown), 6),
        "gradients": round(float(distance(pixels, shown).mean()), 5), **more,
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


def _paths(folder: str, pixels: Pixels, earlier: Earlier, *, steps: int) -> list[Row]:
    from ..rivals import bezier

    found = bezier.fit(pixels, SHAPES, steps)
    assert found.shown is not None, "what is fitted is drawn"
    more = {"parameters": found.parameters, "seconds": round(found.seconds, 2)}
    return [_row(folder, "Bézier paths", pixels, found.shown, more)]


def _traced(folder: str, pixels: Pixels, earlier: Earlier) -> list[Row]:
    rows = []
    for method, most in (("VTracer, as few numbers", PARAMETERS), ("VTracer, any number", None)):
        started = time.process_time()
        shown, count = traced.traced(pixels, most)
        more = {"parameters": count, "seconds": round(time.process_time() - started, 2)}
        rows.append(_row(folder, method, pixels, shown, more))
    return rows


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
