"""Peak signal-to-noise ratio of two pictures."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .samples import strips


def psnr_8bit(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float | None:
    """PSNR in dB of two 8-bit pictures; None if they are equal.

    Opaque pictures are compared in RGB, others in premultiplied RGBA.

    Args:
        a: uint8 [H, W, 3] or, with straight alpha, [H, W, 4].
        b: Picture of the same height and width, with 3 or 4 channels.
    """
    opaque = all(p.shape[2] == 3 or (p[..., 3] == 255).all() for p in (a, b))
    total, count = 0.0, a[..., 0].size * (3 if opaque else 4)
    for rows in strips(a):
        x, y = (_premultiplied(p[rows], opaque) for p in (a, b))
        total += float(((x - y) ** 2).sum())
    return None if total == 0 else 10 * math.log10(255**2 * count / total)


def _premultiplied(p: NDArray[np.uint8], opaque: bool) -> NDArray[np.float64]:
    colour = p[..., :3].astype(np.float64)
    if opaque:
        return colour
    alpha = p[..., 3:].astype(np.float64) if p.shape[2] == 4 else np.full((*p.shape[:2], 1), 255.0)
    return np.concatenate([colour * alpha / 255, alpha], axis=2)
