"""Convolutions of planes as matrix products, in strips of rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .network import Floats

STRIP, LEAST = 1 << 11, 4
"""Positions that are convolved at a time, and rows at least: bounds memory."""


def strips(height: int, width: int) -> Iterator[tuple[int, int]]:
    """First row and end of each strip of a plane."""
    rows = max(STRIP // width, LEAST)
    for top in range(0, height, rows):
        yield top, min(top + rows, height)


def by_row(weights: NDArray[Any]) -> Floats:
    """Weights [out, C, k, k] as matrices by kernel row: float32 [k, k C, out]."""
    w = weights.transpose(2, 3, 1, 0)
    return np.ascontiguousarray(w.reshape(len(w), -1, w.shape[3]), np.float32)


def convolved(plane: NDArray[Any], rows: Floats, top: int, bottom: int) -> Floats:
    """Convolution of rows top..bottom - 1 of a plane [h, w, C]: float32 [(bottom - top) w, out].

    What lies outside the plane is 0. `rows` is from `by_row`.
    """
    h, w, channels = plane.shape
    size = len(rows)
    reach = size // 2
    count = bottom - top
    start, end = max(top - reach, 0), min(bottom + reach, h)
    padded = np.zeros((count + size - 1, w + size - 1, channels), np.float32)
    inside = slice(start - top + reach, end - top + reach)
    padded[inside, reach : w + reach] = plane[start:end]
    # Neighbours along a row are next to each other in memory: a window is one stretch.
    windows = np.lib.stride_tricks.as_strided(
        padded,
        (count + size - 1, w, size * channels),
        (padded.strides[0], padded.strides[1], padded.strides[2]),
        writeable=False,
    )
    out = np.zeros((count * w, rows.shape[2]), np.float32)
    for dy in range(size):
        out += windows[dy : dy + count].reshape(count * w, -1) @ rows[dy]
    return out
