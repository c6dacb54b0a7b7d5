"""Scores of what is drawn in a hole, against the truth and against its surroundings.

Functions without files; a part of `benchmarks.background`. Pictures are [H, W, 3] in 0..255.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import Pixels

Mask = NDArray[np.bool_]
Real = NDArray[np.float64]

STEPS = (1, 2, 4)
"""Scales in pixels at which the energy of gradients is compared."""

ALIKE = (0.5, 1.5)
"""Ratios of energies to the true ones that count as alike."""

BINS, CELL = 9, 16
"""Orientations of a histogram, over half a turn, and the side of its cell in pixels."""

REACH, AROUND = 3, 60
"""Patches are squares of 2 `REACH` + 1 pixels; how far around a hole they are looked for."""

ASKED, OFFERED = 400, 12_000
"""Most patches of a hole that are looked for, and most among which they are, both drawn."""


def dilated(mask: Mask, radius: int) -> Mask:
    """Mask grown by squares of 2 `radius` + 1 pixels."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), _square(radius)) > 0)


def eroded(mask: Mask, radius: int) -> Mask:
    """Mask shrunk by squares of 2 `radius` + 1 pixels; the frame does not shrink it."""
    return np.asarray(cv2.erode(mask.astype(np.uint8), _square(radius)) > 0)


def rim(mask: Mask, width: int) -> Mask:
    """Pixels of a mask that are at most `width` pixels from its outside."""
    return mask & (cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5) <= width)


def energies(picture: Pixels, where: Mask) -> Real:
    """Mean squares of gradients, at each of `STEPS`.

    The mean of the channels is blurred with half of the step as standard deviation, and compared
    with itself a step to the left and above. Pixels closer than a step to the outside of `where`
    do not count.

    Returns:
        float64 [3]; NaN where no pixel is left.
    """
    grey, out = picture.astype(np.float32).mean(2), []
    for step in STEPS:
        soft = cv2.GaussianBlur(grey, (0, 0), step / 2) if step > 1 else grey
        square = np.zeros_like(grey)
        square[:, step:] += (soft[:, step:] - soft[:, :-step]) ** 2
        square[step:] += (soft[step:] - soft[:-step]) ** 2
        inner = eroded(where, step)
        out.append(float(square[inner].mean()) if inner.any() else np.nan)
    return np.array(out)


def alike(ratios: Real) -> NDArray[np.bool_]:
    """Whether all ratios of energies [..., 3] are within `ALIKE`, bool [...]."""
    return np.asarray(((ratios >= ALIKE[0]) & (ratios <= ALIKE[1])).all(-1))


def psnr(picture: Pixels, truth: Pixels, where: Mask) -> float:
    """PSNR in dB over the pixels `where`, at most 60."""
    error = float(((picture[where].astype(np.float64) - truth[where]) ** 2).mean())
    return float(10 * np.log10(255**2 / max(error, 255**2 / 1e6)))


def structure(picture: Pixels, truth: Pixels, where: Mask) -> float:
    """Distance of orientations from the truth, 0 (the same) .. 1 (nothing in common, or fog).

    Histograms of the orientations of gradients (Dalal and Triggs 2005), weighted by their sizes, in
    cells of `CELL` pixels; the sum of their absolute differences over their sum. So too much counts
    as too little does. Where neither has a gradient, 0.
    """
    ours, theirs = (_orientations(p, where) for p in (picture, truth))
    return float(np.abs(ours - theirs).sum() / max(float((ours + theirs).sum()), 1e-9))


def coherence(picture: Pixels, hole: Mask) -> float:
    """Median distance of patches in a hole from the most similar one in the visible surroundings.

    Args:
        picture: [H, W, 3].
        hole: bool [H, W]; surroundings are the pixels up to `AROUND` from it.

    Returns:
        Root mean square in levels; NaN if no whole patch fits in the hole or around it.
    """
    whole = np.zeros_like(hole)
    whole[REACH:-REACH, REACH:-REACH] = True
    inside = np.argwhere(eroded(hole, REACH) & whole)
    outside = np.argwhere(dilated(hole, AROUND) & ~dilated(hole, REACH) & whole)
    if not len(inside) or not len(outside):
        return float("nan")
    rng = np.random.default_rng(0)
    asked, offered = (
        _patches(picture, places[rng.permutation(len(places))[:most]])
        for places, most in ((inside, ASKED), (outside, OFFERED))
    )
    square = (asked**2).sum(1)[:, None] - 2 * asked @ offered.T + (offered**2).sum(1)
    return float(np.median(np.sqrt(np.maximum(square.min(1), 0) / asked.shape[1])))


def ratio_interval(ours: Real, theirs: Real, rounds: int = 10_000) -> tuple[float, float]:
    """Central 95 % of the ratios of means of pairs drawn with replacement (always the same)."""
    drawn = np.random.default_rng(0).integers(len(ours), size=(rounds, len(ours)))
    ratios = ours[drawn].mean(1) / np.maximum(theirs[drawn].mean(1), 1e-9)
    low, high = np.percentile(ratios, (2.5, 97.5))
    return float(low), float(high)


def _square(radius: int) -> NDArray[np.uint8]:
    return np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)


def _orientations(picture: Pixels, where: Mask) -> Real:
    """Histograms float64 [cells, BINS] of orientations; each gradient is shared by two bins."""
    grey = cv2.GaussianBlur(picture.astype(np.float32).mean(2), (0, 0), 1.0)
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *d) / 8 for d in ((1, 0), (0, 1)))
    y, x = np.nonzero(where)
    size = np.hypot(across, down)[y, x]
    angle = (np.arctan2(down, across)[y, x] % np.pi) / np.pi * BINS
    lower = np.floor(angle).astype(int)
    cell = (y // CELL) * -(-where.shape[1] // CELL) + x // CELL
    out = np.zeros((int(cell.max(initial=-1)) + 1, BINS))
    np.add.at(out, (cell, lower % BINS), size * (1 - (angle - lower)))
    np.add.at(out, (cell, (lower + 1) % BINS), size * (angle - lower))
    return out


def _patches(picture: Pixels, centres: NDArray[Any]) -> NDArray[np.float32]:
    """Patches float32 [N, K] around places [N, 2], y and x."""
    y, x = centres.T
    reach = range(-REACH, REACH + 1)
    parts = [picture[y + dy, x + dx] for dy in reach for dx in reach]
    return np.concatenate(parts, 1).astype(np.float32)
