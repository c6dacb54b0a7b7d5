"""Files of rivals: COIN's weights of 16 bits, and Gaussians with a few bits a number."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

from ...encoder.yielding import torch
from . import gaussians, sines
from .fitting import Pixels, picture, trained

COIN_BYTES = 2
"""Bytes of a weight (COIN)."""

PLACE_BITS, FACTOR_BITS, COLOUR_BITS = 12, 8, 8
"""Bits of each coordinate, number of the factor, and channel of a Gaussian. GaussianImage has 16, 6
and, by vectors, about 5; it quantizes while it trains, and ours only colours after the rest."""

GAUSSIAN_BYTES = (2 * PLACE_BITS + 3 * FACTOR_BITS + 3 * COLOUR_BITS) // 8

RANGES = 4 * 2 * (3 + 3)
"""Bytes of the least and greatest numbers of factors and colours, of 32 bits."""

REFIT = 4
"""Colours are fitted again with one of so many steps, once all else is quantized."""


@dataclass(frozen=True)
class Coded:
    """Result of coding a picture.

    Attributes:
        size: Bytes of the file, which is not written: its numbers are all it has.
        shown: uint8 [H, W, 3] decoded picture.
        encoding: CPU seconds of encoding.
        decoding: CPU seconds of decoding.
    """

    size: int
    shown: Pixels
    encoding: float
    decoding: float


def coin(pixels: Pixels, size: int, steps: int) -> Coded:
    """Codes a picture as COIN with weights of 16 bits in at most `size` bytes."""
    rival, spent = trained(partial(sines.coin, size // COIN_BYTES), pixels, steps)
    with torch.no_grad():
        for values in rival.parameters():
            values.copy_(values.half().float())
    started = time.process_time()
    shown = picture(rival, *pixels.shape[:2])
    count = COIN_BYTES * rival.parameters_used
    return Coded(count, shown, spent, time.process_time() - started)


def splats(pixels: Pixels, size: int, steps: int) -> Coded:
    """Codes a picture as quantized Gaussians in at most `size` bytes."""
    height, width = pixels.shape[:2]
    count = max((size - RANGES) // GAUSSIAN_BYTES, 1)
    make = partial(gaussians.Gaussians, gaussians.EACH * count, width, height)
    rival, spent = trained(make, pixels, steps)
    assert isinstance(rival, gaussians.Gaussians)
    with torch.no_grad():
        # Places are stored as they are drawn, evenly over the picture.
        place = _rounded((torch.tanh(rival.place) + 1) / 2, PLACE_BITS, 0.0, 1.0)
        rival.place.copy_(torch.atanh((2 * place - 1).clamp(-0.999999, 0.999999)))
        for k in range(3):
            rival.factor[:, k] = _rounded(rival.factor[:, k], FACTOR_BITS)
    rival.place.requires_grad_(False)
    rival.factor.requires_grad_(False)
    _, more = trained(lambda: rival, pixels, steps // REFIT)
    with torch.no_grad():
        for k in range(3):
            rival.colour[:, k] = _rounded(rival.colour[:, k], COLOUR_BITS)
    started = time.process_time()
    shown = picture(rival, height, width)
    return Coded(count * GAUSSIAN_BYTES + RANGES, shown, spent + more,
                 time.process_time() - started)  # fmt: skip


def _rounded(
    values: torch.Tensor, bits: int, low: float | None = None, high: float | None = None
) -> torch.Tensor:
    """Values [n] or [n, k] rounded to 2**bits even steps from the least to the greatest."""
    first = float(values.min()) if low is None else low
    last = float(values.max()) if high is None else high
    step = max(last - first, 1e-9) / (2**bits - 1)
    rounded: torch.Tensor = ((values - first) / step).round().clamp(0, 2**bits - 1) * step + first
    return rounded
