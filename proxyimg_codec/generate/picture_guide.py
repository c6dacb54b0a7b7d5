"""A picture as guide: the texture gets patches as that picture has them, wherever they lie.

The distance is the sliced Wasserstein distance of patches at several scales (Elnekave and Weiss
2022, "Generating natural images with direct Patch Distributions Matching"): of random projections
of the patches, the sorted values are compared.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..io import raster
from ..io.samples import to_float
from .guide import Batch, Judged

SIDE = 64
"""Rows and columns of the pictures that are judged."""

PATCH, PATCHES, PROJECTIONS = 5, 768, 32
"""Rows and columns of patches; most patches and random projections at each scale and step."""

SCALES = (1, 2, 4)
"""Reductions at which patches are compared."""

INSIDE = 0.99
"""Share of the texture from which a patch counts as one of it."""


class PictureGuide:
    """Sliced Wasserstein distance of the patches that lie in the texture.

    Args:
        picture: [1, 3, H, W] the picture that it should be like, in 0..1.

    Attributes:
        side: Rows and columns of the pictures that are judged.
        retries: Always 0.
    """

    side = SIDE
    retries = 0

    def __init__(self, picture: Tensor) -> None:
        self._picture = picture

    def judge(self, batch: Batch) -> Judged:
        """Distances of the patches, and their gradients; times do not matter."""
        images = batch.images.detach().clone().requires_grad_()
        losses = [
            self._distance(image[None], shown[None], batch.random)
            for image, shown in zip(images, batch.shown, strict=True)
        ]
        loss = torch.stack(losses)
        # As large as a sum over samples, which other guides give.
        total = loss.sum() * images[0].numel()
        (gradient,) = torch.autograd.grad(total, images)
        return Judged(gradient, loss.detach())

    def _distance(self, image: Tensor, shown: Tensor, random: torch.Generator) -> Tensor:
        total = image.sum() * 0
        for scale in SCALES:
            small, part = (F.avg_pool2d(v, scale) for v in (image, shown))
            goal = F.avg_pool2d(self._picture.to(image), scale)
            if min(*small.shape[2:], *goal.shape[2:]) < PATCH:
                continue
            inside = F.unfold(part, PATCH).mean(1)[0]
            if float(inside.max()) <= 0:
                continue
            at = torch.nonzero(inside >= min(INSIDE, float(inside.max())))[:, 0]
            at = at[torch.randperm(len(at), generator=random)[:PATCHES].to(at.device)]
            ways = torch.randn((PROJECTIONS, 3 * PATCH**2), generator=random, dtype=image.dtype)
            ways = (ways / ways.norm(dim=1, keepdim=True)).to(image.device)
            own = (ways @ F.unfold(small, PATCH)[0, :, at]).sort(1).values
            there = F.unfold(goal, PATCH)[0]
            there = there[:, torch.randperm(there.shape[1], generator=random)[:PATCHES]]
            wanted = (ways @ there).sort(1).values
            place = (torch.arange(own.shape[1], device=own.device) + 0.5) / own.shape[1]
            rank = (place * wanted.shape[1]).long().clamp(0, wanted.shape[1] - 1)
            total = total + F.mse_loss(own, wanted[:, rank])
        return total


def picture_guide(path: Path) -> PictureGuide:
    """Guide of a picture file.

    Raises:
        InputError: The file is no picture that can be read.
    """
    pixels = to_float(np.asarray(raster.read(str(path)).pixels))[0]
    picture = torch.from_numpy(np.ascontiguousarray(pixels[..., :3].transpose(2, 0, 1)))[None]
    longest = max(picture.shape[2:])
    if longest > 4 * SIDE:
        size = [max(round(n * 4 * SIDE / longest), 1) for n in picture.shape[2:]]
        picture = F.interpolate(picture, size, mode="bilinear", antialias=True)
    return PictureGuide(picture)
