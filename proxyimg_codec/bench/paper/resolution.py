"""Section *resolution*: pictures made smaller, encoded, and drawn at their first size."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...encoder.settings import PRESETS
from ..measure import ms_ssim, psnr
from .items import Earlier, Effort, Given, Item, Pixels, Row
from .pictures import crops
from .tables import Column, Table, mean

CODERS: dict[str, dict[str, Any]] = {
    "direct": {"texture": "implicit", "max_layers": 1},
    "node": PRESETS["paper"],
    "pyramid": {"max_layers": 1},
}
"""Settings of the encoder, by names of rows."""

FACTORS = (2, 4)

ENLARGED = {"bicubic": cv2.INTER_CUBIC, "Lanczos": cv2.INTER_LANCZOS4}

EDGES = 5.0
"""Per cent of the pixels, those with the steepest gradients, at which sharpness is measured."""

ALIKE = 0.05
"""Differences in dB that are none."""


def conclusions(rows: Sequence[Row]) -> list[str]:
    """Sentences on whether drawing larger helps more than enlarging the decoded picture."""
    means = {names: mean(group, "psnr") for names, group in TABLE.grouped(rows).items()}
    said = []
    for (factor, method, drawn), own in means.items():
        best = max((means.get((factor, method, e)) or 0.0) for e in ENLARGED)
        if drawn != "by itself" or own is None or not best:
            continue
        gain = own - best
        verdict = "helps" if gain > ALIKE else "is worse" if gain < -ALIKE else "does not help"
        said.append(f"{method}, {factor}: drawing at the first size {verdict} "
                    f"({gain:+.2f} dB against the better filter).")  # fmt: skip
    return said


TABLE = Table(
    rows=("factor", "method", "drawn"),
    columns=(
        Column("psnr", "PSNR dB", "{:.2f}"),
        Column("ms_ssim", "MS-SSIM", "{:.4f}"),
        Column("sharpness", "sharpness", "{:.3f}"),
        Column("small_psnr", "PSNR dB when small", "{:.2f}"),
        Column("bytes", "bytes", "{:.0f}"),
    ),
    charted="psnr",
    conclusions=conclusions,
    notes=(
        "Pictures are reduced by a factor with area means, encoded, and drawn at their first size "
        "by the coder itself (*by itself*), or decoded small and enlarged by OpenCV's bicubic or "
        "Lanczos filter. *no coder* enlarges the small picture without coding it.",
        "Sharpness is the mean gradient (Sobel, of grey) where the original's is among the "
        "steepest 5 %, over that of the original: 1 is as sharp, less is blurred.",
        "The pyramid is a raster: drawn larger it is interpolated, and promises no detail.",
        "Figures of the paper to compare with are not known here.",
    ),
)  # fmt: skip


def items(given: Given, effort: Effort) -> list[Item]:
    """Items of crops of ``kodak/``.

    Raises:
        InputError: The folder is missing.
    """
    found = []
    for name, pixels in crops(given.data / "kodak", effort.pictures, effort.side):
        for factor in FACTORS:
            for coder in (None, *CODERS):
                run = partial(_measure, factor=factor, coder=coder, effort=effort.effort)
                label = f"{coder or 'no coder'}, {factor}"
                found.append(Item("resolution", name, label, repr(effort), pixels, run))
    return found


def _measure(
    pixels: Pixels, earlier: Earlier, *, factor: int, coder: str | None, effort: int
) -> list[Row]:
    from ...api import encode

    height, width = (n // factor * factor for n in pixels.shape[:2])
    pixels = np.ascontiguousarray(pixels[:height, :width])
    size = (width // factor, height // factor)
    small = decoded = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    shown, count = {}, None
    if coder is not None:
        image = encode(small, effort=effort, jobs=1, **CODERS[coder])
        count, decoded = len(image.to_bytes()), image.render()
        shown["by itself"] = image.render(width=width, height=height)
    for name, method in ENLARGED.items():
        grown = cv2.resize(decoded, (width, height), interpolation=method)
        shown[name] = np.asarray(grown, np.uint8)
    return [{
        "factor": f"1/{factor}", "method": f"pxi {coder}" if coder else "no coder", "drawn": drawn,
        "psnr": round(psnr(pixels, one), 4), "ms_ssim": round(ms_ssim(pixels, one), 6),
        "sharpness": round(sharpness(pixels, one), 5), "bytes": count,
        "small_psnr": round(psnr(small, decoded), 4) if coder else None,
    } for drawn, one in shown.items()]  # fmt: skip


def sharpness(original: Pixels, shown: Pixels) -> float:
    """Mean gradient at the edges of a picture over that of its original, both uint8 [H, W, 3]."""
    first, second = (_gradient(p) for p in (original, shown))
    edges = first >= np.percentile(first, 100 - EDGES)
    return float(second[edges].mean() / max(float(first[edges].mean()), 1e-9))


def _gradient(pixels: Pixels) -> NDArray[np.float64]:
    grey = pixels.astype(np.float64).mean(2)
    x, y = (cv2.Sobel(grey, cv2.CV_64F, dx, 1 - dx) for dx in (1, 0))
    return np.asarray(np.hypot(x, y), np.float64)
