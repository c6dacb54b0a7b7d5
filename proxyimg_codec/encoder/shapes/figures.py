"""Default segmenter: what stands out in a picture, object by object, by the layers network.

Basins of the boundary map are merged to regions; those with a high mean on the figure map are
figures. Figures that do not touch are different objects, and one is split only at strong boundaries
where both sides are worth a layer. The rest is the back.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .hierarchy import borders, hierarchy, merged, reduced
from .maps import Maps, find_maps
from .masks import Region, description, unique_names
from .order import back_to_front
from .refine import refined, spread

Floats = NDArray[np.float32]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

FINE = 0.15
"""Strength of boundaries below which basins are one region."""

FIGURE, FAINT = 0.5, 0.3
"""Mean on the figure map from which on a region is a figure; and that if else there were none."""

SPLIT = 0.5
"""Mean strength of a boundary that splits a figure."""

LEAST, SHARE = 0.01, 0.12
"""Least area of an object, as a share of the picture and of the figure that it is split from."""

MOST = 0.92
"""Share of an opaque picture that no figure covers; it would be the ground."""


def segment(
    rgb: NDArray[np.uint8], max_layers: int = 4, support: Mask | None = None
) -> list[Region]:
    """Finds the objects of a picture; deterministic.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        max_layers: Most regions to return, at least 1.
        support: bool [H, W], True for the pixels to segment; None for all of an opaque picture.

    Returns:
        Disjoint regions back to front, whose union is the picture or the support. The rearmost of
        an opaque picture is named `back`, the others by colour and place. It is the only one if
        nothing stands out. The list is empty only if the support is.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    if not whole.any():
        return []
    maps = find_maps(rgb if support is None else _on_plain(rgb, whole))
    labels = objects(maps, max_layers, support)
    return layers(rgb, labels, maps, support)


def _on_plain(rgb: NDArray[np.uint8], support: Mask) -> NDArray[np.uint8]:
    """Picture whose colours outside the support, which are arbitrary, are one light grey."""
    return np.where(support[..., None], rgb, np.uint8(230))


def objects(maps: Maps, max_layers: int, support: Mask | None = None) -> Labels:
    """Finds objects in maps.

    Args:
        maps: Maps of the picture.
        max_layers: Most labels, at least 1.
        support: bool [H, W]; None for all of an opaque picture, whose label 0 is the back.

    Returns:
        int [h, w] labels from 0 of a copy with at most `hierarchy.SIDE` pixels a side; -1 outside
        of the support.
    """
    boundary, figure = reduced(maps.boundary), reduced(maps.figure)
    inside = None if support is None else reduced(support.astype(np.float32)) >= 0.5
    if inside is not None:
        figure = inside.astype(np.float32)
    tree = hierarchy(boundary, inside)
    fine = tree.cut(FINE)
    count = int(fine.max()) + 1
    area = np.bincount(fine.ravel(), minlength=count)
    score = np.bincount(fine.ravel(), figure.ravel(), count) / area
    chosen = score >= FIGURE
    if area[chosen].sum() < LEAST * fine.size:
        chosen = score >= FAINT
    if inside is None and area[chosen].sum() > MOST * fine.size:
        chosen[:] = False
    parts = merged(fine, boundary, chosen.astype(np.intp)).cut(SPLIT)
    return _kept(parts, chosen[fine], boundary, figure, max_layers, inside)


def _kept(
    parts: Labels,
    chosen: Mask,
    boundary: Floats,
    figure: Floats,
    max_layers: int,
    inside: Mask | None,
) -> Labels:
    """Reduces parts of figures to the objects that are worth a layer.

    Args:
        parts: int [h, w], parts of figures and of the ground.
        chosen: bool [h, w], True on figures.
        boundary: float32 [h, w].
        figure: float32 [h, w].
        max_layers: Most labels.
        inside: bool [h, w] support, or None.

    Returns:
        int [h, w], 0 for the back of an opaque picture; -1 outside of the support.
    """
    labels = np.where(chosen if inside is None else inside, parts + 1, 0)
    labels = np.unique(np.append(labels, 0), return_inverse=True)[1][:-1].reshape(parts.shape)
    figures = cv2.connectedComponents((labels > 0).astype(np.uint8), connectivity=4)[1]
    whole = np.bincount(figures.ravel())
    most = max_layers - 1 if inside is None else max_layers
    least = 0 if inside is None else 1  # what is visible belongs to some layer
    while (count := int(labels.max())) > least:
        area = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        weight = np.bincount(labels.ravel(), figure.ravel(), count + 1)[1:]
        of_figure = np.zeros(count + 1, np.intp)
        of_figure[labels] = figures
        small = area < np.maximum(LEAST * labels.size, SHARE * whole[of_figure[1:]])
        rank = weight + small * -1e9
        worst = int(rank.argmin()) + 1
        if not small[worst - 1] and count <= most:
            break
        labels = _without(labels, worst, boundary, keep=inside is not None)
    return labels if inside is None else np.where(inside, labels - 1, -1)


def _without(labels: Labels, worst: int, boundary: Floats, keep: bool) -> Labels:
    """Joins a part to the neighbour across the weakest boundary; to the back if it has none.

    Args:
        labels: int [h, w], parts from 1, 0 elsewhere.
        worst: The part.
        boundary: float32 [h, w].
        keep: Whether a part without neighbours joins the nearest one.
    """
    pairs, lengths, sums = borders(labels, boundary)
    beside = (pairs == worst).any(1) & (pairs > 0).all(1)
    target = 0
    if beside.any():
        best = int(np.where(beside, sums / lengths, np.inf).argmin())
        target = int(pairs[best].sum()) - worst
    elif keep:
        others = spread(np.where((labels > 0) & (labels != worst), labels, -1))
        target = int(np.bincount(others[labels == worst]).argmax())
    joined = np.where(labels == worst, target, labels)
    return joined - (joined > worst)


def layers(
    rgb: NDArray[np.uint8], labels: Labels, maps: Maps, support: Mask | None
) -> list[Region]:
    """Makes regions of labels, with borders that follow the picture, back to front.

    Args:
        rgb: uint8 [H, W, 3] picture.
        labels: int [h, w] labels from 0 of a copy, -1 outside of the support.
        maps: Maps of the picture.
        support: bool [H, W]; None for all of an opaque picture, whose label 0 is the back.
    """
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    full = refined(spread(labels), rgb, whole)
    masks = [whole & (full == i) for i in range(int(labels.max()) + 1)]
    masks = [mask for k, mask in enumerate(masks) if mask.any() or (k == 0 and support is None)]
    first = masks[:1] if support is None else []
    stack = first + back_to_front(masks[len(first) :], maps)
    names = [description(rgb, mask) for mask in stack]
    if support is None:
        names[0] = "back"
    return [Region(n, m) for n, m in zip(unique_names(names), stack, strict=True)]
