"""Interpolation of samples at points, by cubic convolution with a = -1/2 [PYR-43].

Keys 1981, "Cubic Convolution Interpolation for Digital Image Processing".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..native import kernel
from .network import Floats

TAPS = 4
"""Number of samples, across and down, that a point is interpolated from."""

CHUNK = 4096
"""Points interpolated at a time, so that their samples stay in the processor cache."""

Indices = NDArray[np.intp]


def position(
    points: NDArray[np.float64], start: int, extent: int, samples: int
) -> tuple[Indices, Floats]:
    """Finds points along one axis of a texture.

    Args:
        points: float64 [N] texture points in canvas pixels.
        start: Canvas pixel at which the texture begins.
        extent: Canvas pixels that it is stretched over.
        samples: Number of its samples.

    Returns:
        Index of the sample before each point, and the fraction to the next sample.
    """
    at = (points - start) * (samples / extent)
    at -= 0.5
    np.clip(at, 0, samples - 1, out=at)
    before = at.astype(np.intp)
    at -= before
    return before, at.astype(np.float32)


def interpolated(
    padded: Floats, row: Indices, column: Indices, fx: Floats, fy: Floats, native: bool
) -> Floats:
    """Interpolates samples.

    Args:
        padded: float32 [height + 3, width + 3, C] samples with a border.
        row: [N] row of the sample before each point.
        column: [N] column of the sample before each point.
        fx: float32 [N] fractions to the next column.
        fy: float32 [N] fractions to the next row.
        native: Whether to use the compiled kernel.

    Returns:
        float32 [N, C].
    """
    first = row * padded.shape[1] + column
    if native:
        return kernel.sample(padded, first.astype(np.int32), fx, fy)
    out = np.empty((len(row), padded.shape[2]), np.float32)
    for i in range(0, len(row), CHUNK):
        at = slice(i, i + CHUNK)
        out[at] = _interpolated(padded, first[at], fx[at], fy[at])
    return out


def _interpolated(padded: Floats, first: Indices, fx: Floats, fy: Floats) -> Floats:
    """Colours [n, C] at fractions fx, fy [n] of the 4x4 samples that begin with `first` [n]."""
    samples = padded.reshape(-1, padded.shape[2])
    across, down = weights(fx), weights(fy)
    total = np.zeros((len(first), samples.shape[1]), np.float32)
    for j in range(TAPS):
        part = np.zeros_like(total)
        for i in range(TAPS):
            part += across[i][:, None] * samples.take(first + (j * padded.shape[1] + i), 0)
        total += down[j][:, None] * part
    return total


def weights(f: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Computes the weights of four samples beside each other.

    Args:
        f: float32 [N] fractions of points after the second one.

    Returns:
        Four arrays [N], which add up to 1. At f = 0 they are exactly 0, 1, 0, 0.
    """
    half = np.float32(0.5)
    return (
        ((2 - f) * f - 1) * f * half,
        ((3 * f - 5) * f * f + 2) * half,
        ((4 - 3 * f) * f + 1) * f * half,
        (f - 1) * f * f * half,
    )
