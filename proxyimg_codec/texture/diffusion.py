"""Normative fill of codes that a layer does not store: smooth, integer, the same everywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FRACTION_BITS = 8
"""Filled values have this many fractional bits."""

SWEEPS = 8
"""Jacobi sweeps at each level."""


def fill(codes: NDArray[np.integer], stored: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Values [C, H, W] with `FRACTION_BITS` fractional bits: stored ones kept, others diffused.

    Pull: each level halves the plane; a cell is the mean, rounded half up, of its known children,
    known if any is. Push: from coarse to fine an unknown cell takes its parent's value, then
    `SWEEPS` times the mean of its four neighbours, (sum + 2) >> 2, edges repeated, all at once.

    Args:
        codes: [C, H, W] integers; values where not stored do not matter.
        stored: [H, W]; at least one position must be stored.
    """
    return _fill(codes.astype(np.int64) << FRACTION_BITS, stored).astype(np.int32)


def _fill(value: NDArray[np.int64], known: NDArray[np.bool_]) -> NDArray[np.int64]:
    if known.all():
        return value
    coarse = _fill(*_pull(value, known))
    h, w = known.shape
    parent = coarse[:, np.arange(h)[:, None] // 2, np.arange(w) // 2]
    return _smooth(np.where(known, value, parent), known)


def _pull(
    value: NDArray[np.int64], known: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    h, w = known.shape
    pad = ((0, h % 2), (0, w % 2))
    blocks = (h + 1) // 2, 2, (w + 1) // 2, 2
    count = np.pad(known, pad).reshape(blocks).sum((1, 3))
    total = np.pad(np.where(known, value, 0), ((0, 0), *pad)).reshape(-1, *blocks).sum((2, 4))
    return (2 * total + count) // np.maximum(2 * count, 1), count > 0


def _smooth(value: NDArray[np.int64], known: NDArray[np.bool_]) -> NDArray[np.int64]:
    for _ in range(SWEEPS):
        p = np.pad(value, ((0, 0), (1, 1), (1, 1)), mode="edge")
        mean = (p[:, :-2, 1:-1] + p[:, 2:, 1:-1] + p[:, 1:-1, :-2] + p[:, 1:-1, 2:] + 2) >> 2
        value = np.where(known, value, mean)
    return value
