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


def painted(
    strokes: Sequence[Sequence[tuple[float, float]]], radius: float, size: tuple[int, int]
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
    from PIL import Image, ImageDraw

    count = sum(map(len, strokes))
    if not 0 < count <= POINTS_MAX:
        raise UsageError(f"strokes: {count} points; give 1..{POINTS_MAX}")
    if not (math.isfinite(radius) and 0 < radius <= RADIUS_MAX):
        raise UsageError(f"radius: {radius} is not within 0..{RADIUS_MAX:g}")
    far = 4 * max(*size, RADIUS_MAX)
    picture = Image.new("1", size)
    brush = ImageDraw.Draw(picture)
    for stroke in strokes:
        at = [(min(max(x, -far), far) - 0.5, min(max(y, -far), far) - 0.5) for x, y in stroke]
        if len(at) > 1:
            brush.line(at, fill=1, width=max(round(2 * radius), 1))
        for x, y in at:
            brush.ellipse((x - radius, y - radius, x + radius, y + radius), fill=1)
    return np.array(picture, bool)
