"""MS-SSIM in torch, as an aim of refinement."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the scales (Wang, Simoncelli, Bovik 2003, section 3.2)."""

C1, C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
"""Constants that keep quotients stable, for samples in 0..255."""

WINDOW, SIGMA = 11, 1.5
"""Side and standard deviation of the Gaussian window in samples."""


def ms_ssim(a: Tensor, b: Tensor, mirror: bool = False) -> Tensor:
    """Multi-scale structural similarity of pictures.

    Pictures that are too small for all scales use the first ones, with exponents that sum to 1; for
    those smaller than the window, it is as wide or high as they are.

    Args:
        a: float32 [B, C, H, W] pictures in 0..255.
        b: float32 [B, C, H, W] pictures to compare them with.
        mirror: Whether windows go beyond borders, where pictures are mirrored. Otherwise samples at
            a border hardly count, so whoever aims at it spoils them.

    Returns:
        float32 [B], 1 for equal pictures.
    """
    channels = a.shape[1]
    scales = max(min(len(WEIGHTS), (min(a.shape[2:]) // WINDOW).bit_length()), 1)
    total = sum(WEIGHTS[:scales])
    out = torch.ones(a.shape[0], channels)
    for scale in range(scales):
        products = torch.cat([a, b, a * a, b * b, a * b])
        mean = _blur(_mirrored(products) if mirror else products).chunk(5)
        ab, aa, bb = mean[0] * mean[1], mean[0] ** 2, mean[1] ** 2
        part = (2 * (mean[4] - ab) + C2) / (mean[2] - aa + mean[3] - bb + C2)
        if scale == scales - 1:
            part = part * (2 * ab + C1) / (aa + bb + C1)
        power = WEIGHTS[scale] / total
        out = out * part.mean((2, 3)).clamp_min(1e-4) ** power
        if scale < scales - 1:
            a, b = F.avg_pool2d(a, 2), F.avg_pool2d(b, 2)
    return out.mean(1)


def _mirrored(x: Tensor) -> Tensor:
    """Pictures [B, C, H, W] with as much beyond their borders as half of a window takes."""
    down, across = (min(WINDOW // 2, n - 1) for n in x.shape[2:])
    return F.pad(x, (across, across, down, down), mode="reflect")


def _blur(x: Tensor) -> Tensor:
    """Gaussian mean of each channel at all places where the window fits into the picture."""
    channels, height, width = x.shape[1:]
    across = _window(width).view(1, 1, 1, -1).expand(channels, 1, 1, -1)
    down = _window(height).view(1, 1, -1, 1).expand(channels, 1, -1, 1)
    return F.conv2d(F.conv2d(x, across, groups=channels), down, groups=channels)


def _window(extent: int) -> Tensor:
    """Gaussian weights float32 [n] that add up to 1, with n at most the extent of the picture."""
    n = min(WINDOW, extent)
    x = torch.arange(n, dtype=torch.float32) - (n - 1) / 2
    window = torch.exp(-(x**2) / (2 * SIGMA**2))
    return window / window.sum()
