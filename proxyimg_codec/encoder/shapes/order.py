"""Depth order of regions: who is in front of whom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .hierarchy import SIDES
from .maps import Floats, Maps
from .masks import nearness

Mask = NDArray[np.bool_]

CERTAIN = 0.15
"""Mean ownership of a shared border, in -1..1, above which it decides who is in front."""


def back_to_front(masks: Sequence[Mask], maps: Maps) -> list[Mask]:
    """Sorts masks by who is in front.

    Who owns the shared border decides where regions touch; elsewhere what stands out, lies low and
    not along the frame of the picture is near.

    Args:
        masks: bool [H, W] each, disjoint, none empty.
        maps: Maps of the picture.
    """
    near = [nearness(mask, float(maps.figure[mask].mean())) for mask in masks]
    owns = ownership(masks, maps.owner)
    left, stack = list(range(len(masks))), list[int]()
    while left:
        # Farthest is who is in front of the fewest others, then who looks farthest.
        over = {i: sum(owns[i, j] > CERTAIN for j in left) for i in left}
        stack.append(min(left, key=lambda i: (over[i], near[i])))
        left.remove(stack[-1])
    return [masks[i] for i in stack]


def ownership(masks: Sequence[Mask], owner: Floats) -> Floats:
    """Mean ownership of the borders that masks share.

    Args:
        masks: bool [H, W] each, disjoint.
        owner: float32 [H, W, 2], see `Maps`.

    Returns:
        float32 [N, N], in about -1..1: positive if the first is in front of the second; 0 for
        those that do not touch.
    """
    labels = np.zeros(owner.shape[:2], np.intp)
    for k, mask in enumerate(masks, 1):
        labels[mask] = k
    found = np.zeros((len(masks) + 1, len(masks) + 1), np.float32)
    count = np.zeros_like(found)
    for axis, (one, two) in enumerate(SIDES):
        a, b = labels[one], labels[two]
        apart = (a != b) & (a > 0) & (b > 0)
        towards = (owner[one][..., axis] + owner[two][..., axis])[apart] / 2
        # A vector that points to larger coordinates says that the second is in front.
        np.add.at(found, (b[apart], a[apart]), towards)
        np.add.at(found, (a[apart], b[apart]), -towards)
        np.add.at(count, (a[apart], b[apart]), 1)
        np.add.at(count, (b[apart], a[apart]), 1)
    return np.asarray((found / np.maximum(count, 1))[1:, 1:], np.float32)
