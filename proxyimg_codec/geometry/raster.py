"""Rasterization of triangles: the triangle that holds each sample of a grid."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..limits import SAMPLE_COST_BITS, Budget

Floats = NDArray[np.float64]

BATCH = 1 << 21
"""Rows of triangles, and samples in them, handled at a time, which bounds memory."""


def rasterize(
    corners: Floats, x0: int, y0: int, width: int, height: int, budget: Budget | None = None
) -> NDArray[np.int32]:
    """Finds the triangle that holds the centre of each sample of a rectangle.

    Where triangles overlap, one with positive orientation wins over others, then the one with the
    lowest number. Triangles that share an edge leave no gap, because both compute the crossings of
    the edge with rows by the same formula.

    Args:
        corners: float64 [T, 3, 2] corners x, y in samples; the sample in column i and row j has its
            centre at (i + 0.5, j + 0.5).
        x0: First column of the rectangle.
        y0: First row of the rectangle.
        width: Number of columns.
        height: Number of rows.
        budget: Running budget of the rendering; by default a new one.

    Returns:
        int32 [height, width] numbers of triangles; -1 where there is none.

    Raises:
        LimitError: There are too many triangles, or they cover the rectangle too often.
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
        # Rows count too, less one per triangle: narrow triangles cost work even if they hold no
        # sample.
        spent = int(count.sum()) + max(len(row) - len(order[part]), 0)
        budget.spend("multiply_adds", spent + len(corners) << SAMPLE_COST_BITS)
        covered += spent
        budget.check("overlap", covered // out.size)
        for some in _batches(count):
            span = np.repeat(np.arange(some.start, some.stop), count[some])
            ends = np.cumsum(count[some])
            column = np.arange(len(span)) - np.repeat(ends - count[some], count[some]) + first[span]
            # Of several values for one place numpy keeps the last, so triangles drawn later win.
            out[row[span] * width + column] = order[part][triangle[span]]
    return out.reshape(height, width)


def _batches(count: NDArray[np.int64]) -> Iterator[slice]:
    """Yields slices of items whose counts [n] add up to about `BATCH`."""
    total = np.cumsum(count)
    start = 0
    while start < len(count):
        done = int(total[start - 1]) if start else 0
        stop = max(int(np.searchsorted(total, done + BATCH, side="right")), start + 1)
        yield slice(start, stop)
        start = stop


def _rows(corners: Floats, y0: int, height: int) -> NDArray[np.int64]:
    """Number of rows [T] that each triangle crosses."""
    y = corners[..., 1]
    top = np.clip(np.ceil(y.min(1) - 0.5), y0, y0 + height)
    bottom = np.clip(np.ceil(y.max(1) - 0.5), y0, y0 + height)
    rows: NDArray[np.int64] = (bottom - top).astype(np.int64)
    return rows


def _spans(
    corners: Floats, x0: int, y0: int, width: int, height: int
) -> tuple[NDArray[np.int64], ...]:
    """Triangle, row, first column, and column after the last, for each row of each triangle."""
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
        # The two triangles of an edge have to run along it in the same direction.
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
