"""Masks of everything in a picture, by a model of the SAM family that is asked at a grid of points.

As the automatic generator of `segment_anything` does it: what the model itself is unsure of, what
changes with the threshold, and what was found before is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from ..onnx_model import Floats, Model
from .sam import INSIDE, View, see

Mask = NDArray[np.bool_]

GRID, COARSE_GRID, CROP_GRID = 16, 6, 8
"""Points a side: in the picture; with models that look again for each point; in crops."""

IOU, STABLE, OFFSET = 0.85, 0.9, 1.0
"""Least IoU that the model expects; least stability: the IoU of the masks at thresholds `OFFSET`
above and below zero."""

SAME = 0.7
"""IoU from which on two masks are the same."""

SMALL = 0.002
"""Holes and islands below this share of the picture are removed."""

LARGE, OVERLAP = 2048, 0.2
"""Longer side in pixels from which on crops are looked at too; their overlap, in halves."""

RIM = 3
"""Pixels: masks that end this near to the border of a crop are cut off there, and left out."""


@dataclass(frozen=True, eq=False)
class Found:
    """Mask that was found.

    Attributes:
        mask: bool [h, w], of the size `View.frame` of the picture.
        quality: IoU that the model expects, in about 0..1.
    """

    mask: Mask
    quality: float


def everything(encoder: Model, decoder: Model | None, rgb: NDArray[np.uint8]) -> list[Found]:
    """Finds masks of everything in a picture, the surest first.

    Args:
        encoder: Encoder, or a whole EfficientSAM.
        decoder: Decoder; None for a whole model.
        rgb: uint8 [H, W, 3] picture in sRGB.

    Returns:
        Masks, of which no two are the same; they may lie in each other. Perhaps none.

    Raises:
        InputError: The model does not run.
    """
    view = see(encoder, decoder, rgb)
    grid = GRID if decoder is not None else COARSE_GRID
    found = _at_grid(view, grid)
    height, width = rgb.shape[:2]
    if max(height, width) >= LARGE and decoder is not None:
        for rows, cols in product(_halves(height), _halves(width)):
            part = see(encoder, decoder, np.ascontiguousarray(rgb[rows, cols]))
            for one in _at_grid(part, CROP_GRID):
                placed = _placed(one, rows, cols, view)
                found += [placed] if placed is not None else []
    return _different(found)


def _at_grid(view: View, grid: int) -> list[Found]:
    """Good masks at a grid of points."""
    height, width = view.size
    found = []
    for i, j in product(range(grid), repeat=2):
        point = ((j + 0.5) * width / grid, (i + 0.5) * height / grid)
        for drawn, quality in zip(*view.masks([point], [INSIDE]), strict=True):
            if quality >= IOU and _stability(drawn) >= STABLE:
                mask = cleaned(drawn > 0)
                if mask.any():
                    found.append(Found(mask, float(quality)))
    return _different(found)


def _stability(drawn: Floats) -> float:
    """IoU of the masks at two thresholds; the one lies in the other."""
    return float((drawn > OFFSET).sum() / max(int((drawn > -OFFSET).sum()), 1))


def cleaned(mask: Mask) -> Mask:
    """A mask bool [h, w] without small holes and small islands; its largest part stays."""
    least = max(2, round(SMALL * mask.size))
    result = mask.copy()
    for inside in (False, True):
        count, parts, stats, _ = cv2.connectedComponentsWithStats(
            (result == inside).astype(np.uint8), connectivity=8 if inside else 4
        )
        areas = stats[:, cv2.CC_STAT_AREA].copy()
        areas[0] = 0
        small = areas < least
        small[0] = False
        if inside and count > 1:
            small[int(areas.argmax())] = False
        result[small[parts]] = not inside
    return result


def _different(found: list[Found]) -> list[Found]:
    """Non-maximum suppression: of masks that are the same the surest stays."""
    kept: list[Found] = []
    for one in sorted(found, key=lambda f: -f.quality):
        if all(_iou(one.mask, other.mask) < SAME for other in kept):
            kept.append(one)
    return kept


def _iou(a: Mask, b: Mask) -> float:
    return float((a & b).sum() / max(int((a | b).sum()), 1))


def _halves(length: int) -> list[slice]:
    """Two halves of a length, with an overlap."""
    half = round(length / 2 * (1 + OVERLAP))
    return [slice(0, half), slice(length - half, length)]


def _placed(one: Found, rows: slice, cols: slice, view: View) -> Found | None:
    """Mask of a crop, in the frame of the picture; None if the crop cuts it off."""
    height, width = view.size
    cut = (
        (rows.start > 0 and one.mask[:RIM].any())
        or (rows.stop < height and one.mask[-RIM:].any())
        or (cols.start > 0 and one.mask[:, :RIM].any())
        or (cols.stop < width and one.mask[:, -RIM:].any())
    )
    high, wide = view.frame
    top, left = round(rows.start * high / height), round(cols.start * wide / width)
    bottom, right = round(rows.stop * high / height), round(cols.stop * wide / width)
    small = cv2.resize(one.mask.astype(np.uint8), (right - left, bottom - top),
                       interpolation=cv2.INTER_AREA)  # fmt: skip
    mask = np.zeros((high, wide), np.bool_)
    mask[top:bottom, left:right] = small > 0
    return None if cut or not mask.any() else Found(mask, one.quality)
