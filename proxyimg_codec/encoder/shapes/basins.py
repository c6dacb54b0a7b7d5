"""Regions between strong boundaries: a watershed, whose basins are merged."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .refine import spread

Floats = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

BLUR, FLAT = 2.0, 0.01
"""Smoothing of the boundary map before minima are sought, in pixels; values that count as none."""

MINIMUM = 9
"""Side, in pixels, of the square in which a minimum is the least value."""

SIZE_POWER = 0.3
"""Power of the smaller region's share in the cost of a merge: small ones go first."""


def merged_basins(boundary: Floats, inside: Mask, strength: float) -> Labels:
    """Regions of a picture between boundaries.

    Args:
        boundary: float32 [h, w] in 0..1, how likely a pixel lies on the edge of an object.
        inside: bool [h, w], not empty, True for the pixels that count.
        strength: Cost from which on regions stay apart: the mean of the boundary between them
            times the smaller one's share of the picture to the power `SIZE_POWER`.

    Returns:
        int [h, w] number of each pixel's region, from 0; -1 outside.
    """
    basins = np.where(inside, _watershed(boundary), -1)
    count_all, compact = np.unique(basins, return_inverse=True)
    labels = compact.reshape(basins.shape) - int(count_all[0] == -1)
    count = int(labels.max()) + 1
    total, length = np.zeros((2, count, count))
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        touch = (labels[a] != labels[b]) & (labels[a] >= 0) & (labels[b] >= 0)
        places = labels[a][touch], labels[b][touch]
        np.add.at(total, places, np.maximum(boundary[a], boundary[b])[touch])
        np.add.at(length, places, 1)
    area = np.bincount(labels[inside], minlength=count) / inside.size
    group = _merged(total + total.T, length + length.T, area, strength)
    return np.asarray(np.where(inside, group[labels], -1))


def _watershed(boundary: Floats) -> NDArray[np.int32]:
    """Basin of each pixel, int32 [h, w] from 1 on."""
    smooth = cv2.GaussianBlur(boundary, (0, 0), BLUR)
    low = cv2.erode(smooth, np.ones((MINIMUM, MINIMUM), np.uint8))
    _, marks = cv2.connectedComponents(((smooth <= low + 1e-4) | (smooth < FLAT)).astype(np.uint8))
    levels = np.rint(np.clip(boundary, 0, 1) * 255).astype(np.uint8)
    flooded = cv2.watershed(cv2.merge([levels] * 3), marks)
    return np.asarray(spread(np.where(flooded <= 0, -1, flooded)), np.int32)


def _merged(
    total: NDArray[np.float64],
    length: NDArray[np.float64],
    area: NDArray[np.float64],
    strength: float,
) -> Labels:
    """Merges the cheapest neighbours until none costs less than `strength`.

    Args:
        total: float64 [N, N] boundary summed along the border that two basins share.
        length: float64 [N, N] length of it.
        area: float64 [N] share of the picture.
        strength: Cost from which on regions stay apart.

    Returns:
        int [N] number of the region of each basin, from 0.
    """
    group = np.arange(len(area))

    def costs(i: int) -> NDArray[np.float64]:
        mean = np.full(len(area), np.inf)
        np.divide(total[i], length[i], out=mean, where=length[i] > 0)
        return np.asarray(mean * np.minimum(area, area[i]) ** SIZE_POWER)

    cost = np.stack([costs(i) for i in range(len(area))])
    while True:
        i, j = divmod(int(cost.argmin()), len(area))
        if not cost[i, j] < strength:
            return np.asarray(np.unique(group, return_inverse=True)[1])
        group[group == j] = i
        area[i] += area[j]
        for matrix in (total, length):
            matrix[i] += matrix[j]
            matrix[:, i] = matrix[i]
            matrix[j] = matrix[:, j] = matrix[i, i] = 0
        cost[j] = cost[:, j] = np.inf
        cost[i] = cost[:, i] = costs(i)
