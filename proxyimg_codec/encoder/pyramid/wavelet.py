"""CDF 9/7 wavelet as convolutions over 2 x 2 cells, from which the learned transform starts."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from ...texture.grid import BANDS, mirrored_indices
from ...texture.synthesis import wavelet
from .filters import analysis_wavelet

Size = tuple[int, ...]
"""Rows and columns of planes."""


def synthesis_weights() -> Tensor:
    """Synthesis weights of the decoder, float32 [12, 12, 5, 5].

    Outputs are the 4 samples of a cell of each colour; inputs are 3 planes and 9 bands.
    """
    return torch.tensor(wavelet(), dtype=torch.float32)


def analysis_weights() -> Tensor:
    """Analysis weights, float32 [12, 12, 5, 5].

    Outputs are 3 planes and 9 bands 3 * colour + band; inputs are the 4 samples of a cell of each
    colour.
    """
    return torch.tensor(analysis_wavelet(), dtype=torch.float32)


def reflected(x: Tensor, reach: int) -> Tensor:
    """Extends planes [B, C, h, w] by `reach` samples on each side, mirrored as often as needed.

    Where h or w is odd, one more is added below or on the right.
    """
    for dim in (2, 3):
        n = x.shape[dim]
        period = max(2 * n - 2, 1)
        index = torch.arange(-reach, n + n % 2 + reach) % period
        x = x.index_select(dim, torch.where(index < n, index, period - index))
    return x


def extended(low: Tensor, high: Tensor, size: Size) -> Tensor:
    """Joins planes and bands, extended by two samples on each side, each by its own symmetry.

    Args:
        low: [B, 3, h, w] planes.
        high: [B, 9, h, w] bands.
        size: Rows and columns of the finer planes that these make, 2 h or 2 h - 1 and so on.

    Returns:
        [B, 12, h + 4, w + 4]: planes, then the bands ordered by band, then colour.
    """

    def extend(x: Tensor, *ways: int) -> Tensor:
        for dim, n, high in zip((2, 3), size, ways, strict=True):
            index = torch.from_numpy(mirrored_indices(n, bool(high)))
            x = x.index_select(dim, index.to(x.device))
        return x

    parts = [extend(high[:, band::3], *ways) for band, ways in enumerate(BANDS)]
    return torch.cat([extend(low, 0, 0), *parts], 1)


def merged(cells: Tensor, size: Size) -> Tensor:
    """Planes [B, C, *size] of which `cells` [B, 4 C, h, w] has 2 x 2 samples a position."""
    return F.pixel_shuffle(cells, 2)[:, :, : size[0], : size[1]]
