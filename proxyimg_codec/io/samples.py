"""Conversion of sample arrays of any accepted type to one form."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Floats = NDArray[np.float32]


STRIP = 1 << 18
"""Pixels of a strip, about."""

RULE = "uint8, uint16, uint32 or uint64 (divided by the largest value), bool, or float in 0..1"
"""What samples may be. Integers with a sign are none: nothing says what their white is."""


def standard(pixels: NDArray[Any]) -> NDArray[Any]:
    """Converts a picture to one of the three types that pictures have here.

    Integers without a sign mean their value divided by the largest of their type, 10 or 12 bits in
    a uint16 too; False is 0 and True is 1; floating point means itself.

    Args:
        pixels: [H, W] grey, or [H, W, C] with C = 1 for grey, 2 for grey and alpha, 3 for RGB, 4
            for RGB and alpha; alpha is straight.

    Returns:
        [H, W, C]: uint8 from uint8 and bool, uint16 from uint16, float32 from all else, with values
        beyond 0..1 as they are.

    Raises:
        InputError: The array has a wrong shape or type, or is empty.
    """
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.ndim != 3 or not 1 <= pixels.shape[2] <= 4 or pixels.size == 0:
        raise InputError(
            f"a picture must be [H, W] or [H, W, 1..4] and not empty, not {pixels.shape}"
        )
    if pixels.dtype == np.bool_:
        return pixels.astype(np.uint8) * np.uint8(255)
    if pixels.dtype.kind == "u" and pixels.dtype.itemsize <= 2:
        return pixels.astype(pixels.dtype.newbyteorder("="))
    if pixels.dtype.kind == "u":
        return (pixels / float(np.iinfo(pixels.dtype).max)).astype(np.float32)
    if pixels.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return pixels.astype(np.float32)
    raise InputError(f"samples of type {pixels.dtype} are not supported; use {RULE}")


def strips(picture: NDArray[Any]) -> Iterator[slice]:
    """Yields the rows of a picture [H, W, ...], so few at once that they take little memory."""
    count = max(STRIP // picture.shape[1], 1)
    for top in range(0, len(picture), count):
        yield slice(top, top + count)


def unit(pixels: NDArray[Any]) -> Floats:
    """Returns uint8, uint16 or float32 samples as float32, integers divided by their largest."""
    if pixels.dtype.kind == "f":
        return pixels.astype(np.float32, copy=False)
    return pixels.astype(np.float32) / np.float32(np.iinfo(pixels.dtype).max)


def rounded(values: Floats, dtype: Any) -> NDArray[Any]:
    """Returns float32 samples in 0..1 as uint8 or uint16, rounded, or as they are."""
    if np.dtype(dtype).kind == "f":
        return values
    whole: NDArray[Any] = np.rint(values * np.float32(np.iinfo(dtype).max)).astype(dtype)
    return whole


def to_float(pixels: NDArray[Any]) -> tuple[Floats, int]:
    """Converts a picture to floating-point RGBA.

    Args:
        pixels: As `standard`; floating point in 0..1.

    Returns:
        float32 [H, W, 4] with straight alpha in 0..1, and the depth in bits: 8 for uint8 and bool,
        else 16.

    Raises:
        InputError: The array has a wrong shape or type, is empty, not finite, or outside 0..1.
    """
    pixels = standard(pixels)
    if pixels.dtype.kind == "f":
        _check_range(pixels)
    channels = pixels.shape[2]
    out = np.ones((*pixels.shape[:2], 4), np.float32)
    for rows in strips(out):
        values = unit(pixels[rows])
        out[rows, :, :3] = values[..., :3] if channels > 2 else values[..., :1]
        if channels in (2, 4):
            out[rows, :, 3] = values[..., -1]
    return out, 8 if pixels.dtype == np.uint8 else 16


def _check_range(values: Floats) -> None:
    if not np.isfinite(values).all():
        raise InputError("the picture has NaN or infinite samples; replace them first")
    low, high = float(values.min()), float(values.max())
    if low < 0 or high > 1:
        raise InputError(
            f"samples of {low:.4g} to {high:.4g} do not lie in 0..1; scale them first, or clip "
            "them (pxi-encode --tone clip)"
        )
