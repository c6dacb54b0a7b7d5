"""Views: region and output size of a rendering, and the samples that each pixel averages."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError, UsageError

SIDE_MAX = 1 << 21
"""Most output columns or rows, so that fixed-point coordinates fit in 64 bits."""

SUPERSAMPLING_MAX = 64
"""Most samples of an output pixel along an axis: bounds the cost of a thumbnail."""


@dataclass(frozen=True)
class View:
    """Region of the canvas, and the size of the output that it is rendered to.

    Attributes:
        x: Left edge of the region in canvas pixels.
        y: Top edge of the region in canvas pixels.
        region_width: Width of the region in canvas pixels.
        region_height: Height of the region in canvas pixels.
        width: Output columns.
        height: Output rows.
    """

    x: int
    y: int
    region_width: int
    region_height: int
    width: int
    height: int

    @property
    def supersampling(self) -> tuple[int, int]:
        """Samples of an output pixel across and down: one per canvas pixel it spans, at most 64."""
        across = -(-self.region_width // self.width)
        down = -(-self.region_height // self.height)
        return min(across, SUPERSAMPLING_MAX), min(down, SUPERSAMPLING_MAX)

    @property
    def grid(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Canvas point [2] of the corner of the sample grid, and samples per canvas pixel [2]."""
        sx, sy = self.supersampling
        pitch = [self.width * sx / self.region_width, self.height * sy / self.region_height]
        return np.array([self.x, self.y], np.float64), np.array(pitch)

    def columns(self, start: int, stop: int) -> NDArray[np.float64]:
        """Canvas x, float64 [stop - start], of the centres of sample columns start..stop - 1."""
        n = self.width * self.supersampling[0]
        return _centres(self.x, start, stop, self.region_width / n)

    def rows(self, start: int, stop: int) -> NDArray[np.float64]:
        """Canvas y, float64 [stop - start], of the centres of sample rows start..stop - 1."""
        n = self.height * self.supersampling[1]
        return _centres(self.y, start, stop, self.region_height / n)


def _centres(origin: int, start: int, stop: int, pitch: float) -> NDArray[np.float64]:
    return np.arange(start + 0.5, stop, dtype=np.float64) * pitch + origin


def make_view(
    canvas: tuple[int, int],
    width: int | None = None,
    height: int | None = None,
    scale: float | None = None,
    region: tuple[int, int, int, int] | None = None,
) -> View:
    """Makes the view of a request.

    Args:
        canvas: Width and height of the canvas in pixels.
        width: Output columns; without `height`, the aspect ratio is kept.
        height: Output rows; without `width`, the aspect ratio is kept.
        scale: Output pixels per canvas pixel, instead of `width` and `height`; with none of the
            three it is 1.
        region: x, y, width, height in canvas pixels; the whole canvas by default.

    Raises:
        UsageError: The request is contradictory, empty or not finite, or the region leaves the
            canvas.
        LimitError: The output would have more than `SIDE_MAX` columns or rows.
    """
    try:
        x, y, w, h = map(operator.index, (0, 0, *canvas) if region is None else region)
        width, height = _whole(width), _whole(height)
    except (TypeError, ValueError):
        raise UsageError(
            "width, height and the four numbers of a region must be integers"
        ) from None
    if w < 1 or h < 1 or x < 0 or y < 0 or x + w > canvas[0] or y + h > canvas[1]:
        raise UsageError(
            f"region {x},{y},{w},{h} is empty or leaves the canvas of {canvas[0]}x{canvas[1]}"
        )
    if scale is None:
        width, height = _completed(width, height, (w, h))
    elif width is not None or height is not None:
        raise UsageError("give either a scale or a width and height")
    else:
        width, height = _scaled(scale, (w, h))
    if width < 1 or height < 1:
        raise UsageError(f"output size {width}x{height} is empty")
    if max(width, height) > SIDE_MAX:
        raise LimitError(f"the output would have more than {SIDE_MAX} pixels a side")
    return View(x, y, w, h, width, height)


def _whole(number: int | None) -> int | None:
    return None if number is None else operator.index(number)


def _scaled(scale: float, region: tuple[int, int]) -> tuple[int, int]:
    """Output columns and rows of a region of this width and height, at least 1 each."""
    try:
        good = math.isfinite(scale) and scale > 0
    except (TypeError, OverflowError):
        good = False
    if not good:
        raise UsageError(f"scale {scale!r} is not a positive number")
    if scale * max(region) > SIDE_MAX:
        raise LimitError(f"scale {scale:g} makes a picture of more than {SIDE_MAX} pixels a side")
    width, height = (max(round(n * scale), 1) for n in region)
    return width, height


def _completed(width: int | None, height: int | None, region: tuple[int, int]) -> tuple[int, int]:
    """Output columns and rows, of which at most one follows from the other and the region's."""
    w, h = region
    if height is None:
        return region if width is None else (width, max(round(Fraction(h * width, w)), 1))
    if width is None:
        return max(round(Fraction(w * height, h)), 1), height
    return width, height
