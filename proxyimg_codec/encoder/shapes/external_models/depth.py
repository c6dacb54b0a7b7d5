"""Maps of nearness by models of relative depth, and what they say about the order of masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..amodal import extended_beneath
from ..masks import Region, visible
from ..onnx_model import Floats, Model
from .kinds import Kind, check_kind
from .pixels import IMAGENET_MEAN, IMAGENET_STD, planes

Mask = NDArray[np.bool_]

SIDE, MULTIPLE, LONGEST = 518, 14, 1554
"""Shorter side of what a model sees that leaves it free, the number that sides are multiples of
(patches of the transformer), and the most that the longer side may have, in pixels."""

BAND = 0.02
"""Width of the bands along a shared border that are compared, relative to the longer side."""

OWN = 0.01
"""Weight of a mask's own median beside what is seen where masks touch."""


def depth_map(model: Model, rgb: NDArray[np.uint8]) -> Floats:
    """Map of nearness of a picture.

    Args:
        model: Model with the interface of Depth Anything or MiDaS.
        rgb: uint8 [H, W, 3] picture in sRGB.

    Returns:
        float32 [H, W], inverse depth up to scale and shift: larger is nearer.

    Raises:
        InputError: The model has another interface.
    """
    check_kind(model, (Kind.DEPTH,), "a map of depth")
    height, width = rgb.shape[:2]
    fixed = model.inputs[0].shape[2:4]
    high, wide = _size(height, width)
    high, wide = fixed[0] or high, fixed[1] or wide
    shrinks = high * wide < height * width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    scaled = cv2.resize(rgb, (wide, high), interpolation=method).astype(np.float32) / 255
    picture = planes(scaled, IMAGENET_MEAN, IMAGENET_STD)
    found = model.run({model.inputs[0].name: picture}, [model.outputs[0].name])[0]
    near = np.asarray(found, np.float32).reshape(found.shape[-2:])
    return np.asarray(cv2.resize(near, (width, height)), np.float32)


def _size(height: int, width: int) -> tuple[int, int]:
    """Height and width of what a model sees that leaves them free."""
    scale = min(SIDE / min(height, width), LONGEST / max(height, width))
    high, wide = (max(1, round(v * scale / MULTIPLE)) * MULTIPLE for v in (height, width))
    return high, wide


def ordered_by_depth(regions: Sequence[Region], depth: Floats, opaque: bool) -> list[Region]:
    """Regions in the order of their depth, back to front.

    Args:
        regions: The regions, with masks bool [H, W].
        depth: float32 [H, W], larger is nearer.
        opaque: Whether the first region is the back of an opaque picture, which stays there. Then
            the others may go on beneath those that they are behind of (`amodal`).
    """
    masks = visible(regions)
    near = nearness_by_depth(depth, masks)
    order = sorted(range(len(regions)), key=lambda i: (not (opaque and i == 0), near[i]))
    masks = [masks[i] for i in order]
    if opaque:
        masks = extended_beneath(masks, range(len(masks)))
    return [replace(regions[i], mask=mask) for i, mask in zip(order, masks, strict=True)]


def nearness_by_depth(depth: Floats, masks: Sequence[Mask]) -> list[float]:
    """Nearness of disjoint masks; only the order of the values has a meaning.

    Two masks are compared where they touch: a lawn reaches nearer to the viewer than the dog on
    it, but behind the dog's outline it is farther. Values are fitted to these differences by
    least squares; medians of the masks decide between those that touch nothing.

    Args:
        depth: float32 [H, W], larger is nearer.
        masks: bool [H, W] each, disjoint, not empty.
    """
    count = len(masks)
    radius = max(2, round(BAND * max(depth.shape)))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    around = [cv2.dilate(m.astype(np.uint8), kernel) > 0 for m in masks]
    medians = np.array([float(np.median(depth[m])) for m in masks])
    scale = max(float(np.ptp(depth)), 1e-9)
    matrix, right = OWN * np.eye(count), OWN * medians
    for i in range(count):
        for j in range(i):
            mine, other = masks[i] & around[j], masks[j] & around[i]
            if not (mine.any() and other.any()):
                continue
            weight = min(int(mine.sum()), int(other.sum())) / (radius * max(depth.shape))
            gap = float(np.median(depth[mine]) - np.median(depth[other]))
            # What is near by a little is as much in front as what is near by far.
            gap = scale * float(np.tanh(10 * gap / scale))
            matrix[[i, j], [i, j]] += weight
            matrix[[i, j], [j, i]] -= weight
            right[[i, j]] += (weight * gap, -weight * gap)
    return [float(v) for v in np.linalg.solve(matrix, right)]
