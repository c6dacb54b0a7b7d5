"""Interpolation of samples by cubic convolution [PYR-43] (R. Keys 1981, a = -1/2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .network import Floats

TAPS = 4
"""Number of samples, across and down, that a point is interpolated from."""

CHUNK = 4096
"""Points interpolated at a time, so that their samples stay in the processor cache."""


def interpolated(padded: Floats, first: NDArray[np.intp], fx: Floats, fy: Floats) -> Floats:
    """Interpolates samples at points.

    Args:
        padded: float32 [rows, columns, C] samples.
        first: intp [N] number, row by row, of the first of the 4x4 samples around each point.
        fx: float32 [N] how far each point is, across, from the second sample to the third.
        fy: float32 [N] the same, down.

    Returns:
        float32 [N, C].
    """
    out = np.empty((len(first), padded.shape[2]), np.float32)
    for i in range(0, len(first), CHUNK):
        at = slice(i, i + CHUNK)
        out[at] = _mixed(padded, first[at], fx[at], fy[at])
    return out


def _mixed(padded: Floats, first: NDArray[np.intp], fx: Floats, fy: Floats) -> Floats:
    """Colours [n, C] at fractions fx, fy [n] of the 4x4 samples that begin with `first` [n]."""
    samples = padded.reshape(-1, padded.shape[2])
    across, down = _weights(fx), _weights(fy)
    total = np.zeros((len(first), samples.shape[1]), np.float32)
    for j in range(TAPS):
        part = np.zeros_like(total)
        for i in range(TAPS):
            part += across[i][:, None] * samples.take(first + (j * padded.shape[1] + i), 0)
        total += down[j][:, None] * part
    return total


def _weights(f: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights of four neighbouring samples for points at the fractions f [N] after the second one.

    They add up to 1. At f = 0 they are exactly 0, 1, 0, 0.
    """
    half = np.float32(0.5)
    return (
        ((2 - f) * f - 1) * f * half,
        ((3 * f - 5) * f * f + 2) * half,
        ((4 - 3 * f) * f + 1) * f * half,
        (f - 1) * f * f * half,
    )
