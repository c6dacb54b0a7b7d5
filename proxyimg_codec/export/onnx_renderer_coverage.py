"""Coverage in the renderer as ONNX: the integers of GEO-7 to GEO-14, in double precision."""

from __future__ import annotations

import numpy as np

from ..geometry.boundary import Boundary
from ..geometry.coverage import FLATNESS, FULL, MAX_LOG2_CHORDS, ONE, SCALED_MAX
from .onnx_graph import Graph, Value

TIE = 2.0**-25
"""Added before rounding, so that ties are rounded up in spite of the error of a double."""

FAR = 2.0**40
"""Coordinate beyond any point of a chord, in 1/256 sample."""


def chords(graph: Graph, boundary: Boundary, corner: Value, size: Value) -> Value:
    """Divides an outline into chords on the grid of samples [GEO-7, GEO-8, GEO-9, GEO-11].

    Args:
        graph: The graph; chords are computed in it, for the scale that is asked for.
        boundary: The outline, in its present place.
        corner: float64 [2] canvas point of a corner of the grid.
        size: float64 [2] width and height of a sample in canvas pixels.

    Returns:
        float64 [6, T]: x and y of the upper end, x and y of the lower end, sign, and the smaller x
        of each chord, in 1/256 sample from `corner`. The first chord counts nothing and is in reach
        of every sample.
    """
    curves = [
        np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)])
        for path in boundary.paths
    ]
    controls = np.concatenate(curves, axis=1) / (1 << boundary.unit)  # [4, S, 2] in canvas pixels
    scaled = (graph.constant(controls) - corner) / size * ONE + (0.5 + TIE)
    scaled = scaled.floor().clip(-SCALED_MAX, SCALED_MAX)
    p, q, r, s = (scaled.take(k) for k in range(4))  # [S, 2]
    bend = (p - q * 2 + r).abs().maximum((q - r * 2 + s).abs()).reduced("Max", 1).reshape(-1, 1)
    limits = 4 * FLATNESS * 4.0 ** np.arange(MAX_LOG2_CHORDS)
    log2 = (bend * 3 > limits).astype(np.int64).reduced("Sum", 1)
    count = graph.constant(2.0 ** np.arange(MAX_LOG2_CHORDS + 1)).take(log2)  # [S]
    numbers = graph.constant(np.arange(2.0**MAX_LOG2_CHORDS))
    found = graph.op("NonZero", numbers < count.reshape(-1, 1), dtype=np.int64)
    segment, number = found.take(0), found.take(1).astype(np.float64).reshape(-1, 1)  # [T]
    n = count.take(segment).reshape(-1, 1)
    p, q, r, s = (v.take(segment) for v in (p, q, r, s))

    def point(i: Value) -> Value:
        j = n - i
        total = j * j * j * p + j * j * i * 3 * q + j * i * i * 3 * r + i * i * i * s
        return (total / (n * n * n)).floor()

    start, end = point(number), point(number + 1)
    rise = end.take(np.array([1]), 1) - start.take(np.array([1]), 1)  # [T, 1]
    upper = graph.where(rise > 0, start, end)
    lower = graph.where(rise > 0, end, start)
    left = upper.take(np.array([0]), 1).minimum(lower.take(np.array([0]), 1))
    table = graph.concat([upper, lower, graph.op("Sign", rise), left], 1)
    nothing = np.array([[-FAR, -FAR, -FAR, FAR, 0, -FAR]])
    return graph.op("Transpose", graph.concat([nothing, table], 0), perm=[1, 0])


def coverage(chords: Value, at: Value) -> Value:
    """Coverage of samples, float32 [N] in 0..1 [GEO-12, GEO-13, GEO-14].

    Args:
        chords: float64 [6, T] from the function `chords`.
        at: float64 [N, 2] upper left corners of the samples, whole numbers in 1/256 sample.
    """
    chords = _in_reach(chords, at)
    xa, ya, xb, yb, sign, _ = chords.split(6, 0)  # [1, C]
    lo, top = at.split(2, 1)  # [N, 1]
    hi, rows = lo + ONE, (yb - ya).maximum(1)
    y_in, y_out = ya.maximum(top), yb.minimum(top + ONE)
    rise = (y_out - y_in).maximum(0)
    ends = [xa + ((y - ya) * (xb - xa) / rows).floor() for y in (y_in, y_out)]
    left, right = ends[0].minimum(ends[1]), ends[0].maximum(ends[1])
    across = (right - left).maximum(1)

    def climbed(x: Value) -> Value:
        return ((x - left) * rise / across).floor().maximum(0).minimum(rise)

    before, after = climbed(lo), climbed(hi)
    mean2 = left.maximum(lo) + right.minimum(hi) - lo * 2
    piece = before * (2 * ONE) + (after - before) * (2 * ONE - mean2)
    total = (sign * piece).reduced("Sum", 1).abs().minimum(FULL)
    return (total / FULL).astype(np.float32)


def _in_reach(chords: Value, at: Value) -> Value:
    """Chords that can affect one of the samples: not above, below or right of all of them."""
    low, high = at.reduced("Min", 0), at.reduced("Max", 0) + ONE
    top, bottom, right = low.take(1), high.take(1), high.take(0)
    near = (chords.take(3) > top) & (chords.take(1) < bottom) & (chords.take(5) < right)
    return chords.compressed(near, 1)
