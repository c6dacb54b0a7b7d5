"""Hint for pictures that lossless formats suit better."""

from __future__ import annotations

import logging
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..model import Picture

FLAT, SPARSE = 0.5, 8
"""Share of pixels that equal those above and on the left in a flat drawing (photographs have at
most a tenth), and distance of the rows that are looked at."""

SIDE_MAX = 16383
"""Largest side of a WebP file."""


def tell_if_unsuited(pixels: NDArray[Any], picture: Picture) -> None:
    """Logs a warning if a flat drawing takes fewer bytes as lossless WebP than as a pyramid.

    Args:
        pixels: The original [H, W, C]; if it is not uint8, nothing is told.
        picture: The picture as it was encoded.
    """
    if pixels.dtype != np.uint8 or max(pixels.shape) > SIDE_MAX or not is_flat(pixels):
        return
    lossless = webp_bytes(pixels)
    lossy = sum(len(planes.packed["data"]) for planes in picture.planes)
    if lossless < lossy:
        logging.getLogger(__name__).warning(
            "lossless WebP takes %d bytes, less than these %d: screenshots and drawings in flat "
            "colours are better kept so, or as PNG, if they need no layers",
            lossless, lossy,
        )  # fmt: skip


def is_flat(pixels: NDArray[Any]) -> bool:
    """Whether a picture [H, W, C] has large areas of one colour each, as drawings have."""
    if min(pixels.shape[:2]) < 2:
        return False
    above, here = pixels[:-1:SPARSE, 1:], pixels[1::SPARSE]
    alike = (here[:, 1:] == above).all(2) & (here[:, 1:] == here[:, :-1]).all(2)
    return bool(alike.mean() >= FLAT)


def webp_bytes(pixels: NDArray[np.uint8]) -> int:
    """Bytes of a picture, uint8 [H, W, C] as `encode` takes it, as a lossless WebP file."""
    channels = {1: [0, 0, 0], 2: [0, 0, 0, 1], 3: [2, 1, 0], 4: [2, 1, 0, 3]}[pixels.shape[2]]
    lossless = [cv2.IMWRITE_WEBP_QUALITY, 101]
    return len(cv2.imencode(".webp", np.ascontiguousarray(pixels[..., channels]), lossless)[1])
