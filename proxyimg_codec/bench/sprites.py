"""Sprites: pictures of one thing with transparency around it, which are put on photographs."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.uint8]

SOLID, FILLED, CLEAR = 0.9, (0.25, 0.97), 0.1
"""Least share of a sprite in its largest part, its share of its box, and most share of it that is
translucent: scattered strokes are no object, a full rectangle is a picture, a lens is not seen."""


class Sprite(NamedTuple):
    """A sprite in its place.

    Attributes:
        rgba: uint8 [h, w, 4].
        x: First column.
        y: First row.
    """

    rgba: Pixels
    x: int
    y: int

    def on(self, shape: tuple[int, ...]) -> Pixels:
        """The sprite on a clear canvas, uint8 [H, W, 4]."""
        canvas = np.zeros((*shape[:2], 4), np.uint8)
        height, width = self.rgba.shape[:2]
        canvas[self.y : self.y + height, self.x : self.x + width] = self.rgba
        return canvas


def solid(rgba: Pixels) -> Pixels | None:
    """Crops a sprite uint8 [H, W, 4] to what is inside; None if it is no solid object."""
    inside = rgba[..., 3] >= 128
    if not inside.any():
        return None
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    part = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    areas = cv2.connectedComponentsWithStats(inside.astype(np.uint8))[2][1:, cv2.CC_STAT_AREA]
    filled = float(inside[part].mean())
    translucent = inside & (rgba[..., 3] < 240)
    if areas.max() < SOLID * areas.sum() or not FILLED[0] <= filled <= FILLED[1]:
        return None
    if translucent.sum() > CLEAR * inside.sum():
        return None
    return np.ascontiguousarray(rgba[part])


def scaled(rgba: Pixels, side: float) -> Pixels:
    """Scales a sprite to a longer side of `side` pixels, with premultiplied colours."""
    scale = side / max(rgba.shape[:2])
    size = (max(1, round(rgba.shape[1] * scale)), max(1, round(rgba.shape[0] * scale)))
    picture = Image.fromarray(rgba).convert("RGBa").resize(size, Image.Resampling.LANCZOS)
    return np.asarray(picture.convert("RGBA"))
