"""2-D Gaussians, accumulated (GaussianImage; Zhang et al. 2024).

A Gaussian has a place, the Cholesky factor of its covariance, and a colour that its weight is
multiplied into: 8 parameters. Colours of a pixel are sums over all Gaussians near it.
"""

from __future__ import annotations

from ...encoder.yielding import torch
from .fitting import Rival

EACH = 8
"""Parameters of a Gaussian."""

REACH = 3.0
"""Standard deviations beyond which a Gaussian is not drawn."""

CELL = 8
"""Side in pixels of the cells for which the Gaussians near them are listed."""

LISTED = 50
"""Steps after which the lists are made anew; meanwhile `SLACK` pixels of movement do no harm."""

SLACK = 1.0

WIDEN = 0.5
"""Least standard deviation in pixels, as GaussianImage adds it to the diagonal of the factor."""


class Gaussians(Rival):
    """Sum of Gaussians.

    Args:
        parameters: Most parameters.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.
    """

    rate = 2e-2

    def __init__(self, parameters: int, width: int, height: int) -> None:
        super().__init__()
        count = max(parameters // EACH, 1)
        self.size = torch.tensor([width, height], dtype=torch.float32)
        spread = (width * height / count) ** 0.5 / 2
        self.place = torch.nn.Parameter(torch.atanh(torch.rand(count, 2) * 1.98 - 0.99))
        start = torch.tensor([max(spread - WIDEN, 0.1), 0.0, max(spread - WIDEN, 0.1)])
        self.factor = torch.nn.Parameter(start.repeat(count, 1))
        self.colour = torch.nn.Parameter(torch.rand(count, 3) * 0.5)
        self._calls = 0
        self._listed = self._lists()

    def _shape(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Places [N, 2] in pixels and factors [N, 3]: l11, l21, l22 of the covariance L Lᵀ."""
        at = (torch.tanh(self.place) + 1) / 2 * self.size
        return at, self.factor + torch.tensor([WIDEN, 0.0, WIDEN])

    def _lists(self) -> tuple[torch.Tensor, torch.Tensor]:
        """First entry of each cell, and one more, and the Gaussians near cells, cell by cell."""
        with torch.no_grad():
            at, factor = self._shape()
            deviation = torch.stack([factor[:, 0].abs(), factor[:, 1:].norm(dim=1)], 1)
            reach = REACH * deviation + SLACK
            across = (self.size / CELL).ceil().long()
            low = ((at - reach) / CELL).floor().long().clamp(min=torch.zeros(2).long(),
                                                             max=across - 1)  # fmt: skip
            high = ((at + reach) / CELL).floor().long().clamp(min=low, max=across - 1)
            extent = high - low + 1
            number = extent.prod(1)
            owner = torch.repeat_interleave(torch.arange(len(at)), number)
            rank = torch.arange(len(owner)) - (number.cumsum(0) - number)[owner]
            x = low[owner, 0] + rank % extent[owner, 0]
            y = low[owner, 1] + rank // extent[owner, 0]
            cell = y * across[0] + x
            order = torch.argsort(cell, stable=True)
            counts = torch.bincount(cell, minlength=int(across.prod()))
            first = torch.cat([torch.zeros(1, dtype=torch.long), counts.cumsum(0)])
            return first, owner[order]

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2]."""
        if not torch.is_grad_enabled() or self._calls % LISTED == 0:
            self._listed = self._lists()
        self._calls += torch.is_grad_enabled()
        first, near = self._listed
        point = (place + 1) / 2 * self.size
        column, row = (point / CELL).long().unbind(1)
        cell = row * int((self.size[0] / CELL).ceil()) + column
        number = first[cell + 1] - first[cell]
        pixel = torch.repeat_interleave(torch.arange(len(place)), number)
        rank = torch.arange(len(pixel)) - (number.cumsum(0) - number)[pixel]
        one = near[first[cell[pixel]] + rank]
        at, factor = self._shape()
        held = torch.cat([at, factor, self.colour], 1).index_select(0, one)
        # Forward substitution: what the inverse factor makes of the offset.
        u = (point[pixel, 0] - held[:, 0]) / held[:, 2]
        v = (point[pixel, 1] - held[:, 1] - held[:, 3] * u) / held[:, 4]
        weight = torch.exp(-(u * u + v * v) / 2)
        return torch.zeros(len(place), 3).index_add(0, pixel, weight[:, None] * held[:, 5:])
