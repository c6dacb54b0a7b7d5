"""Shifts of the scale index: what the context predicts, corrected for one picture."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from .model import LOG_SCALES
from .rate import bits_at

SHIFTS = range(-8, 8)
"""Shifts of the scale index that a file can hold."""


class Sample(NamedTuple):
    """Some latents less their mean, the log of their scale, and which of them are coded."""

    offset: Tensor
    log_scale: Tensor
    mask: Tensor

    def bits(self, shift: int) -> float:
        """Bits with a shift of the scale index."""
        scale = (self.log_scale + shift / 8).clamp(*LOG_SCALES)
        return float((bits_at(self.offset, scale) * self.mask).sum())


def best_shift(samples: list[Sample]) -> int:
    """The shift that takes the fewest bits, found downhill from none."""
    spent: dict[int, float] = {}

    def cost(shift: int) -> float:
        if shift not in spent:
            spent[shift] = sum(part.bits(shift) for part in samples) + 1e-3 * abs(shift)
        return spent[shift]

    best = 0
    while (near := min((best - 1, best, best + 1), key=cost)) != best and near in SHIFTS:
        best = near
    return best
