"""Which triangle holds each sample of a grid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..limits import SAMPLE_COST_BITS, Budget

Floats = NDArray[np.float64]

BATCH = 1 << 21
"""Rows, and samples, handled at a time; bounds memory."""


def rasterize(
    corners: Floats, x0: int, y0: int, width: int, height: int, budget: Budget | None = None
) -> NDArray[np.int32]:
    """The triangle [height, width] that holds the centre of each sample, or -1.

    Where triangles overlap, those with positive orientation come first, then the lowest number.
    Triangles that share an edge leave no gap: both compute its crossings by the same formula.

    Args:
        corners: [T, 3, 2] x, y; sample (i, j) has its centre at (i + 0.5, j + 0.5).
        x0: First column.
        y0: First row.
        width: Columns.
        height: Rows.
        budget: Bounds how often samples may be covered.

    Raises:
        LimitError: The triangles cover the grid too often.
    """
    budget = budget or Budget()
    out = np.full(height * width, -1, np.int32)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    near = ((high > (x0, y0)) & (low < (x0 + width, y0 + height))).all(1)
    number = np.flatnonzero(near & (area != 0))
    order = number[np.lexsort((-number, area[number] > 0))]
    covered = 0
    for part in _batches(_rows(corners[order], y0, height)):
        triangle, row, first, last = _spans(corners[order[part]], x0, y0, width, height)
        count = np.maximum(last - first, 0)
        # Rows count too, less one a triangle: narrow triangles cost work and cover nothing.
        spent = int(count.sum()) + max(len(row) - len(order[part]), 0)
        budget.spend("multiply_adds", spent + len(corners) << SAMPLE_COST_BITS)
        covered += spent
        budget.check("overlap", covered // out.size)
        for some in _batches(count):
            span = np.repeat(np.arange(some.start, some.stop), count[some])
            ends = np.cumsum(count[some])
            column = np.arange(len(span)) - np.repeat(ends - count[some], count[some]) + first[span]
            # numpy keeps the last of several values for one place, so what is drawn later wins.
            out[row[span] * width + column] = order[part][triangle[span]]
    return out.reshape(height, width)


def _batches(count: NDArray[np.int64]) -> Iterator[slice]:
    """Slices of items that together count about `BATCH`."""
    total = np.cumsum(count)
    start = 0
    while start < len(count):
        done = int(total[start - 1]) if start else 0
        stop = max(int(np.searchsorted(total, done + BATCH, side="right")), start + 1)
        yield slice(start, stop)
        start = stop


def _rows(corners: Floats, y0: int, height: int) -> NDArray[np.int64]:
    """How many rows each triangle crosses."""
    y = corners[..., 1]
    top = np.clip(np.ceil(y.min(1) - 0.5), y0, y0 + height)
    bottom = np.clip(np.ceil(y.max(1) - 0.5), y0, y0 + height)
    rows: NDArray[np.int64] = (bottom - top).astype(np.int64)
    return rows


def _spans(
    corners: Floats, x0: int, y0: int, width: int, height: int
) -> tuple[NDArray[np.int64], ...]:
    """Triangle, row, first column and the one after the last, of each row of each triangle."""
    y = corners[..., 1]
    top = np.clip(np.ceil(y.min(1) - 0.5), y0, y0 + height).astype(np.int64)
    count = _rows(corners, y0, height)
    triangle = np.repeat(np.arange(len(corners)), count)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count) + top[triangle]
    centre = row + 0.5
    low = np.full(len(row), np.inf)
    high = np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        p, q = corners[:, i], corners[:, j]
        # Both triangles of an edge go along it in the same direction.
        swap = (p[:, 1] > q[:, 1]) | ((p[:, 1] == q[:, 1]) & (p[:, 0] > q[:, 0]))
        p, q = np.where(swap[:, None], q, p), np.where(swap[:, None], p, q)
        rise = q[:, 1] - p[:, 1]
        slope = (q[:, 0] - p[:, 0]) / np.where(rise > 0, rise, 1)
        crossed = (centre >= p[triangle, 1]) & (centre < q[triangle, 1])
        x = p[triangle, 0] + (centre - p[triangle, 1]) * slope[triangle]
        low = np.where(crossed, np.minimum(low, x), low)
        high = np.where(crossed, np.maximum(high, x), high)
    some = low <= high
    first = np.clip(np.ceil(np.where(some, low, 0) - 0.5), x0, x0 + width).astype(np.int64)
    last = np.clip(np.ceil(np.where(some, high, 0) - 0.5), x0, x0 + width).astype(np.int64)
    return triangle, row - y0, first - x0, last - x0
