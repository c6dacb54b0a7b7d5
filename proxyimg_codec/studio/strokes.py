"""Strokes of a brush as masks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError

POINTS_MAX = 20_000
"""Most points of the strokes of one request."""

RADIUS_MAX = 2000.0
"""Largest radius of a brush in pixels."""


WORK_MAX = 1 << 30
"""Most pixels that are looked at for one request."""

Point = tuple[float, float]
Floats = NDArray[np.float64]


def painted(
    strokes: Sequence[Sequence[Point]], radius: float, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Paints strokes with a round brush.

    Args:
        strokes: Points x, y of each stroke in pixels.
        radius: Radius of the brush in pixels, above 0.
        size: Width and height of the picture in pixels.

    Returns:
        bool [height, width], True for pixels whose centre the brush touches.

    Raises:
        UsageError: There is no point, or there are too many, or the radius is out of range.
    """
    count = sum(map(len, strokes))
    if not 0 < count <= POINTS_MAX:
        raise UsageError(f"strokes: {count} points; give 1..{POINTS_MAX}")
    if not (math.isfinite(radius) and 0 < radius <= RADIUS_MAX):
        raise UsageError(f"radius: {radius} is not within 0..{RADIUS_MAX:g}")
    mask = np.zeros(size[::-1], bool)
    spent = 0
    for stroke in strokes:
        points = _thinned(stroke, radius / 4)
        for one, two in zip(points, points[1:] or points, strict=False):
            spent += _draw(mask, np.array(one), np.array(two), radius)
            if spent > WORK_MAX:
                raise UsageError("strokes: too long for so large a brush; paint them in parts")
    return mask


def _thinned(stroke: Sequence[Point], apart: float) -> list[Point]:
    """Points of a stroke at least so many pixels apart, and its last one."""
    kept = list(stroke[:1])
    for point in stroke[1:-1]:
        if math.dist(point, kept[-1]) >= apart:
            kept.append(point)
    return kept + list(stroke[1:][-1:])


def _draw(mask: NDArray[np.bool_], one: Floats, two: Floats, radius: float) -> int:
    """Draws a straight piece; returns how many pixels were looked at."""
    height, width = mask.shape
    low = np.clip(np.floor(np.minimum(one, two) - radius), 0, (width, height)).astype(int)
    high = np.clip(np.ceil(np.maximum(one, two) + radius), 0, (width, height)).astype(int)
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    if x1 <= x0 or y1 <= y0:
        return 0
    dx, dy = np.arange(x0, x1) + 0.5 - one[0], np.arange(y0, y1)[:, None] + 0.5 - one[1]
    way = two - one
    along = np.clip((dx * way[0] + dy * way[1]) / max(float(way @ way), 1e-12), 0, 1)
    near = (dx - along * way[0]) ** 2 + (dy - along * way[1]) ** 2 <= radius**2
    mask[y0:y1, x0:x1] |= near
    return int(near.size)
