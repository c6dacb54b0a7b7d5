"""Features of gradients, for distances between pictures where no learned network is at hand."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
Real = NDArray[np.float64]

SCALES = 3
"""Scales at which features are compared, each half as large as the one before."""

CELL, BLOCK, ORIENTATIONS = 8, 16, 9
"""Sides of cells and blocks in samples, and orientations of a histogram (Dalal, Triggs 2005)."""

BLOCK_FEATURES = ORIENTATIONS * (BLOCK // CELL) ** 2
"""Features of a block."""


def blocks(pixels: Pixels, scales: int = SCALES) -> list[NDArray[np.float32]]:
    """Histograms of oriented gradients of the blocks of a picture, at each scale.

    Cells have 8 samples a side and 9 orientations, in overlapping blocks of 2 x 2 cells with the
    normalization of OpenCV. They are found in grey at full, half and quarter size; what is left
    over at the right and below by whole cells is not seen. Scales without a block are left out.

    Args:
        pixels: uint8 [H, W, 3] picture.
        scales: Number of scales.

    Returns:
        float32 [blocks, `BLOCK_FEATURES`] for each scale.
    """
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    found = []
    for k in range(scales):
        size = (grey.shape[1] >> k, grey.shape[0] >> k)
        small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))
        width, height = (n // CELL * CELL for n in size)
        if min(width, height) < BLOCK:
            break
        hog = cv2.HOGDescriptor(
            (width, height), (BLOCK, BLOCK), (CELL, CELL), (CELL, CELL), ORIENTATIONS
        )
        values = np.ravel(hog.compute(np.ascontiguousarray(small[:height, :width])))
        found.append(np.asarray(values.reshape(-1, BLOCK_FEATURES), np.float32))
    return found


def distance(one: Pixels, other: Pixels) -> Real:
    """Distances of the features of two pictures at each scale, float64 [scales] in 0..sqrt(2)."""
    return np.array([
        np.linalg.norm(_unit(a) - _unit(b)) for a, b in zip(blocks(one), blocks(other), strict=True)
    ])  # fmt: skip


def _unit(features: NDArray[np.float32]) -> NDArray[np.float32]:
    return features / max(float(np.linalg.norm(features)), 1e-9)


def frechet(one: Sequence[Pixels], other: Sequence[Pixels]) -> float:
    """Fréchet distance of normal distributions fitted to the blocks of two sets of pictures.

    The formula is that of FID (Heusel et al. 2017); the features are not, so values of the two
    cannot be compared.
    """
    means, roots, traces = [], [], []
    for pictures in (one, other):
        seen = np.concatenate([b for p in pictures for b in blocks(p)]).astype(np.float64)
        covariance = np.cov(seen, rowvar=False)
        means.append(seen.mean(0))
        traces.append(float(np.trace(covariance)))
        values, vectors = np.linalg.eigh(covariance)
        roots.append((vectors * np.sqrt(np.clip(values, 0, None))) @ vectors.T)
    # The trace of the root of a product of covariances is the sum of singular values of this.
    mixed = float(np.linalg.svd(roots[0] @ roots[1], compute_uv=False).sum())
    away = float(((means[0] - means[1]) ** 2).sum())
    return max(away + traces[0] + traces[1] - 2 * mixed, 0.0)
