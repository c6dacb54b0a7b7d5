"""Grids of features with a small network: LIIF-like (Chen et al. 2021), hash grid (Müller 2022)."""

from __future__ import annotations

import math

from ...encoder.yielding import torch
from .fitting import Rival

LIIF_FEATURES = 8
"""Features of a cell of the LIIF-like grid."""

LEVELS, LEVEL_FEATURES, COARSEST = 8, 2, 16
"""Levels of the hash grid, features of an entry, and cells across the coarsest (as in the paper's
pictures, with fewer levels, because the pictures are smaller)."""

PRIME = 2654435761
"""Factor of rows in the hash (Müller et al. 2022)."""

CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1))


class LocalGrid(Rival):
    """LIIF-like grid: a network of two layers sees a cell's code and the place within the cell.

    The four cells around a place are asked, and their answers mixed bilinearly (local ensemble).
    There is no encoder: codes are fitted to the one picture.

    Args:
        parameters: Most parameters.
        hidden: Width of the network.
    """

    rate = 1e-2

    def __init__(self, parameters: int, hidden: int) -> None:
        super().__init__()
        inputs = LIIF_FEATURES + 2
        self.network = torch.nn.Sequential(
            torch.nn.Linear(inputs, hidden), torch.nn.ReLU(), torch.nn.Linear(hidden, 3)
        )
        left = parameters - self.parameters_used
        self.side = max(math.isqrt(max(left, 0) // LIIF_FEATURES), 2)
        self.codes = torch.nn.Parameter(0.01 * torch.randn(self.side**2, LIIF_FEATURES))

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2]."""
        at = (place + 1) / 2 * (self.side - 1)
        first = at.floor().clamp(0, self.side - 2)
        inside = at - first
        out = torch.zeros(len(place), 3)
        for dx, dy in CORNERS:
            corner = first + torch.tensor([dx, dy])
            row = (corner[:, 1] * self.side + corner[:, 0]).long()
            away = at - corner
            said = self.network(torch.cat([self.codes.index_select(0, row), away], 1))
            out = out + said * (1 - (inside - torch.tensor([dx, dy])).abs()).prod(1, keepdim=True)
        return out


class HashGrid(Rival):
    """Hash grid in the manner of Instant-NGP: levels that share tables of bounded size.

    Args:
        parameters: Most parameters.
        hidden: Width of the two hidden layers.
        finest: Cells across the finest level.
    """

    rate = 2e-2

    def __init__(self, parameters: int, hidden: int, finest: int) -> None:
        super().__init__()
        self.network = torch.nn.Sequential(
            torch.nn.Linear(LEVELS * LEVEL_FEATURES, hidden), torch.nn.ReLU(),
            torch.nn.Linear(hidden, hidden), torch.nn.ReLU(), torch.nn.Linear(hidden, 3),
        )  # fmt: skip
        growth = (max(finest, COARSEST) / COARSEST) ** (1 / (LEVELS - 1))
        self.cells = [int(COARSEST * growth**k) for k in range(LEVELS)]
        budget = (parameters - self.parameters_used) // LEVEL_FEATURES
        self.sizes = table_sizes([(n + 1) ** 2 for n in self.cells], budget)
        self.tables = torch.nn.ParameterList(
            (torch.rand(n, LEVEL_FEATURES) * 2 - 1) * 1e-2 for n in self.sizes
        )

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2]."""
        found = []
        for cells, size, table in zip(self.cells, self.sizes, self.tables, strict=True):
            at = (place + 1) / 2 * cells
            first = at.floor().clamp(0, cells - 1)
            inside, whole = at - first, first.long()
            features = torch.zeros(len(place), LEVEL_FEATURES)
            for dx, dy in CORNERS:
                x, y = whole[:, 0] + dx, whole[:, 1] + dy
                row = y * (cells + 1) + x if size == (cells + 1) ** 2 else (x ^ (y * PRIME)) % size
                weight = (1 - (inside - torch.tensor([dx, dy])).abs()).prod(1, keepdim=True)
                features = features + table.index_select(0, row) * weight
            found.append(features)
        out: torch.Tensor = self.network(torch.cat(found, 1))
        return out


def table_sizes(nodes: list[int], budget: int) -> list[int]:
    """Sizes of tables: the nodes of each level, but at most so many that all fit the budget."""
    low, high = 1, max(nodes)
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if sum(min(n, middle) for n in nodes) <= budget else (
            low, middle - 1)  # fmt: skip
    return [min(n, low) for n in nodes]
