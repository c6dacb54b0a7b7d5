"""The CDF 9/7 wavelet as convolutions over 2 x 2 cells, where the learned transform starts."""

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
    """Float32 [12 cells, 12 bands, 5, 5]: the decoder's."""
    return torch.tensor(wavelet(), dtype=torch.float32)


def analysis_weights() -> Tensor:
    """Float32 [12 outputs: 3 low, 9 latents (colour, band); 12 cells, 5, 5]."""
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
    """Planes with `reach` more samples on each side, mirrored as often as needed."""
    for dim in (2, 3):
        n = x.shape[dim]
        period = max(2 * n - 2, 1)
        index = torch.arange(-reach, n + reach) % period
        x = x.index_select(dim, torch.where(index < n, index, period - index))
    return x


def _extend(x: Tensor, dim: int, high: int) -> Tensor:
    """Two samples of symmetric extension at each end, as the decoder's."""
    return x.index_select(dim, torch.from_numpy(mirrored_indices(x.shape[dim], bool(high))))


def extended(low: Tensor, high: Tensor) -> Tensor:
    """Planes [B, 3 + 9, h + 4, w + 4], each band by its own symmetry."""
    parts = [_extend(_extend(low, 3, 0), 2, 0)]
    for band, (v, h) in enumerate(BANDS):
        parts.append(_extend(_extend(high[:, band::3], 3, h), 2, v))
    return torch.cat(parts, 1)
