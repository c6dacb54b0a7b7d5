"""Amodal masks: what stands out less goes on beneath the figures in front of it.

Who moves a cup from a table expects the table there, and not what lies behind the table. Where the
outlines of figures are known and those of what is behind them are not, each hidden pixel belongs to
the nearest layer that the figure touches; what it touches little does not reach far.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

LESS = 0.15
"""By how much less a layer must stand out than what it goes on beneath."""

BAND = 2
"""Pixels around a layer in which others touch it."""


def extended_beneath(masks: Sequence[Mask], scores: Sequence[float]) -> list[Mask]:
    """Extends layers beneath those in front of them that stand out more.

    Args:
        masks: bool [H, W] masks, back to front, disjoint; the first one is the back.
        scores: How much each stands out, 0..1.

    Returns:
        The masks, with what they have beneath others. The back stays as it is.
    """
    out = [mask.copy() for mask in masks]
    for front, mask in enumerate(masks):
        near = cv2.dilate(mask.astype(np.uint8), np.ones((2 * BAND + 1,) * 2, np.uint8)) > 0
        least = np.full(mask.shape, np.inf, np.float32)
        nearest = np.zeros(mask.shape, np.intp)
        for k in range(front):
            contact = int((masks[k] & near).sum()) / BAND
            if not contact or (k and scores[k] + LESS > scores[front]):
                continue
            away = cv2.distanceTransform((~masks[k]).astype(np.uint8), cv2.DIST_L2, 5)
            nearer = (away < least) & ((k == 0) | (away <= contact / 2))
            least[nearer], nearest[nearer] = away[nearer], k
        for k in range(1, front):
            out[k] |= mask & (nearest == k)
    return out
