"""Maps of a picture by the layers network: what stands out, where its edges are, who is in front.

The network (`models/layers-1.onnx.zst`; `training/layers.py` makes it) sees small copies of the
picture and their mirror images. What stands out is judged in one that shows it as a whole, edges
in a larger one and in its half.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .onnx_model import shipped

Floats = NDArray[np.float32]

MODEL = "layers-1.onnx.zst"

MULTIPLE = 32
"""Sides of what the network sees are multiples of this."""

SMALL, LARGE = 384, 768
"""Longest sides, in pixels, of the copies in which figures and boundaries are sought."""


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of a picture, at its size.

    Attributes:
        figure: float32 [H, W] in 0..1, how much a pixel belongs to what stands out.
        boundary: float32 [H, W] in 0..1, how likely a pixel lies on the edge of an object.
        owner: float32 [H, W, 2], at edges: direction x, y towards the side that is in front; its
            length, about 0..1, is the confidence.
    """

    figure: Floats
    boundary: Floats
    owner: Floats


def find_maps(rgb: NDArray[np.uint8], jobs: int = 1) -> Maps:
    """Runs the layers network on a picture.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        jobs: Threads to use.
    """
    side = min(LARGE, max(rgb.shape[:2]))
    copies = {n: _both_ways(rgb, n, jobs) for n in {min(SMALL, side), side, max(1, side // 2)}}
    # Edges of texture are weaker in the copy of half the size, those of objects are not.
    edges = np.asarray((copies[side] + copies[max(1, side // 2)]) / 2, np.float32)
    owner = np.ascontiguousarray(edges[2:].transpose(1, 2, 0))
    return Maps(copies[min(SMALL, side)][0], edges[1], owner)


def _both_ways(rgb: NDArray[np.uint8], side: int, jobs: int) -> Floats:
    """Mean of the maps of a picture and of its mirror image, float32 [4, H, W]; see `_run`."""
    mirrored = _run(np.ascontiguousarray(rgb[:, ::-1]), side, jobs)[..., ::-1]
    mirrored[2] *= -1
    return np.asarray((_run(rgb, side, jobs) + mirrored) / 2)


def _run(rgb: NDArray[np.uint8], side: int, jobs: int) -> Floats:
    """Maps float32 [4, H, W] from a copy of the picture with a longer side of at most `side`."""
    height, width = rgb.shape[:2]
    scale = min(1.0, side / max(height, width))
    high, wide = max(1, round(height * scale)), max(1, round(width * scale))
    copy = cv2.resize(rgb, (wide, high), interpolation=cv2.INTER_AREA)
    pad = (-high % MULTIPLE, -wide % MULTIPLE)
    copy = cv2.copyMakeBorder(copy, 0, pad[0], 0, pad[1], cv2.BORDER_REPLICATE)
    planes = copy.astype(np.float32).transpose(2, 0, 1)[None] / 255
    found = shipped(MODEL, jobs).run({"rgb": planes})[0][0, :, :high, :wide]
    return np.stack([cv2.resize(plane, (width, height)) for plane in found])
