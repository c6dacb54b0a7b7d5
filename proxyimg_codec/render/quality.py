"""Quality of a decoded picture, measured against its original."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..io.psnr import psnr_8bit
from ..io.samples import standard, strips, to_float
from ..model import Pictured
from .pixels import render


def psnr(original: NDArray[Any], image: Pictured) -> float | None:
    """PSNR in dB of the decoded 8-bit picture; None if it equals the original rounded to 8 bits.

    Opaque pictures are compared in RGB. Others are compared in premultiplied RGBA, so that the
    colour of invisible pixels does not count.

    Args:
        original: [H, W] or [H, W, 1..4] samples of the size of the canvas, as `encode` takes them.
        image: The decoded picture.

    Raises:
        InputError: `original` is not a picture.
    """
    given = standard(np.asarray(original))
    eight_bit = np.empty((*given.shape[:2], 4), np.uint8)
    for rows in strips(given):
        eight_bit[rows] = np.rint(to_float(given[rows])[0] * 255)
    return psnr_8bit(eight_bit, render(image))
