"""How close a decoded picture is to its original."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..io.psnr import psnr_8bit
from ..io.samples import to_float
from ..model import Pictured
from .pixels import render


def psnr(original: NDArray[Any], image: Pictured) -> float | None:
    """PSNR in dB of the decoded 8-bit picture, or None if it is exact.

    Opaque pictures are compared in RGB; others in premultiplied RGBA, so that the colour of
    invisible pixels does not count.

    Args:
        original: [H, W] or [H, W, 1..4] samples, as `encode` takes them.
        image: The picture.
    """
    eight_bit = np.rint(to_float(original)[0] * 255).astype(np.uint8)
    return psnr_8bit(eight_bit, render(image))
