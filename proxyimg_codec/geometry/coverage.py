"""Anti-aliased coverage of closed Bézier paths in fixed point.

Exact signed area of the flattened paths inside each output pixel (the cell accumulation of
FreeType's smooth rasterizer), nonzero rule by clamping. Everything is integer: coordinates are in
1/256 output pixel, coverage in 1/FULL, and no pixel depends on the tile it is computed in.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..limits import Budget
from ..native import kernel

Ints = NDArray[np.int64]

ONE = 256
"""Subdivisions of an output pixel."""

FULL = 2 * ONE * ONE
"""Coverage of a whole pixel."""

FLATNESS = 16
"""Largest distance of a chord from its curve, in 1/256 output pixel (estimate)."""

MAX_LOG2_CHORDS = 8

PIECES = 1 << 20
"""Pieces of edges handled at a time; bounds memory."""

SCALED_MAX = 1 << 30
"""Scaled coordinates are clamped to -SCALED_MAX .. SCALED_MAX, so that 64 bits are enough."""


def to_output(points: Ints, unit: int, origin: int, size: int, pixels: int) -> Ints:
    """One axis of control points in units of 2**-unit px -> 1/256 output pixel, rounded half up.

    Args:
        points: Coordinates on the canvas.
        unit: Binary fraction digits of `points`.
        origin: Where the region starts, in canvas pixels.
        size: Extent of the region in canvas pixels.
        pixels: Extent of the region in output pixels.
    """
    ratio = Fraction(pixels * ONE, size << unit)
    numerator, denominator = ratio.numerator, ratio.denominator
    shifted = points - (origin << unit)
    scaled = (2 * shifted * numerator + denominator) // (2 * denominator)
    return np.clip(scaled, -SCALED_MAX, SCALED_MAX)


def flatten(path: Ints) -> tuple[Ints, Ints]:
    """Edges (start [N, 2], end [N, 2]) of a closed path [3 m, 2] in 1/256 output pixel.

    Each segment becomes n = 2**k chords, evaluated exactly and rounded down to the grid; k is the
    smallest with 3 d <= 4 FLATNESS n^2, where d is the largest second difference of its control
    points (the bound 6 d / (8 n^2) on the distance of a chord, taken coordinate-wise).
    """
    p = _segments(path)
    return _chords(p, _log2_chords(p))


def _segments(path: Ints) -> Ints:
    """Control points [m, 4, 2] of the segments of a path [3 m, 2]."""
    return np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)], 1)


def _log2_chords(p: Ints) -> Ints:
    """Into how many chords each segment [m, 4, 2] is divided, as a power of two."""
    d = np.abs(p[:, :2] - 2 * p[:, 1:3] + p[:, 2:]).max((1, 2))
    k = np.zeros(len(p), np.int64)
    for _ in range(MAX_LOG2_CHORDS):
        k += 3 * d > 4 * FLATNESS << (2 * k)
    return np.minimum(k, MAX_LOG2_CHORDS)


def _chords(p: Ints, k: Ints) -> tuple[Ints, Ints]:
    """Start [N, 2] and end [N, 2] of 2**k chords of each segment [m, 4, 2]."""
    count = 1 << k
    segment = np.repeat(np.arange(len(p)), count)
    i = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    n, q, shift = count[segment][:, None], p[segment], 3 * k[segment][:, None]
    i = i[:, None]
    j = n - i
    start = (
        j**3 * q[:, 0] + 3 * j**2 * i * q[:, 1] + 3 * j * i**2 * q[:, 2] + i**3 * q[:, 3]
    ) >> shift
    end = np.roll(start, -1, 0)
    end[np.cumsum(count) - 1] = p[:, 3]
    return start, end


def coverage(
    paths: Sequence[Ints],
    x0: int,
    y0: int,
    width: int,
    height: int,
    budget: Budget | None = None,
) -> NDArray[np.int32]:
    """Coverage [height, width], 0..FULL, of the output pixels from column x0 and row y0 on.

    Args:
        paths: Closed paths [3 m, 2] in 1/256 output pixel, as `to_output` makes them.
        x0: First column.
        y0: First row.
        width: Columns.
        height: Rows.
        budget: Bounds the edges and their pieces.

    Raises:
        LimitError: There are too many.
    """
    budget = budget or Budget()
    corner = np.array([x0 * ONE, y0 * ONE])
    segments = np.concatenate([np.zeros((0, 4, 2), np.int64), *map(_segments, paths)]) - corner
    # What lies above, below or to the right leaves no trace here.
    low, high = segments.min(1), segments.max(1)
    near = (high[:, 1] > 0) & (low[:, 1] < height * ONE) & (low[:, 0] < width * ONE)
    segments = segments[near]
    log2 = _log2_chords(segments)
    if kernel.available():
        budget.spend("work", int((1 << log2).sum()))
        out, work = kernel.coverage(segments, log2, width, height, budget.left("work"))
        budget.spend("work", work)
        return out
    cells = np.zeros(height * (width + 2), np.int64)
    for some in _batches(1 << log2, 1 << MAX_LOG2_CHORDS, budget):
        start, end = _chords(segments[some], log2[some])
        for at in _batches(np.abs(end[:, 1] - start[:, 1]) // ONE + 2, height + 1, budget):
            row, x_in, x_out, dy = _split_rows(start[at], end[at], height)
            for part in _batches(np.abs(x_out - x_in) // ONE + 2, width + 1, budget):
                _accumulate(cells, row[part], x_in[part], x_out[part], dy[part], width)
    total = np.cumsum(cells.reshape(height, width + 2), axis=1)[:, 1 : width + 1]
    return np.minimum(np.abs(total), FULL).astype(np.int32)


def _batches(pieces: Ints, most: int, budget: Budget) -> Iterator[slice]:
    """Slices of items that together make about `PIECES` pieces; an item makes at most `most`."""
    total = np.cumsum(np.minimum(pieces, most))
    budget.spend("work", int(total[-1]) if len(total) else 0)
    start = 0
    while start < len(pieces):
        done = int(total[start - 1]) if start else 0
        stop = max(int(np.searchsorted(total, done + PIECES, side="right")), start + 1)
        yield slice(start, stop)
        start = stop


def _split_rows(start: Ints, end: Ints, height: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Pieces of edges inside single rows: row, x at the top, x at the bottom, signed height."""
    sloped = start[:, 1] != end[:, 1]
    start, end = start[sloped], end[sloped]
    down = (start[:, 1] < end[:, 1])[:, None]
    top, bottom = np.where(down, start, end), np.where(down, end, start)
    first = np.maximum(top[:, 1] // ONE, 0)
    last = np.minimum((bottom[:, 1] - 1) // ONE, height - 1)
    count = np.maximum(last - first + 1, 0)
    edge = np.repeat(np.arange(len(top)), count)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + first[edge]
    (xa, ya), (xb, yb) = top[edge].T, bottom[edge].T
    y_in, y_out = np.maximum(ya, row * ONE), np.minimum(yb, (row + 1) * ONE)
    x_in = xa + (y_in - ya) * (xb - xa) // (yb - ya)
    x_out = xa + (y_out - ya) * (xb - xa) // (yb - ya)
    return row, x_in, x_out, (y_out - y_in) * np.where(down[edge, 0], 1, -1)


def _accumulate(cells: Ints, row: Ints, x_in: Ints, x_out: Ints, dy: Ints, width: int) -> None:
    """Adds row pieces to `cells` [height * (width + 2)], whose column 0 is all that lies left.

    A piece that crosses a cell at mean position m adds dy * (1 - m) to that cell and the rest to
    the next one; a running sum along the row then gives the area.
    """
    left, right = np.minimum(x_in, x_out), np.maximum(x_in, x_out)
    span, rise, sign = np.maximum(right - left, 1), np.abs(dy), np.sign(dy)

    def climbed(x: Ints, at: Ints | slice = slice(None)) -> Ints:
        part = (np.clip(x, left[at], right[at]) - left[at]) * rise[at] // span[at]
        return np.where(x >= right[at], rise[at], part)

    def add(index: Ints, weight: Ints) -> None:
        np.add.at(cells, index, weight)

    add(row * (width + 2), sign * np.where(left < 0, climbed(np.zeros_like(left)), 0) * 2 * ONE)
    first, last = np.maximum(left // ONE, 0), np.minimum(right // ONE, width - 1)
    count = np.maximum(last - first + 1, 0)
    piece = np.repeat(np.arange(len(row)), count)
    column = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count) + first[piece]
    lo, hi = column * ONE, (column + 1) * ONE
    before = np.where(lo <= left[piece], 0, climbed(lo, piece))
    part = sign[piece] * (climbed(hi, piece) - before)
    twice_mean = np.maximum(left[piece], lo) + np.minimum(right[piece], hi) - 2 * lo
    index = row[piece] * (width + 2) + column + 1
    add(index, part * (2 * ONE - twice_mean))
    add(index + 1, part * twice_mean)
