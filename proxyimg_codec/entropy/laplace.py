"""Tabulated distributions of latents: a mixture of two Laplace distributions, in integers.

The context network predicts a mean m, in 1/16, and a scale index s of each latent. The density of
the latent around m is

    7/8 Laplace(b) + 1/8 Laplace(e b),    b = exp(s / 8 - 4).

The second part is wider, for errors that the context cannot foresee. All arithmetic is integer, so
that every decoder has the same tables (spec chapter 8).
"""

from __future__ import annotations

import decimal
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .rans import SCALE_BITS

MEAN_BITS = 4
"""Fractional bits of a mean."""

SCALES = 64
"""Number of scale indices."""

CERTAIN = 4
"""Largest scale index at which a latent with a mean within ±1/4 is 0 and needs no symbol."""

DIRECT = 40
"""Largest scale index with a table; above it, the low bits of a latent are coded raw."""

REACH = 31
"""Largest difference from the rounded mean that can have a symbol; larger ones escape."""

WIDTH = 2 * REACH + 2
"""Most symbols of a distribution: the differences, and as the last symbol the escape."""

# Number of raw low bits by scale index: the fewest that bring the index down to `DIRECT`. Halving
# the scale lowers its index by 5.5.
SHIFTS = np.array(
    [min(r for r in range(8) if s - (11 * r + 1) // 2 <= DIRECT) for s in range(SCALES)]
)
_ONE = 1 << 30
_HEAVIER = 8


class Symbol(NamedTuple):
    """Distributions of N latents; all arrays are int64 [N].

    Attributes:
        row: Row of `tables`, or -1 where the latent is certainly 0.
        centre: Value of the shifted latent (latent >> shift) that a difference of 0 stands for.
        shift: Number of low bits that are coded raw.
    """

    row: NDArray[np.int64]
    centre: NDArray[np.int64]
    shift: NDArray[np.int64]


def locate(mean: NDArray[np.int64], scale: NDArray[np.int64]) -> Symbol:
    """Finds the distributions for means [N] in 1/16 and scale indices [N] in 0..63."""
    shift, index = SHIFTS.take(scale), scale
    if scale.max(initial=0) > DIRECT:
        index = scale - (11 * shift + 1) // 2
        mean = np.where(shift > 0, (mean >> shift) - 8 + (8 >> shift), mean)
    centre = (mean + 8) >> MEAN_BITS
    part = mean - (centre << MEAN_BITS) + 8
    certain = (scale <= CERTAIN) & (mean >= -4) & (mean <= 4)
    return Symbol(np.where(certain, -1, index * 16 + part), centre, shift)


class Tables(NamedTuple):
    """Tables of all distributions, one per row.

    Attributes:
        ends: uint16 [rows, WIDTH + 1] cumulative frequency before each symbol, and after the last.
            A row with fewer symbols is filled up with the total frequency.
        reach: int64 [rows] largest difference with a symbol. Symbol i stands for the difference
            i - reach, and symbol 2 * reach + 1 for the escape.
    """

    ends: NDArray[np.uint16]
    reach: NDArray[np.int64]


def reach_of(scale: int) -> int:
    """Largest difference that has a symbol at a scale index of at most `DIRECT`."""
    return min(REACH, 2 + (20 * _decay_inverse(scale) >> 16))


@functools.cache
def decay(scale: int) -> int:
    """Decay exp(-1 / (16 b)) of a scale index in units of 2**-30, rounded."""
    with decimal.localcontext(prec=40):
        b = (decimal.Decimal(scale) / 8 - 4).exp()
        return int(((-1 / (16 * b)).exp() * _ONE).to_integral_value(decimal.ROUND_HALF_EVEN))


@functools.cache
def _decay_inverse(scale: int) -> int:
    """Scale b of a scale index in units of 2**-16, rounded."""
    with decimal.localcontext(prec=40):
        b = (decimal.Decimal(scale) / 8 - 4).exp()
        return int((b * 65536).to_integral_value(decimal.ROUND_HALF_EVEN))


@functools.cache
def tables() -> Tables:
    """Computes the tables, once."""
    total = 1 << SCALE_BITS
    ends = np.full(((DIRECT + 1) * 16, WIDTH + 1), total, np.uint16)
    reaches = np.zeros(len(ends), np.int64)
    for scale in range(DIRECT + 1):
        tail = 7 * _powers(decay(scale)) + _powers(decay(scale + _HEAVIER))  # 2**33 at 0
        reach = reach_of(scale)
        free = total - (2 * reach + 2)
        for part in range(16):
            # Distance of the upper end of each difference from the mean, in 1/16.
            z = 16 * np.arange(-reach - 1, reach + 1) + 8 - (part - 8)
            below = np.where(z >= 0, (1 << 34) - tail[np.abs(z)], tail[np.abs(z)])
            mass = (below - below[0]) * free >> 34
            count = np.arange(len(z))
            row = scale * 16 + part
            ends[row, : 2 * reach + 2] = mass + count
            reaches[row] = reach
    return Tables(ends, reaches)


def _powers(factor: int) -> NDArray[np.int64]:
    """Powers factor**n, n = 0, 1, .., in 2**-30; each is the one before times factor, rounded."""
    out = [_ONE]
    for _ in range(16 * (REACH + 2)):
        out.append((out[-1] * factor + (_ONE >> 1)) >> 30)
    return np.array(out, np.int64)
