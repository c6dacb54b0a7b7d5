"""The layers network, in torch for its training, and its export."""

from __future__ import annotations

from itertools import pairwise

import torch.nn.functional as F
from torch import Tensor, nn

WIDTHS = (16, 32, 64, 96, 112)
"""Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the size of the picture."""

BLOCKS = (1, 2, 2, 2, 2)
"""Residual blocks of each level on the way down."""


class Block(nn.Module):
    """Residual block of two convolutions."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.first_norm = nn.BatchNorm2d(width)
        self.second = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.second_norm = nn.BatchNorm2d(width)

    def forward(self, x: Tensor) -> Tensor:
        """Maps [B, width, H, W] to the same shape."""
        inner = F.relu(self.first_norm(self.first(x)))
        return F.relu(x + self.second_norm(self.second(inner)))


class LayersNetwork(nn.Module):
    """Network that goes down to 1/32 of the size and up again.

    Its input is float32 [B, 3, H, W] in 0..1, sides multiples of 32. Its output is [B, 4, H, W]:
    logits of figure and of boundary, and the vector x, y of ownership.
    """

    def __init__(self) -> None:
        super().__init__()
        pairs = list(pairwise(WIDTHS))
        self.stem = nn.Conv2d(3, WIDTHS[0], 5, stride=2, padding=2)
        self.down = nn.ModuleList(nn.Conv2d(a, b, 3, stride=2, padding=1) for a, b in pairs)
        self.levels = nn.ModuleList(
            nn.Sequential(*(Block(width) for _ in range(count)))
            for width, count in zip(WIDTHS, BLOCKS, strict=True)
        )
        self.whole = nn.Linear(WIDTHS[-1], WIDTHS[-1])
        self.wide = nn.Conv2d(WIDTHS[-1], WIDTHS[-1], 3, padding=2, dilation=2)
        self.up = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in pairs)
        self.joined = nn.ModuleList(Block(width) for width in WIDTHS[:-1])
        self.head = nn.Conv2d(WIDTHS[0], 16, 3, padding=1)

    def forward(self, rgb: Tensor) -> Tensor:
        """Computes the maps."""
        x = F.relu(self.stem((rgb - 0.45) * 4))
        kept = []
        for i, level in enumerate(self.levels):
            x = level(x)
            kept.append(x)
            if i < len(self.down):
                x = F.relu(self.down[i](x))
        x = F.relu(
            x + self.wide(x) + self.whole(x.mean((2, 3), keepdim=True).flatten(1))[..., None, None]
        )
        for i in reversed(range(len(self.up))):
            x = F.interpolate(self.up[i](x), scale_factor=2.0, mode="bilinear") + kept[i]
            x = self.joined[i](F.relu(x))
        return F.pixel_shuffle(self.head(x), 2)
