"""Shifts of the scale index, which correct the predictions of the context network for a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHIFTS = range(-8, 8)
"""Shifts of the scale index that a file can hold."""


def best_shift(bits: NDArray[np.float64]) -> int:
    """Shift that takes the fewest bits, found by descent from 0.

    Args:
        bits: float64 [16] bits of a sample of the latents of a level with each of `SHIFTS`.
    """

    def cost(shift: int) -> float:
        return float(bits[shift - SHIFTS[0]]) + 1e-3 * abs(shift)

    best = 0
    while True:
        near = min({best - 1, best, best + 1} & set(SHIFTS), key=lambda s: (cost(s), s))
        if near == best:
            return best
        best = near
