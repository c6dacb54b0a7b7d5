"""The CDF 9/7 wavelet as convolutions over 2 x 2 cells, where the learned transform starts."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

BANDS = ((0, 1), (1, 0), (1, 1))
"""(vertical, horizontal): 1 = high pass. Latents of a level are channels 3 * colour + band."""

# Cohen, Daubechies, Feauveau 1992; Antonini et al. 1992, table II, orthonormal scaling.
_LOW_ANALYSIS = (0.852698679009, 0.377402855613, -0.110624404418, -0.023849465020, 0.037828455507)
_LOW_SYNTHESIS = (0.788485616406, 0.418092273222, -0.040689417609, -0.064538882629)


def _taps(half: tuple[float, ...], alternate: bool = False) -> dict[int, float]:
    reach = len(half) - 1
    return {n: (-1 if alternate and n % 2 else 1) * half[abs(n)] for n in range(-reach, reach + 1)}


def _polyphase(low: dict[int, float], high: dict[int, float], sign: int) -> np.ndarray:
    """[band, phase, tap] of 5 taps over cells."""
    w = np.zeros((2, 2, 5))
    for phase in range(2):
        for tap in range(5):
            n = sign * (2 * (tap - 2)) + phase
            w[0, phase, tap] = low.get(n, 0.0)
            w[1, phase, tap] = high.get(n - 1, 0.0)
    return w


def _outer(w: np.ndarray) -> np.ndarray:
    """[12 cell channels (colour, y, x), 12 band channels (band, colour), 5, 5]."""
    out = np.zeros((12, 12, 5, 5))
    for colour in range(3):
        for y in range(2):
            for x in range(2):
                cell = colour * 4 + y * 2 + x
                out[cell, colour] = np.outer(w[0, y], w[0, x])
                for band, (v, h) in enumerate(BANDS):
                    out[cell, 3 + band * 3 + colour] = np.outer(w[v, y], w[h, x])
    return out


def synthesis_weights() -> Tensor:
    """Float32 [12 cells, 12 bands, 5, 5]."""
    w = _polyphase(_taps(_LOW_SYNTHESIS), _taps(_LOW_ANALYSIS, alternate=True), -1)
    return torch.tensor(_outer(w), dtype=torch.float32)


def analysis_weights() -> Tensor:
    """Float32 [12 outputs: 3 low, 9 latents (colour, band); 12 cells, 5, 5]."""
    w = _outer(_polyphase(_taps(_LOW_ANALYSIS), _taps(_LOW_SYNTHESIS, alternate=True), 1))
    order = [0, 1, 2] + [3 + band * 3 + colour for colour in range(3) for band in range(3)]
    return torch.tensor(w.transpose(1, 0, 2, 3)[order].copy(), dtype=torch.float32)


def reflected(x: Tensor, reach: int) -> Tensor:
    """Planes with `reach` more samples on each side, mirrored as often as needed."""
    for dim in (2, 3):
        n = x.shape[dim]
        period = max(2 * n - 2, 1)
        index = torch.arange(-reach, n + reach) % period
        x = x.index_select(dim, torch.where(index < n, index, period - index))
    return x


def _extend(x: Tensor, dim: int, high: int) -> Tensor:
    """Two samples of symmetric extension: about a sample, or between samples, as the wavelet's."""
    n = x.shape[dim]

    # Planes of one or two samples repeat what they have.
    def rows(*wanted: int) -> Tensor:
        index = torch.tensor([min(max(i, 0), n - 1) for i in wanted])
        return x.index_select(dim, index)

    if high:
        return torch.cat([rows(1, 0), x, rows(n - 2, n - 3)], dim)
    return torch.cat([rows(2, 1), x, rows(n - 1, n - 2)], dim)


def extended(low: Tensor, high: Tensor) -> Tensor:
    """Planes [B, 3 + 9, h + 4, w + 4], each band by its own symmetry."""
    parts = [_extend(_extend(low, 3, 0), 2, 0)]
    for band, (v, h) in enumerate(BANDS):
        parts.append(_extend(_extend(high[:, band::3], 3, h), 2, v))
    return torch.cat(parts, 1)
