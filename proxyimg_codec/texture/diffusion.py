"""Normative fill of codes that a layer does not store: smooth, integer, the same everywhere."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

FRACTION_BITS = 8
"""Filled values have this many fractional bits."""

SWEEPS = 8
"""Jacobi sweeps at each level."""

TILE = 128
"""Positions a side that are swept together, so that they stay in the cache."""

Values = NDArray[np.int32]


def fill(codes: NDArray[np.integer], stored: NDArray[np.bool_]) -> Values:
    """Values [C, H, W] with `FRACTION_BITS` fractional bits: stored ones kept, others diffused.

    Args:
        codes: [C, H, W] integers of magnitude below 2**16; those not stored do not matter.
        stored: [H, W]; at least one position must be stored.
    """
    return diffused(codes.astype(np.int32) << FRACTION_BITS, stored)


def diffused(value: Values, known: NDArray[np.bool_]) -> Values:
    """Values [C, H, W] as they are where `known`, others diffused from these.

    Pull: each level halves the plane; a cell is the mean, rounded half up, of its known children,
    known if any is. Push: from coarse to fine an unknown cell takes its parent's value, then
    `SWEEPS` times the mean of its four neighbours, (sum + 2) >> 2, edges repeated, all at once.

    Args:
        value: Magnitudes below 2**24; those not known do not matter.
        known: [H, W]; at least one position must be known.
    """
    if known.all():
        return value
    coarse = diffused(*_pull(value, known))
    h, w = known.shape
    parent = coarse.repeat(2, 1)[:, :h].repeat(2, 2)[:, :, :w]
    return _smooth(np.where(known, value, parent), known)


def _pull(value: Values, known: NDArray[np.bool_]) -> tuple[Values, NDArray[np.bool_]]:
    h, w = known.shape
    pad = ((0, h % 2), (0, w % 2))
    seen = np.pad(known, pad)
    kept = np.pad(np.where(known, value, np.int32(0)), ((0, 0), *pad))
    count = np.zeros(((h + 1) // 2, (w + 1) // 2), np.int32)
    total = np.zeros((len(value), *count.shape), np.int32)
    for y, x in product((0, 1), repeat=2):
        count += seen[y::2, x::2]
        total += kept[:, y::2, x::2]
    return (2 * total + count) // np.maximum(2 * count, 1), count > 0


def _smooth(value: Values, known: NDArray[np.bool_]) -> Values:
    """`value` with its unknown positions swept.

    In tiles with a rim that is as wide as there are sweeps: what is cut off there cannot have come
    as far as the tile when they are done.
    """
    h, w = known.shape
    out = value.copy()
    for y, x in product(range(0, h, TILE), range(0, w, TILE)):
        if known[y : y + TILE, x : x + TILE].all():
            continue
        top, left = max(y - SWEEPS, 0), max(x - SWEEPS, 0)
        part = (slice(top, y + TILE + SWEEPS), slice(left, x + TILE + SWEEPS))
        swept = _swept(value[:, *part], ~known[part])
        out[:, y : y + TILE, x : x + TILE] = swept[
            :, y - top : y - top + TILE, x - left : x - left + TILE
        ]
    return out


def _swept(value: Values, unknown: NDArray[np.bool_]) -> Values:
    """All sweeps of a small plane."""
    p = np.pad(value, ((0, 0), (1, 1), (1, 1)), mode="edge")
    inner = p[:, 1:-1, 1:-1]
    for _ in range(SWEEPS):
        mean = p[:, :-2, 1:-1] + p[:, 2:, 1:-1]
        mean += p[:, 1:-1, :-2]
        mean += p[:, 1:-1, 2:]
        mean += 2
        mean >>= 2
        np.copyto(inner, mean, where=unknown)
        p[:, 0], p[:, -1] = p[:, 1], p[:, -2]
        p[:, :, 0], p[:, :, -1] = p[:, :, 1], p[:, :, -2]
    return inner
