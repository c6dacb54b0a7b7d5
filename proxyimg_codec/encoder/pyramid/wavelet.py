"""CDF 9/7 wavelet as convolutions over 2 x 2 cells, from which the learned transform starts."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ...texture.synthesis import BANDS, mirrored_indices, wavelet

# Cohen, Daubechies, Feauveau 1992; Antonini et al. 1992, table II, orthonormal scaling: halves of
# the analysis filters.
_LOW = (0.852698679009, 0.377402855613, -0.110624404418, -0.023849465020, 0.037828455507)
_HIGH = (0.788485616406, -0.418092273222, -0.040689417609, 0.064538882629)


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
    axis = np.zeros((2, 2, 5))  # [band, phase, tap]
    for phase in range(2):
        for tap in range(5):
            n = phase + 2 * (tap - 2)
            axis[0, phase, tap] = _LOW[abs(n)] if abs(n) < 5 else 0
            axis[1, phase, tap] = _HIGH[abs(n - 1)] if abs(n - 1) < 4 else 0
    out = np.zeros((12, 12, 5, 5))
    for colour in range(3):
        planes = [(colour, (0, 0))] + [(3 + 3 * colour + k, way) for k, way in enumerate(BANDS)]
        for plane, (v, h) in planes:
            for y in range(2):
                for x in range(2):
                    out[plane, 4 * colour + 2 * y + x] = np.outer(axis[v, y], axis[h, x])
    return torch.tensor(out, dtype=torch.float32)


def reflected(x: Tensor, reach: int) -> Tensor:
    """Extends planes [B, C, h, w] by `reach` samples on each side, mirrored as often as needed."""
    for dim in (2, 3):
        n = x.shape[dim]
        period = max(2 * n - 2, 1)
        index = torch.arange(-reach, n + reach) % period
        x = x.index_select(dim, torch.where(index < n, index, period - index))
    return x


def _extend(x: Tensor, dim: int, high: int) -> Tensor:
    """Extends a dimension by two samples at each end, symmetrically, as the decoder does.

    Args:
        x: Tensor to extend.
        dim: The dimension.
        high: Whether it is that of a high-pass band, which has another symmetry.
    """
    return x.index_select(dim, torch.from_numpy(mirrored_indices(x.shape[dim], bool(high))))


def extended(low: Tensor, high: Tensor) -> Tensor:
    """Joins planes and bands, extended by two samples on each side, each by its own symmetry.

    Args:
        low: [B, 3, h, w] planes.
        high: [B, 9, h, w] bands.

    Returns:
        [B, 12, h + 4, w + 4]: planes, then the bands ordered by band, then colour.
    """
    parts = [_extend(_extend(low, 3, 0), 2, 0)]
    for band, (v, h) in enumerate(BANDS):
        parts.append(_extend(_extend(high[:, band::3], 3, h), 2, v))
    return torch.cat(parts, 1)
