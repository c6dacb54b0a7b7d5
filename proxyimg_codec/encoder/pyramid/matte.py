"""Rasters of a soft layer: its alpha, and its colours without what shines through."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats
from ...texture.occlusion import REACH, Occlusion, Samples
from ...texture.planes import blocks
from ..completion.foreground import foreground
from ..completion.membrane import continued
from ..shapes.soft import dilated
from .encode import CELL, Raster

WHOLE = 0.996
"""Alpha from which a sample is opaque."""

TAIL = 3
"""Samples beyond the boundary that interpolation can reach, which are as clear as those within."""

EDGE = 16
"""Samples around the soft ones from which their colours are estimated."""


class Soft(NamedTuple):
    """Samples and rasters that a soft layer has of its own.

    Attributes:
        samples: bool [h, w], True for the samples of its view that are soft.
        behind: Raster of colours.
        matte: Raster of alpha.
    """

    samples: Samples
    behind: Raster
    matte: Raster


def soft_rasters(picture: Floats, alpha: Floats, covered: Floats, cuts: Occlusion) -> Soft | None:
    """Makes the rasters of a soft layer.

    Args:
        picture: float32 [H, W, 3] in 0..1.
        alpha: float32 [H, W] in 0..1, that of the layer.
        covered: float32 [H, W] in 0..1, coverage of its boundary.
        cuts: Cuts of its view.

    Returns:
        The rasters; None if no sample within the boundary is translucent.
    """
    x, y, width, height = cuts.box
    at = np.s_[y : y + height, x : x + width]
    share = np.ascontiguousarray(alpha[at])
    uncertain = (share < WHOLE) & dilated(covered > 0, TAIL)[at]
    cells = blocks(dilated(uncertain, REACH), CELL)
    if not cells.any():
        return None
    samples = _samples(cells, height, width)
    seen = np.ones((height, width), np.float32)
    if cuts.fronts:
        seen = Occlusion(None, cuts.fronts, cuts.box).trusted.astype(np.float32)
    colours = _colours(np.ascontiguousarray(picture[at]), share, seen, samples)
    support = None if cells.all() else cells
    weight = np.where(samples, share**2, 0).astype(np.float32)
    grey = bool((colours == colours[..., :1]).all())
    solid = np.repeat(share[..., None], 3, 2)
    return Soft(
        samples,
        Raster(colours * np.float32(255), weight, support, grey),
        Raster(solid * np.float32(255), samples.astype(np.float32), support, True),
    )


def _colours(picture: Floats, alpha: Floats, seen: Floats, samples: Samples) -> Floats:
    """Colours float32 [h, w, 3] of a layer, which continue where nothing of it is seen."""
    rows, columns = (np.flatnonzero(dilated(samples, EDGE).any(k)) for k in (1, 0))
    at = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    out = picture.copy()
    out[at] = foreground(picture[at].copy(), alpha[at].copy(), seen[at].copy())
    sure = (alpha**2 * seen).astype(np.float32)
    return np.where((alpha * seen)[..., None] > 0.1, out, continued(out, sure)).astype(np.float32)


def _samples(cells: NDArray[np.bool_], height: int, width: int) -> Samples:
    side = 1 << CELL
    return cells.repeat(side, 0)[:height].repeat(side, 1)[:, :width]
