"""How much of each pixel a planned layer covers."""

from __future__ import annotations

import numpy as np

from ...geometry import coverage as cover
from ...geometry.boundary import Boundary
from ...render.compose import outline
from ...render.view import View
from ...texture.network import Floats


def coverage_of(boundary: Boundary | None, width: int, height: int) -> Floats:
    """Coverage float32 [width * height] of canvas pixels, 0..1; None covers all."""
    paths = outline(boundary, View(0, 0, width, height, width, height))
    if paths is None:
        return np.ones(width * height, np.float32)
    covered = cover.coverage(paths, 0, 0, width, height).ravel()
    return covered.astype(np.float32) * np.float32(1 / cover.FULL)
