"""Anti-aliased coverage of closed Bézier paths in fixed point.

Coverage is the exact signed area of the flattened paths inside each output pixel (the cell
accumulation of FreeType's smooth rasterizer); clamping its magnitude stands for the nonzero rule.
All arithmetic is integer: coordinates are in 1/256 output pixel, coverage in 1/FULL. No pixel
depends on the tile in which it is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..limits import Budget
from ..native import kernel

Ints = NDArray[np.int64]

ONE = 256
"""Coordinate units of an output pixel."""

FULL = 2 * ONE * ONE
"""Coverage of a pixel that is covered as a whole."""

FLATNESS = 16
"""Estimated largest distance of a chord from its curve, in 1/256 output pixel."""

MAX_LOG2_CHORDS = 8

PIECES = 1 << 20
"""Pieces of edges handled at a time, which bounds memory."""

SCALED_MAX = 1 << 30
"""Bound to which scaled coordinates are clamped in magnitude, so that 64 bits are enough."""


def to_output(points: Ints, unit: int, origin: int, size: int, pixels: int) -> Ints:
    """Scales coordinates along one axis from the canvas to the output grid, rounded half up.

    Args:
        points: int64 coordinates in units of 2**-unit canvas pixels, of any shape.
        unit: Number of fractional bits of `points`.
        origin: Start of the region in canvas pixels.
        size: Extent of the region in canvas pixels.
        pixels: Extent of the region in output pixels.

    Returns:
        int64 coordinates in 1/256 output pixel, from the start of the region, of the same shape.
    """
    ratio = Fraction(pixels * ONE, size << unit)
    numerator, denominator = ratio.numerator, ratio.denominator
    shifted = points - (origin << unit)
    scaled = (2 * shifted * numerator + denominator) // (2 * denominator)
    return np.clip(scaled, -SCALED_MAX, SCALED_MAX)


def flatten(path: Ints) -> tuple[Ints, Ints]:
    """Flattens a closed path to chords.

    Each segment becomes n = 2**k chords, whose ends are exact points of the curve, rounded down to
    the grid. k is the smallest number with 3 d <= 4 FLATNESS n^2, at most `MAX_LOG2_CHORDS`, where
    d is the largest second difference of the control points. This is the bound 6 d / (8 n^2) on the
    distance of a chord from the curve, taken coordinate-wise.

    Args:
        path: int64 [3 m, 2] control points in 1/256 output pixel.

    Returns:
        Start and end of each chord, int64 [N, 2] each, in 1/256 output pixel.
    """
    p = _segments(path)
    return _chords(p, _log2_chords(p))


class Segments(NamedTuple):
    """Segments of paths, of which the coverage of several rectangles is computed.

    Attributes:
        points: int64 [m, 4, 2] control points in 1/256 output pixel.
        log2: [m] base-2 logarithm of the number of chords of each.
        low: [m, 2] least coordinates of the control points.
        high: [m, 2] greatest coordinates.
    """

    points: Ints
    log2: Ints
    low: Ints
    high: Ints

    @classmethod
    def of(cls, paths: Sequence[Ints]) -> Segments:
        """Segments of closed paths, as for `coverage`."""
        points = np.concatenate([np.zeros((0, 4, 2), np.int64), *map(_segments, paths)])
        return cls(points, _log2_chords(points), points.min(1), points.max(1))


def _segments(path: Ints) -> Ints:
    """Control points [m, 4, 2] of the segments of a path [3 m, 2]."""
    return np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)], 1)


def _log2_chords(p: Ints) -> Ints:
    """Base-2 logarithm [m] of the number of chords of each segment [m, 4, 2]."""
    d = np.abs(p[:, :2] - 2 * p[:, 1:3] + p[:, 2:]).max((1, 2))
    k = np.zeros(len(p), np.int64)
    for _ in range(MAX_LOG2_CHORDS):
        k += 3 * d > 4 * FLATNESS << (2 * k)
    return np.minimum(k, MAX_LOG2_CHORDS)


def _chords(p: Ints, k: Ints) -> tuple[Ints, Ints]:
    """Start [N, 2] and end [N, 2] of the 2**k chords of each segment [m, 4, 2]."""
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
    paths: Sequence[Ints] | Segments,
    x0: int,
    y0: int,
    width: int,
    height: int,
    budget: Budget | None = None,
) -> NDArray[np.int32]:
    """Computes the coverage of a rectangle of output pixels.

    Args:
        paths: Closed paths, int64 [3 m, 2] each, in 1/256 output pixel, as `to_output` makes them;
            or their segments.
        x0: First column of the rectangle.
        y0: First row of the rectangle.
        width: Number of columns.
        height: Number of rows.
        budget: Running budget, of which edges and their pieces spend `work`; by default a new one.

    Returns:
        int32 [height, width] coverage in 0..FULL.

    Raises:
        LimitError: There are too many edges or pieces.
    """
    budget = budget or Budget()
    found = paths if isinstance(paths, Segments) else Segments.of(paths)
    corner = np.array([x0 * ONE, y0 * ONE])
    # Segments above, below or to the right of the rectangle have no effect on it.
    low, high = found.low - corner, found.high - corner
    near = (high[:, 1] > 0) & (low[:, 1] < height * ONE) & (low[:, 0] < width * ONE)
    if not near.any():
        return np.zeros((height, width), np.int32)
    segments, log2 = found.points[near] - corner, found.log2[near]
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
    """Spends the pieces [n] of items, each at most `most`, and yields slices of about `PIECES`."""
    total = np.cumsum(np.minimum(pieces, most))
    budget.spend("work", int(total[-1]) if len(total) else 0)
    start = 0
    while start < len(pieces):
        done = int(total[start - 1]) if start else 0
        stop = max(int(np.searchsorted(total, done + PIECES, side="right")), start + 1)
        yield slice(start, stop)
        start = stop


def _split_rows(start: Ints, end: Ints, height: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Splits edges at rows; of each piece: row, x at the top, x at the bottom, signed height."""
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
    """Adds pieces of edges in rows to `cells` [height * (width + 2)].

    Column 0 of the cells collects everything left of the rectangle. A piece that crosses a cell at
    the mean position m adds dy * (1 - m) to that cell, and dy * m to the next one. A running sum
    along the row then gives the area.
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
