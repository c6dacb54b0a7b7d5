"""How close a decoded picture is to its original."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..image import Image


def psnr(original: NDArray[Any], image: Image) -> float | None:
    """PSNR in dB of the decoded 8-bit picture, or None if it is exact.

    Opaque pictures are compared in RGB; others in premultiplied RGBA, so that the colour of
    invisible pixels does not count.
    """
    from ..encoder.encode import to_float

    return psnr_8bit(_eight_bit(to_float(original)[0]), image.render())


def _eight_bit(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.rint(picture * 255).astype(np.uint8)


def psnr_8bit(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float | None:
    """PSNR in dB between 8-bit pictures [H, W, 3 or 4] with straight alpha; None if equal."""
    opaque = all(p.shape[2] == 3 or (p[..., 3] == 255).all() for p in (a, b))
    x, y = _premultiplied(a, opaque), _premultiplied(b, opaque)
    error = float(((x - y) ** 2).mean())
    return None if error == 0 else 10 * math.log10(255**2 / error)


def _premultiplied(p: NDArray[np.uint8], opaque: bool) -> NDArray[np.float64]:
    colour = p[..., :3].astype(np.float64)
    if opaque:
        return colour
    alpha = p[..., 3:].astype(np.float64) if p.shape[2] == 4 else np.full((*p.shape[:2], 1), 255.0)
    return np.concatenate([colour * alpha / 255, alpha], axis=2)
