"""Coverage in the renderer as ONNX: the integers of GEO-7 to GEO-14, in doubles."""

from __future__ import annotations

import numpy as np

from ..geometry.boundary import Boundary
from ..geometry.coverage import FLATNESS, FULL, MAX_LOG2_CHORDS, ONE, SCALED_MAX
from .onnx_graph import Graph, Value

TIE = 2.0**-25
"""Added before rounding: a tie that is missed by the error of a double is still rounded up."""

FAR = 2.0**40
"""Farther than any point of a chord, in 1/256 sample."""


def chords(graph: Graph, boundary: Boundary, corner: Value, size: Value) -> Value:
    """Chords float64 [6, T] of an outline on the grid of samples: GEO-7 to GEO-9 and GEO-11.

    Args:
        graph: Where they are computed, at the scale that is asked for.
        boundary: The paths in their present place.
        corner: [2] canvas point of a corner of the grid.
        size: [2] width and height of a sample in canvas pixels.

    Returns:
        x and y of the upper end, x and y of the lower end, sign, and the smaller x, in 1/256
        sample from `corner`. The first chord counts nothing and is in reach of every sample.
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
    """Coverage float32 [N], 0..1, of samples: GEO-12 to GEO-14.

    Args:
        chords: As `chords` makes them.
        at: float64 [N, 2] upper left corners in 1/256 sample: whole numbers.
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
    """The chords that count at any of the samples: not all above, below or right of them."""
    low, high = at.reduced("Min", 0), at.reduced("Max", 0) + ONE
    top, bottom, right = low.take(1), high.take(1), high.take(0)
    near = (chords.take(3) > top) & (chords.take(1) < bottom) & (chords.take(5) < right)
    return chords.compressed(near, 1)
