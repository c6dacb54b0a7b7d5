"""Scores of layers and regions against what people or composites say: functions without files.

This is a part of `benchmarks.layers`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Labels = NDArray[Any]
Real = NDArray[np.float64]
Point = tuple[int, int]

THINGS, LEAST_THING, FIRST_STUFF = 3, 0.02, 128
"""Things of a picture that are judged, the largest ones; their least share of it; and the first
label that is no thing."""

SAME, PAIRED = 0.9, 0.5
"""IoU from which on a layer is a sprite, and from which on its place in the order is judged."""

CLICKS = 3
"""Clicks that a thing gets."""


def iou(one: Mask, other: Mask) -> float:
    """Intersection over union of two masks, 0 if both are empty."""
    return float((one & other).sum() / max(1, (one | other).sum()))


def things(labels: Labels, most: int | None = THINGS) -> list[Mask]:
    """Largest things (labels 1 .. 127) over 2 % of a picture, by falling area."""
    found = [labels == k for k in np.unique(labels) if 0 < k < FIRST_STUFF]
    large = [m for m in found if m.mean() >= LEAST_THING]
    return sorted(large, key=lambda m: -int(m.sum()))[:most]


def best(masks: Sequence[Mask], wanted: Sequence[Mask]) -> list[float]:
    """Best IoU of any of the masks with each wanted one."""
    return [max((iou(m, w) for m in masks), default=0.0) for w in wanted]


def interval(values: Sequence[float], rounds: int = 10_000) -> tuple[float, float]:
    """Central 95 % of the means of values drawn with replacement (bootstrap, always the same)."""
    drawn = np.random.default_rng(0).integers(len(values), size=(rounds, len(values)))
    low, high = np.percentile(np.asarray(values, np.float64)[drawn].mean(1), (2.5, 97.5))
    return float(low), float(high)


def covering(found: Labels, people: Iterable[Labels]) -> float:
    """Covering of people's segmentations by a segmentation, 0..1 (Arbelaez et al., 2011).

    For each region of a person, the best IoU with a region that was found, weighted by its area;
    then the mean over people.

    Args:
        found: int [H, W] labels.
        people: int [H, W] labels of each person.
    """
    ours = np.unique(found, return_inverse=True)[1].ravel()
    scores = []
    for labels in people:
        theirs = np.unique(labels, return_inverse=True)[1].ravel()
        shape = int(theirs.max()) + 1, int(ours.max()) + 1
        shared = np.bincount(theirs * shape[1] + ours, minlength=shape[0] * shape[1])
        common = shared.reshape(shape).astype(np.float64)
        area = common.sum(1, keepdims=True)
        union = area + common.sum(0) - common
        scores.append(float((area[:, 0] * (common / union).max(1)).sum() / area.sum()))
    return float(np.mean(scores))


class Sprites(NamedTuple):
    """Score of the layers of a composite.

    Attributes:
        best: Best IoU of a layer with the visible part of each sprite that counts.
        ordered: For each overlapping pair whose sprites both have a layer (IoU >= `PAIRED`),
            whether that of the front one is in front; two in one layer are not in order.
        pairs: Overlapping pairs.
    """

    best: list[float]
    ordered: list[bool]
    pairs: int


def sprites(masks: Sequence[Mask], wanted: Sequence[Mask], pairs: Sequence[Point]) -> Sprites:
    """Judges layers by sprites.

    Args:
        masks: Visible parts of the layers, back to front.
        wanted: Visible parts of the sprites that count.
        pairs: Numbers in `wanted` of the sprites of each overlapping pair: rear, front.
    """
    each = np.array([[iou(m, w) for m in masks] for w in wanted]).reshape(len(wanted), len(masks))
    layer, score = each.argmax(1), each.max(1)
    both = [(a, b) for a, b in pairs if min(score[a], score[b]) >= PAIRED]
    return Sprites(score.tolist(), [bool(layer[a] < layer[b]) for a, b in both], len(pairs))


def deepest(mask: Mask) -> Point:
    """Pixel x, y of a mask that is farthest from its outside; the frame is outside."""
    depth = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    y, x = np.unravel_index(int(depth.argmax()), mask.shape)
    return int(x), int(y)


def clicked(thing: Mask, find: Callable[[list[Point], list[Point]], Mask]) -> list[float]:
    """IoU with a thing of what is found by one click, two and so on up to `CLICKS`.

    The first is at the deepest point of the thing, each further one at that of the largest
    connected error: inside where the thing was missed, outside where something else was taken.

    Args:
        thing: bool [H, W], not empty.
        find: Finds a mask from points x, y inside and points outside.
    """
    inside, outside, scores = [deepest(thing)], list[Point](), list[float]()
    while True:
        found = find(inside, outside)
        scores.append(iou(found, thing))
        if len(scores) == CLICKS:
            return scores
        if (found == thing).all():
            return scores + [1.0] * (CLICKS - len(scores))
        missed, wrong = _largest(thing & ~found), _largest(found & ~thing)
        if missed.sum() >= wrong.sum():
            inside.append(deepest(missed))
        else:
            outside.append(deepest(wrong))


def _largest(mask: Mask) -> Mask:
    """Largest connected part of a mask."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if len(stats) == 1:
        return mask
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


def inversions(order: Sequence[int]) -> tuple[int, int]:
    """Pairs of an order of 0, 1, 2, ... that are right, and all pairs."""
    pairs = list(combinations(order, 2))
    return sum(a < b for a, b in pairs), len(pairs)
