"""Layers from a map of what stands out: its parts are objects, whatever they are."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .basins import merged_basins
from .masks import Region, description, nearness, unique_names
from .refine import refined, spread

Floats = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

SIDE = 480
"""Longer side in pixels of the copy in which parts are sought."""

SEEN = 0.3
"""Figure score from which on a pixel belongs to what stands out."""

NECK = 0.01
"""Radius, relative to the longer side, of the disc that a bridge between two parts must hold;
thinner ones are cut."""

CORE, LEAST = 0.003, 0.01
"""Least share of the picture: of a part without its rim of `NECK`, and of a part."""

GROUND_EDGE, GROUND_LEAST = 0.16, 0.03
"""Mean strength of the boundary by which a region of the ground is a layer, and its least share."""


def regions_of_figure(
    rgb: NDArray[np.uint8],
    figure: Floats,
    max_layers: int,
    support: Mask | None = None,
    boundary: Floats | None = None,
) -> list[Region]:
    """Layers of a picture from its figure map.

    Parts that do not touch, or touch by a thin bridge only, are different objects; small ones
    join a part that they touch, or are left to the back. If fewer were found than there may be,
    the largest regions with strong boundaries are added, in whatever is left.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        figure: float32 [H, W] in 0..1, how much a pixel belongs to what stands out.
        max_layers: Most regions to return, at least 1.
        support: bool [H, W], True for the pixels to segment; None for all of an opaque picture.
        boundary: float32 [H, W] in 0..1, how likely a pixel lies on the edge of an object; None
            adds no regions of the ground.

    Returns:
        Disjoint regions back to front, whose union is the picture or the support. The first of an
        opaque picture is the `back`. A single one if nothing stands out.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    if not whole.any():
        return []
    scale = min(1.0, SIDE / max(rgb.shape[:2]))
    size = max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale))
    visible = np.where(whole, figure, 0).astype(np.float32)
    small = np.asarray(cv2.resize(visible, size, interpolation=cv2.INTER_AREA), np.float32)
    inside = cv2.resize(whole.astype(np.float32), size, interpolation=cv2.INTER_AREA) >= 0.5
    labels = np.where(inside, _parts(small, max_layers - 1), 0)
    if boundary is not None and labels.max() < max_layers - 1:
        edges = cv2.resize(boundary, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        _add_ground(labels, edges, inside, max_layers - 1)
    return regions_of_labels(rgb, labels, figure, support)


def regions_of_labels(
    rgb: NDArray[np.uint8], labels: Labels, figure: Floats | None, support: Mask | None
) -> list[Region]:
    """Layers of a picture from labels in a smaller copy of it, with borders that follow its edges.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        labels: int [h, w], 0 for the back, objects from 1 on.
        figure: float32 [H, W] figure map in 0..1, for the order; None if nobody knows.
        support: bool [H, W], not empty, True for the pixels to segment; None for all.

    Returns:
        Disjoint regions back to front, as `regions_of_figure`.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    full = refined(labels, rgb, whole)
    masks = [m for m in (whole & (full == i) for i in range(int(labels.max()) + 1)) if m.any()]
    # Without pixels of label 0 the first object takes the place of the back.
    back, objects = masks[0], masks[1:]
    objects.sort(key=lambda m: nearness(m, 1.0 if figure is None else float(figure[m].mean())))
    first = "back" if support is None else description(rgb, back)
    names = unique_names([first, *(description(rgb, m) for m in objects)])
    return [Region(n, m) for n, m in zip(names, [back, *objects], strict=True)]


def _parts(figure: Floats, most: int) -> Labels:
    """Largest parts of a figure map float32 [h, w], int [h, w] from 1 on; 0 is the rest."""
    seen = (figure >= SEEN).astype(np.uint8)
    radius = max(1, round(NECK * max(figure.shape)))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    # Outside of the picture counts as seen, so that its frame cuts nothing.
    _, cores, stats, _ = cv2.connectedComponentsWithStats(cv2.erode(seen, disc))
    large = stats[:, cv2.CC_STAT_AREA] >= CORE * figure.size
    large[0] = False
    cores[~large[cores]] = 0
    _, whole = cv2.connectedComponents(seen)
    result = np.zeros(figure.shape, np.intp)
    if not large.any():  # slender things alone
        nearest = whole
    else:
        nearest = np.where(seen > 0, spread(np.where(cores == 0, -1, cores)), 0)
        # A piece that touches no core is small, and left to the back.
        held = np.zeros(int(whole.max()) + 1, np.bool_)
        held[np.unique(whole[cores > 0])] = True
        nearest[~held[whole]] = 0
    areas = np.bincount(nearest.ravel())
    areas[0] = 0
    order = sorted(np.flatnonzero(areas >= LEAST * figure.size), key=lambda i: (-areas[i], i))
    for number, i in enumerate(order[:most], 1):
        result[nearest == i] = number
    return result


def _add_ground(labels: Labels, edges: Floats, inside: Mask, most: int) -> None:
    """Labels the largest regions of the ground; its largest one of all stays the back."""
    ground = inside & (labels == 0)
    if not ground.any():
        return
    regions = merged_basins(edges, ground, GROUND_EDGE)
    areas = np.bincount(regions[ground])
    order = sorted(range(len(areas)), key=lambda i: (-areas[i], i))
    number = int(labels.max())
    for i in order[1 : 1 + most - number]:
        if areas[i] >= GROUND_LEAST * inside.sum():
            number += 1
            labels[ground & (regions == i)] = number
