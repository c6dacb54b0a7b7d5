"""Smooth continuation of known values into their surroundings: a screened membrane."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats

KNOWN = 1e4
"""Weight of known values; each neighbour has the weight 1."""

SWEEPS = 16
"""Jacobi iterations at each level."""

CROSS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32)


def continued_from(value: Floats, known: NDArray[np.bool_]) -> Floats:
    """Continues values smoothly from known places, as `continued` does.

    Args:
        value: float32 [H, W, C] values; those that are not known have no influence.
        known: bool [H, W].

    Returns:
        float32 [H, W, C]; at known places nearly the values themselves.
    """
    return continued(value, np.where(known, np.float32(KNOWN), np.float32(0)))


def continued(value: Floats, weight: Floats) -> Floats:
    """Continues values smoothly to places where they have little or no weight.

    The result approximately minimizes the sum of squared differences of neighbours, and of `weight`
    times the squared difference from `value`. It is found at half the size first, recursively; each
    coarser solution is the start of the finer one, as in the diffusion of codes by decoders.

    Args:
        value: float32 [H, W, C] values.
        weight: float32 [H, W] weights, not negative.

    Returns:
        float32 [H, W, C].
    """
    h, w = weight.shape
    start = value
    if max(h, w) > 1:
        pad = ((0, h % 2), (0, w % 2))
        blocks = ((h + 1) // 2, 2, (w + 1) // 2, 2)
        total = np.pad(weight, pad).reshape(blocks).sum((1, 3))
        mean = np.pad(value * weight[..., None], (*pad, (0, 0))).reshape(*blocks, -1).sum((1, 3))
        mean /= np.maximum(total, np.float32(1e-6))[..., None]
        coarse = continued(mean, np.minimum(total, np.float32(KNOWN)))
        start = coarse[np.arange(h)[:, None] // 2, np.arange(w) // 2]
    share = 1 / (4 + weight[..., None])
    own = value * weight[..., None] * share
    for _ in range(SWEEPS):
        around = cv2.filter2D(start, -1, CROSS, borderType=cv2.BORDER_REPLICATE)
        start = np.asarray(around * share + own, np.float32)
    return start
