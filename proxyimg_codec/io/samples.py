"""Conversion of sample arrays of any accepted type to one form."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Floats = NDArray[np.float32]


def to_float(pixels: NDArray[Any]) -> tuple[Floats, int]:
    """Converts a picture to floating-point RGBA.

    Args:
        pixels: [H, W] grey, or [H, W, C] with C = 1 for grey, 2 for grey and alpha, 3 for RGB, 4
            for RGB and alpha; alpha is straight; uint8, uint16, or floating point in 0..1.

    Returns:
        float32 [H, W, 4] with straight alpha in 0..1, and the depth in bits: 8 for uint8, else 16.

    Raises:
        InputError: The array has a wrong shape or type, is empty, not finite, or outside 0..1.
    """
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or pixels.size == 0:
        raise InputError(
            f"a picture must be [H, W] or [H, W, 1..4] and not empty, not {pixels.shape}"
        )
    if pixels.dtype in (np.uint8, np.uint16):
        depth = 8 * pixels.dtype.itemsize
        values = pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)
    elif pixels.dtype.kind == "f":
        depth, values = 16, pixels.astype(np.float32)
        if not np.isfinite(values).all():
            raise InputError("the picture has NaN or infinite samples; replace them first")
        if values.min() < 0 or values.max() > 1:
            raise InputError("floating-point samples must lie in 0..1; scale or clip them first")
    else:
        raise InputError(
            f"samples of type {pixels.dtype} are not supported; use uint8, uint16 or float"
        )
    channels = values.shape[2]
    out = np.ones((*values.shape[:2], 4), np.float32)
    out[..., :3] = values[..., :3] if channels > 2 else values[..., :1]
    if channels in (2, 4):
        out[..., 3] = values[..., -1]
    return out, depth
