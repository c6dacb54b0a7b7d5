"""Fill of unknown values of a plane by diffusion in integers: smooth, and exact in all decoders."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..native import kernel
from . import completion_native

FRACTION_BITS = 8
"""Fractional bits of filled values."""

SWEEPS = 8
"""Jacobi sweeps at each level."""

TILE = 128
"""Side of the tiles that are swept one by one, so that they stay in the processor cache."""

Values = NDArray[np.int32]


def fill(codes: NDArray[np.integer], stored: NDArray[np.bool_]) -> Values:
    """Fills the codes that are not stored by diffusion from the stored ones.

    Args:
        codes: [C, H, W] integers below 2**16 in magnitude; those not stored have no influence.
        stored: bool [H, W], True at stored positions, of which there is at least one.

    Returns:
        int32 [C, H, W] values with `FRACTION_BITS` fractional bits.
    """
    return diffused(codes.astype(np.int32) << FRACTION_BITS, stored)


def diffused(
    value: Values, known: NDArray[np.bool_], wanted: NDArray[np.bool_] | None = None
) -> Values:
    """Fills unknown values by diffusion from the known ones [TEX-5 to TEX-9].

    Pull: each level halves the plane. A cell is the mean, rounded half up, of its known children,
    and is known if any child is. Push: from coarse to fine, an unknown cell takes the value of its
    parent. Then, `SWEEPS` times, all unknown cells at once take the mean (sum + 2) >> 2 of their
    four neighbours, where edges are repeated.

    Args:
        value: int32 [C, H, W] values below 2**24 in magnitude; unknown ones have no influence.
        known: bool [H, W], True at known positions, of which there is at least one.
        wanted: bool [H, W], True where the result is needed; None = everywhere. Elsewhere it may be
            anything.

    Returns:
        int32 [C, H, W]; `value` itself if all is known.
    """
    if known.all():
        return value
    if kernel.available():
        done = known if wanted is None else ~wanted
        return completion_native.diffused(value, known, done)
    coarse = diffused(*_pull(value, known))
    h, w = known.shape
    parent = coarse.repeat(2, 1)[:, :h].repeat(2, 2)[:, :, :w]
    return _smooth(np.where(known, value, parent), known, known if wanted is None else ~wanted)


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


def _smooth(value: Values, known: NDArray[np.bool_], done: NDArray[np.bool_]) -> Values:
    """Sweeps the unknown positions of a plane, tile by tile; not tiles of which all is `done`.

    Each tile is swept together with a rim of `SWEEPS` positions. An influence moves on by one
    position per sweep, so the cut-off outside of the rim cannot reach the tile.
    """
    h, w = known.shape
    out = value.copy()
    for y, x in product(range(0, h, TILE), range(0, w, TILE)):
        if done[y : y + TILE, x : x + TILE].all():
            continue
        top, left = max(y - SWEEPS, 0), max(x - SWEEPS, 0)
        part = (slice(top, y + TILE + SWEEPS), slice(left, x + TILE + SWEEPS))
        swept = _swept(value[:, *part], ~known[part])
        out[:, y : y + TILE, x : x + TILE] = swept[
            :, y - top : y - top + TILE, x - left : x - left + TILE
        ]
    return out


def _swept(value: Values, unknown: NDArray[np.bool_]) -> Values:
    """Makes all sweeps of a small plane."""
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
