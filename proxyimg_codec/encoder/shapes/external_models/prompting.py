"""Regions of what a user points at, by a model of the SAM family."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ....errors import InputError
from ..masks import Region
from ..prompts import Point, Prompt
from .catalogue import SAM
from .everything import cleaned
from .locate import load_pair, locate
from .sam import CORNER, INSIDE, OTHER_CORNER, OUTSIDE, View, see

Mask = NDArray[np.bool_]

STROKE_POINTS = 4
"""Most points that stand for strokes, or for a mask that is to be improved."""


def prompted(
    rgb: NDArray[np.uint8], prompts: Sequence[Prompt], model: str = SAM, jobs: int = 1
) -> list[Region]:
    """Regions of prompts, the plug-in `sam` of the kind `prompters`.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        prompts: Prompts that were checked against the picture.
        model: Model of the SAM family as `locate` finds it; by default the first that is here.
        jobs: Threads to use.

    Returns:
        A region for each prompt, in their order; they may overlap.

    Raises:
        InputError: There is no such model, it does not run, or finds nothing at a prompt.
    """
    encoder, decoder = load_pair(locate(model), jobs)
    view = see(encoder, decoder, rgb)
    return [Region(p.name, _mask(view, p)) for p in prompts]


def _mask(view: View, prompt: Prompt) -> Mask:
    """Mask bool [H, W] of a prompt."""
    inside = [*prompt.inside, *_deepest(prompt.strokes), *_deepest(prompt.mask)]
    points = [*inside, *prompt.outside]
    labels = [INSIDE] * len(inside) + [OUTSIDE] * len(prompt.outside)
    box = _box(prompt)
    if box is not None:
        x, y, wide, high = box
        points += [(x, y), (x + wide, y + high)]
        labels += [CORNER, OTHER_CORNER]
    drawn, quality = view.masks(points, labels)
    height, width = view.size
    best: Mask | None = None
    highest = -np.inf
    for one, expected in zip(drawn, quality, strict=True):
        mask = cleaned(cv2.resize(one, (width, height)) > 0)
        right = [mask[_pixel(p, mask)] for p in inside]
        right += [not mask[_pixel(p, mask)] for p in prompt.outside]
        # What was said outweighs what the model expects.
        score = float(expected) + 2 * float(np.mean(right or [True]))
        if mask.any() and score > highest:
            best, highest = mask, score
    if best is None:
        raise InputError(
            f'"{prompt.name}": the model {view.encoder.name} finds nothing there; add a point, '
            "or draw a box"
        )
    return best


def _box(prompt: Prompt) -> tuple[float, float, float, float] | None:
    """Box of a prompt, else that of the mask that is to be improved: x, y, width, height."""
    if prompt.box is None and prompt.mask is not None:
        x, y, wide, high = cv2.boundingRect(prompt.mask.astype(np.uint8))
        return float(x), float(y), float(wide), float(high)
    return prompt.box


def _deepest(mask: Mask | None) -> list[Point]:
    """Some points x, y deep inside a mask bool [H, W], each away from those before."""
    points: list[Point] = []
    if mask is None:
        return points
    left = np.pad(mask.astype(np.uint8), 1)
    for _ in range(STROKE_POINTS):
        depth = cv2.distanceTransform(left, cv2.DIST_L2, 5)
        y, x = (int(v) for v in np.unravel_index(int(depth.argmax()), depth.shape))
        reach = float(depth[y, x])
        if reach <= 0 or (points and reach < 1.5):
            break
        points.append((x - 0.5, y - 0.5))
        cv2.circle(left, (x, y), round(2 * reach) + 1, 0, -1)
    return points


def _pixel(point: Point, mask: Mask) -> tuple[int, int]:
    """Row and column of the pixel of a mask that a point lies in."""
    y, x = (min(max(int(v), 0), n - 1) for v, n in zip(point[::-1], mask.shape, strict=True))
    return y, x
