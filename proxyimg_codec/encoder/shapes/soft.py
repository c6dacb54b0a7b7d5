"""Soft masks: which masks are soft, and regions of layers whose rims are translucent."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import UsageError
from ...texture.network import Floats
from ..settings import Settings
from .masks import Region, is_back

FAINT = 0.012
"""Alpha up to which a pixel is as good as clear: 3 of 255."""

SURE = 0.97
"""Alpha from which a pixel is as good as opaque."""

RIM = 3
"""Pixels within which antialiasing goes from opaque to clear."""

SOFT_PIXELS = 16
"""Least size, in pixels, of a connected translucent part wider than that: it makes a mask soft."""

ROOM = 2
"""Pixels that a boundary keeps off from all that is not clear."""

BAND = 6
"""Pixels on both sides of a hard outline whose alpha is found from the picture."""

EVEN = 1e-4
"""Variance of colours in 0..1, within `BAND` pixels, below which they do not tell inside from
outside."""


def soft_rim(alpha: Floats) -> NDArray[np.bool_]:
    """Translucent pixels, bool [H, W], that are no antialiasing between opaque and clear ones."""
    near = dilated(alpha >= SURE, RIM) & dilated(alpha <= 1 - SURE, RIM)
    return (alpha > 1 - SURE) & (alpha < SURE) & ~near


def is_soft(alpha: Floats) -> bool:
    """Whether a mask, float32 [H, W] in 0..1, has a rim that is wider than antialiasing."""
    parts = cv2.connectedComponentsWithStats(soft_rim(alpha).astype(np.uint8))[2]
    return bool(parts[1:, cv2.CC_STAT_AREA].max(initial=0) >= SOFT_PIXELS)


def matted(
    regions: Sequence[Region], picture: Floats, settings: Settings, opaque: bool
) -> list[Region]:
    """Decides which regions are soft: these get a mask that holds all that is not clear.

    Args:
        regions: Regions back to front, some with alpha.
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        settings: Settings of the encoder, for `matte` and the coder.
        opaque: Whether the picture is.

    Returns:
        The regions; those that are not soft have no alpha.

    Raises:
        UsageError: `matte` is soft, but the picture is not opaque.
    """
    able = settings.pyramid and opaque
    if settings.matte == "soft" and not opaque:
        raise UsageError("matte soft needs an opaque picture; this one has alpha of its own")
    made, cut = list[Region](), list[str]()
    for region in regions:
        alpha = region.alpha
        soft = alpha is not None and not is_back(region.name) and is_soft(alpha)
        if settings.matte == "soft" and not soft and not is_back(region.name):
            alpha, soft = _solved(region.mask, picture), True
        if soft and able and settings.matte != "hard":
            assert alpha is not None, "what is soft has alpha"
            made.append(replace(region, mask=dilated(alpha > FAINT, ROOM), alpha=alpha))
        else:
            made.append(replace(region, alpha=None))
            cut += [region.name] * soft
    if cut:
        logging.getLogger(__name__).warning("soft masks are cut at one half: %s", ", ".join(cut))
    return made


def _solved(mask: NDArray[np.bool_], picture: Floats) -> Floats:
    """Alpha float32 [H, W] of a hard mask, which near its outline follows the colours.

    It is the guided filter (He, Sun and Tang 2010), with the local linear model of closed-form
    matting.
    """
    if not mask.any() or mask.all():
        return mask.astype(np.float32)
    guide = np.ascontiguousarray(picture[..., :3])
    found = cv2.ximgproc.guidedFilter(guide, mask.astype(np.float32), BAND, EVEN)
    # What is nearly clear or opaque is: the filter never quite gets there.
    found = np.clip((found - 0.1) / 0.8, 0, 1)
    found[~dilated(mask, BAND)] = 0
    found[~dilated(~mask, BAND)] = 1
    return np.asarray(found, np.float32)


def dilated(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Mask [H, W] grown by a radius in pixels."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return cv2.dilate(mask.astype(np.uint8), kernel) > 0
