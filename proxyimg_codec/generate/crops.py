"""Random crops of a scene, with small affine jitter, so that no place is learnt by heart."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from .scene import Scene

NEAR, FAR = 0.5, 1.25
"""Least and greatest side of crops, as shares of the longer side of the layer."""

TURN, SHEAR, SHIFT = 0.2, 0.08, 0.08
"""Greatest turn in radians, slant, and shift as a share of the side of the crop."""

REDUCTION_MAX = 8
"""Most samples across and down that a pixel of a crop is the mean of."""


def crops(
    image: Tensor, scene: Scene, count: int, side: int, random: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Draws crops of a scene.

    Each is centred near a pixel in which the layer shows, the nearer the smaller it is.

    Args:
        image: [3, h, w] the scene.
        scene: The scene that it is.
        count: Number of crops B.
        side: Their rows and columns S.
        random: Generator of all random numbers, on the CPU.

    Returns:
        [B, 3, S, S] crops, and [B, 1, S, S] how much of each sample the layer has.
    """
    h, w = image.shape[1:]

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        values = torch.rand((count, *shape), generator=random, dtype=torch.float64)
        return low + (high - low) * values

    x0, y0, x1, y1 = scene.box
    longest = max(x1 - x0, y1 - y0)
    share = torch.exp(uniform(math.log(NEAR), math.log(FAR)))
    chosen = torch.randint(len(scene.index), (count,), generator=random)
    at = scene.index.cpu()[chosen]
    place = torch.stack([at % w, at // w], 1).double() + 0.5
    middle = torch.tensor([(x0 + x1) / 2, (y0 + y1) / 2], dtype=torch.float64)
    centre = middle + (place - middle) * (1 - share).clamp_min(0)[:, None]
    centre = centre + uniform(-SHIFT, SHIFT, 2) * (share * longest)[:, None]
    turn, slant = uniform(-TURN, TURN), uniform(-SHEAR, SHEAR)
    unit = torch.tensor([w, h], dtype=torch.float64)
    half = share[:, None] * longest / unit  # half of the side, where the scene has halves of 1
    cos, sin = turn.cos(), turn.sin()
    across = torch.stack([cos, -sin + slant * cos], 1) * half[:, :1]
    down = torch.stack([sin, cos + slant * sin], 1) * half[:, 1:]
    shift = 2 * centre / unit - 1
    theta = torch.stack([torch.cat([across, shift[:, :1]], 1),
                         torch.cat([down, shift[:, 1:]], 1)], 1)  # fmt: skip
    # Each sample is interpolated from two across and two down.
    reduction = math.ceil(float(share.max()) * longest / (2 * side))
    reduction = min(max(reduction, 1), REDUCTION_MAX)
    size = [count, 4, side * reduction, side * reduction]
    grid = F.affine_grid(theta, size, align_corners=False).to(image)
    planes = torch.cat([image, scene.share.to(image)[None]])[None].expand(count, -1, -1, -1)
    # Beyond its edge, the scene is mirrored.
    seen = F.grid_sample(planes, grid, padding_mode="reflection", align_corners=False)
    seen = F.avg_pool2d(seen, reduction)
    return seen[:, :3], seen[:, 3:].detach()
