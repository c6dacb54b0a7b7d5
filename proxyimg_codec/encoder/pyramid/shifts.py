"""Shifts of the scale index, which correct the predictions of the context network for a picture."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from .model import LOG_SCALES
from .rate import bits_at

SHIFTS = range(-8, 8)
"""Shifts of the scale index that a file can hold."""


class Sample(NamedTuple):
    """Sample of the latents of a level.

    Attributes:
        offset: Latents less their means.
        log_scale: Natural logarithms of their scales, of the same shape.
        mask: 1 for latents that are coded, 0 for others; broadcasts with them.
    """

    offset: Tensor
    log_scale: Tensor
    mask: Tensor

    def bits(self, shift: int) -> float:
        """Bits of the sample with a shift of the scale index."""
        scale = (self.log_scale + shift / 8).clamp(*LOG_SCALES)
        return float((bits_at(self.offset, scale) * self.mask).sum((2, 3)).sum())


def best_shift(samples: list[Sample]) -> int:
    """Shift that takes the fewest bits, found by descent from 0."""
    spent: dict[int, float] = {}

    def cost(shift: int) -> float:
        if shift not in spent:
            spent[shift] = sum(part.bits(shift) for part in samples) + 1e-3 * abs(shift)
        return spent[shift]

    best = 0
    while (near := min((best - 1, best, best + 1), key=cost)) != best and near in SHIFTS:
        best = near
    return best
