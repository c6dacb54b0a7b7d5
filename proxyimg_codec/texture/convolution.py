"""Convolutions of planes as matrix products, in strips of rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .network import Floats

STRIP, LEAST = 1 << 11, 4
"""Positions convolved at a time, which bounds memory, and the least number of rows."""


def strips(height: int, width: int) -> Iterator[tuple[int, int]]:
    """Yields the first row and the end of each strip of a plane."""
    rows = max(STRIP // width, LEAST)
    for top in range(0, height, rows):
        yield top, min(top + rows, height)


def by_row(weights: NDArray[Any]) -> Floats:
    """Rearranges weights [out, C, k, k] to one matrix per kernel row, float32 [k, k * C, out]."""
    w = weights.transpose(2, 3, 1, 0)
    return np.ascontiguousarray(w.reshape(len(w), -1, w.shape[3]), np.float32)


def convolved(plane: NDArray[Any], rows: Floats, top: int, bottom: int) -> Floats:
    """Convolves a strip of a plane; positions outside the plane count as 0.

    Args:
        plane: [h, w, C] values.
        rows: float32 [k, k * C, out] weights, as `by_row` makes them.
        top: First row of the result; may be negative.
        bottom: Row after the last; may be larger than h.

    Returns:
        float32 [(bottom - top) * w, out].
    """
    h, w, channels = plane.shape
    size = len(rows)
    reach = size // 2
    count = bottom - top
    start, end = max(top - reach, 0), min(bottom + reach, h)
    padded = np.zeros((count + size - 1, w + size - 1, channels), np.float32)
    inside = slice(start - top + reach, end - top + reach)
    padded[inside, reach : w + reach] = plane[start:end]
    # The neighbours of a position in one row are contiguous in memory, so a window is a view.
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
