"""Coverage of canvas pixels by a boundary at rest, as floating-point numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry import coverage as cover
from ...geometry.boundary import Boundary
from ...render.compose import outline
from ...render.view import View
from ...texture.network import Floats


def coverage_of(boundary: Boundary | None, width: int, height: int) -> Floats:
    """Coverage of the pixels of a canvas.

    Args:
        boundary: Boundary at rest; None for the whole canvas.
        width: Width of the canvas in pixels.
        height: Height of the canvas in pixels.

    Returns:
        float32 [width * height] in 0..1, row by row.
    """
    paths = outline(boundary, View(0, 0, width, height, width, height))
    if paths is None:
        return np.ones(width * height, np.float32)
    covered = cover.coverage(paths, 0, 0, width, height).ravel()
    return covered.astype(np.float32) * np.float32(1 / cover.FULL)


def coverage_together(boundaries: Sequence[Boundary | None], width: int, height: int) -> Floats:
    """Coverage of the pixels of a canvas by layers that lie over each other.

    Args:
        boundaries: Boundaries at rest, as for `coverage_of`.
        width: Width of the canvas in pixels.
        height: Height of the canvas in pixels.

    Returns:
        float32 [height, width] in 0..1.
    """
    clear = np.ones((height, width), np.float32)
    for boundary in boundaries:
        clear *= 1 - coverage_of(boundary, width, height).reshape(height, width)
    return 1 - clear
