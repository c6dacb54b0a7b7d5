"""Curvature of the squared error by each latent: what a move by one adds, whatever the slope is.

Inside a picture it is the square of the band's gain, because the filters of the wavelet are nearly
orthonormal. Filters that are mirrored at a border add up there, and samples have weights.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ...texture.grid import BANDS, mirrored_indices
from ...texture.network import Floats
from ...texture.synthesis import axis_filters

LEAST = 0.05
"""Least mean weight of samples that counts; it is known roughly where weights change suddenly."""


def bends(shape: tuple[int, int], levels: int, weight: Floats | None) -> list[Floats]:
    """Factors of the square of the gain.

    Args:
        shape: Rows and columns of the samples.
        levels: Number of levels.
        weight: float32 [rows, columns] weights of the squared errors of samples; None = 1.

    Returns:
        For levels 1, 2, ... float32 [3, h, w], a factor for each of `BANDS`; then for the lowest
        planes float32 [1, h, w].
    """
    down, across = (norms(n, levels) for n in shape)
    around = np.ones(shape, np.float32) if weight is None else weight
    out = []
    for rows, columns in zip(down, across, strict=True):
        around = _halved(around)
        mean = 1 if weight is None else np.maximum(_blurred(around), LEAST)
        out.append(np.stack([mean * np.outer(rows[v], columns[h]) for v, h in BANDS]))
    lowest = mean * np.outer(rows[0], columns[0])
    return [*out, lowest[None].astype(np.float32)]


@functools.lru_cache(maxsize=16)
def norms(size: int, levels: int) -> Sequence[Floats]:
    """Squared norms of what a unit of a low and of a high band gives along an axis.

    Args:
        size: Number of samples of the axis.
        levels: Number of levels.

    Returns:
        For levels 1, 2, ... float32 [2, n] for the positions of the low and of the high band;
        where the high band has none, 1.
    """
    shown = np.eye(size, dtype=np.float32)
    out = []
    for _ in range(levels):
        low, high = (shown @ _synthesis(shown.shape[1], bool(k)) for k in range(2))
        both = np.stack([np.einsum("ij,ij->j", v, v) for v in (low, high)])
        both[both == 0] = 1
        out.append(both)
        shown = low
    return tuple(out)


def _synthesis(size: int, high: bool) -> Floats:
    """Matrix [size, n] that makes samples of a band of ceil(size / 2)."""
    taps, index = axis_filters()[int(high)], mirrored_indices(size, high)
    out = np.zeros((size, (size + 1) // 2), np.float32)
    sample = np.arange(size)
    for tap in range(5):
        np.add.at(out, (sample, index[sample // 2 + tap]), taps[sample % 2, tap])
    return out


def _halved(plane: Floats) -> Floats:
    """Means of 2 x 2, of fewer at the end of an odd side."""
    for axis in range(2):
        n = plane.shape[axis]
        even, odd = (plane.take(np.arange(k, n, 2), axis) for k in range(2))
        both = odd if n % 2 == 0 else np.concatenate([odd, even.take([-1], axis)], axis)
        plane = np.asarray((even + both) / 2, np.float32)
    return plane


def _blurred(plane: Floats) -> Floats:
    """Means with weights 1, 2, 1 along both axes, with edges repeated."""
    wide = np.pad(plane, 1, mode="edge")
    tall = (wide[:-2] + 2 * wide[1:-1] + wide[2:]) / 4
    return np.asarray((tall[:, :-2] + 2 * tall[:, 1:-1] + tall[:, 2:]) / 4, np.float32)
