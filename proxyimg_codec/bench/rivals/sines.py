"""Networks of sines: SIREN (Sitzmann et al. 2020) and COIN (Dupont et al. 2021)."""

from __future__ import annotations

import math
from itertools import pairwise

from ...encoder.yielding import torch
from .fitting import Rival

FREQUENCY = 30.0
"""Factor within each sine, w0 of both papers."""

COIN_LAYERS = 13
"""Layers of sines of COIN's largest model of Kodak pictures."""

SIREN_RATE, COIN_RATE = 1e-3, 5e-4
"""Learning rates: with batches and a cosine, higher ones than the authors' are better, until deep
or wide networks learn nothing at all."""


class Sines(Rival):
    """Network of sines with a linear output.

    Args:
        width: Width of the layers.
        layers: Number of layers of sines.
        rate: Peak learning rate.
    """

    def __init__(self, width: int, layers: int, rate: float) -> None:
        super().__init__()
        self.rate = rate
        sizes = [2, *[width] * layers, 3]
        linear = [torch.nn.Linear(i, o) for i, o in pairwise(sizes)]
        self.linear = torch.nn.ModuleList(linear)
        with torch.no_grad():
            for k, layer in enumerate(linear):
                fan_in = sizes[k]
                bound = 1 / fan_in if k == 0 else math.sqrt(6 / fan_in) / FREQUENCY
                layer.weight.uniform_(-bound, bound)

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2]."""
        x = place
        for k in range(len(self.linear) - 1):
            x = torch.sin(FREQUENCY * self.linear[k](x))
        # Colours of both papers are -1..1 or 0..1; a shift to the middle starts all alike.
        out: torch.Tensor = self.linear[-1](x) / 2 + 0.5
        return out


def count(width: int, layers: int) -> int:
    """Number of parameters of `Sines`."""
    return 3 * width + (layers - 1) * width * (width + 1) + 3 * (width + 1)


def siren(width: int, hidden: int) -> Sines:
    """SIREN as its authors count: one layer from places, and `hidden` layers between the same."""
    return Sines(width, hidden + 1, SIREN_RATE)


def coin(parameters: int) -> Sines:
    """COIN of `COIN_LAYERS` layers, as wide as a number of parameters allows."""
    width = 1
    while count(width + 1, COIN_LAYERS) <= parameters:
        width += 1
    return Sines(width, COIN_LAYERS, COIN_RATE)
