"""Sheet of regions that are not encoded yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..export.sheet import Tile, draw_sheet, outline_bytes, reduction
from ..io.samples import to_float
from .settings import Settings
from .shapes.layers import plan_layers
from .shapes.masks import Region


def region_sheet(
    pixels: NDArray[Any], regions: Sequence[Region], settings: Settings
) -> NDArray[np.uint8]:
    """Draws the picture with its regions marked, then each by itself; see `export.sheet`.

    Args:
        pixels: The picture, as `encode.encode` takes it.
        regions: Regions back to front, disjoint, as `shapes.find.find_layers` gives them.
        settings: Settings of the encoder; they decide what outlines cost.
    """
    picture = to_float(np.asarray(pixels))[0]
    height, width = picture.shape[:2]
    scale = reduction(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    # A reduced pixel has the colour of what is visible in it.
    alpha = _reduced(picture[..., 3], size)
    colour = _reduced(picture[..., :3] * picture[..., 3:], size)
    colour /= np.maximum(alpha, 1e-6)[..., None]
    planned = {
        layer.name: layer.boundary for layer in plan_layers(picture, settings, regions).layers
    }
    tiles = [
        Tile(region.name, _bytes(colour, alpha * _reduced(region.mask.astype(np.float32), size)),
             outline_bytes(planned[region.name]))
        for region in regions
    ]  # fmt: skip
    whole = _bytes(colour, alpha)
    return draw_sheet(whole if (alpha < 1).any() else whole[..., :3], tiles)


def _reduced(plane: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)


def _bytes(colour: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.uint8]:
    planes = np.dstack([colour, alpha])
    return np.asarray(np.rint(np.clip(planes, 0, 1) * 255), np.uint8)
