"""Default segmenter: the objects of a picture, by the maps of the layers network.

Basins of the boundary map merge to a hierarchy, in which those of unlike figure scores stay apart
longest. Each of its regions might be an object. How good a one it is, tell: whether its basins are
likely parts of the same object (`pointing_scene`), whether it stands out, and how strong the
boundary around it is. The best ones that leave room for each other become layers; the rest is the
back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .amodal import extended_beneath
from .hierarchy import Hierarchy, merged
from .maps import Maps, find_maps
from .masks import Region, description, unique_names
from .order import back_to_front
from .pointing_scene import Scene, scene_of
from .refine import refined, spread

Floats = NDArray[np.float64]
Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

LARGEST = 2048
"""Longest side of an opaque picture in which objects are sought; of larger ones it is a copy. The
network sees less, and memory is bounded."""

SEEDS = 32
"""Basins from which it is asked what belongs to the same object: the largest that stand out."""

GROUND = 0.1
"""What a region that does not stand out at all is worth beside one that does."""

SIZE = 0.2
"""Power of the area of a region in its worth: large objects are worth a little more."""

WORTH = 0.03
"""Least worth of a layer."""

LEAST, MOST = 0.01, 0.92
"""Least and greatest share of the picture of an object."""

FREE = 0.5
"""Least share of an object that better ones leave to it."""


def segment(
    rgb: NDArray[np.uint8], max_layers: int = 4, support: Mask | None = None
) -> list[Region]:
    """Finds the objects of a picture; deterministic.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        max_layers: Most regions to return, at least 1.
        support: bool [H, W], True for the pixels to segment; None for all of an opaque picture.

    Returns:
        Regions back to front, whose union is the picture or the support. Those of an opaque picture
        may go on beneath others (`amodal`); the rearmost one is named `back`, the others by colour
        and place. It is the only one if nothing stands out. The list is empty only if the support
        is.
    """
    side = max(rgb.shape[:2])
    if support is None and side > LARGEST:
        size = tuple(max(1, round(n * LARGEST / side)) for n in rgb.shape[1::-1])
        copy = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        return _enlarged(segment(copy, max_layers), rgb.shape[1::-1])
    whole = np.ones(rgb.shape[:2], np.bool_) if support is None else support
    if not whole.any():
        return []
    # Colours outside the support are arbitrary, and its outline is an edge whatever they are.
    shown = np.where(whole[..., None], rgb, np.uint8(230))
    maps = find_maps(shown)
    rim = cv2.morphologyEx(whole.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    maps.boundary[rim > 0] = 1
    labels = objects(scene_of(shown, maps), max_layers, support)
    return layers(rgb, labels, maps, support)


def _enlarged(regions: list[Region], size: Sequence[int]) -> list[Region]:
    """Regions of an opaque picture of `size` columns and rows, made of those of a smaller copy."""
    masks = [cv2.resize(r.mask.astype(np.float32), size) >= 0.5 for r in regions]
    masks[0] |= ~np.any(masks, axis=0)
    return [replace(r, mask=m) for r, m in zip(regions, masks, strict=True)]


def objects(scene: Scene, max_layers: int, support: Mask | None = None) -> Labels:
    """Finds objects in a scene.

    Args:
        scene: Scene of the picture.
        max_layers: Most labels, at least 1.
        support: bool [H, W]; None for all of an opaque picture, whose label 0 is the back.

    Returns:
        int [h, w] labels from 0, of the copy that the scene is; -1 outside of the support.
    """
    held = np.ones(len(scene.area), np.bool_)
    figure = scene.figure
    if support is not None:
        size = scene.labels.shape[::-1]
        small = cv2.resize(support.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        share = np.bincount(scene.labels.ravel(), small.ravel()) / scene.area
        held = share >= min(0.5, float(share.max()))
        figure = held.astype(np.float64)
    regions = _regions(scene, figure, held)
    worth = _worth(scene, figure, regions, held)
    most = max_layers - 1 if support is None else max_layers
    chosen = _chosen(scene, regions, worth, most, with_back=support is None)
    first = 1 if support is None else 0
    of_basin = np.full(len(scene.area), first - 1)
    for number, region in enumerate(chosen, first):
        of_basin[region] = number
    labels = of_basin[scene.labels]
    if support is not None:
        labels = spread(labels) if chosen else np.zeros_like(labels)
        labels[~held[scene.labels]] = -1
    return np.unique(labels, return_inverse=True)[1].reshape(labels.shape) + int(labels.min())


def _regions(scene: Scene, figure: Floats, held: Mask) -> Mask:
    """Regions that might be objects, bool [R, N]: the basins of each."""
    look = figure[scene.labels].astype(np.float32)[..., None]
    tree: Hierarchy = merged(scene.labels, scene.boundary, held.astype(np.intp), look)
    count = tree.count
    regions = np.zeros((count + len(tree.merges), count), np.bool_)
    regions[:count] = np.eye(count, dtype=np.bool_)
    for k, (a, b) in enumerate(tree.merges):
        regions[count + k] = regions[a] | regions[b]
    area = regions @ scene.area / scene.area[held].sum()
    most = MOST if held.all() else 1.0
    return np.asarray(regions[(area >= LEAST) & (area <= most) & (regions @ held)])


def _worth(scene: Scene, figure: Floats, regions: Mask, held: Mask) -> Floats:
    """Worth of regions as objects, float64 [R].

    Args:
        scene: The scene.
        figure: float64 [N], how much basins stand out.
        regions: bool [R, N].
        held: bool [N], basins of the support.
    """
    weight = np.where(held, scene.area * (figure + GROUND / 2), 0)
    seeds = np.argsort(-weight, kind="stable")[: min(SEEDS, int((weight > 0).sum()))]
    alike = np.stack([scene.likeness(*scene.middle(int(s))) for s in seeds])
    area = scene.area / scene.area.sum()
    # Likely parts by all seeds that a region holds, the larger ones counting more.
    share = regions[:, seeds] * area[seeds]
    total = share.sum(1, keepdims=True)
    likely = share @ alike / np.maximum(total, 1e-12)
    size = regions @ area
    inside = (likely * regions) @ area
    match = inside / (size + likely @ area - inside)
    standing = regions @ (area * figure) / size
    strength = np.where(scene.shared > 0, scene.strength, 0)
    length = ((regions @ scene.shared) * ~regions).sum(1)
    edge = ((regions @ (scene.shared * strength)) * ~regions).sum(1) / np.maximum(length, 1)
    # A part of a figure has more of it beside itself.
    beside = ((regions @ (scene.shared * figure)) * ~regions).sum(1) / np.maximum(length, 1)
    contrast = (standing + GROUND) * (1 + GROUND - beside)
    worth = match * contrast * edge * size**SIZE
    return np.asarray(np.where(total[:, 0] > 0, worth, 0))


def _chosen(scene: Scene, regions: Mask, worth: Floats, most: int, with_back: bool) -> list[Mask]:
    """Best regions, bool [N] each, without what better ones hold.

    Args:
        scene: The scene.
        regions: bool [R, N].
        worth: float64 [R].
        most: Most regions.
        with_back: Whether something has to be left for the back.
    """
    taken = np.zeros(len(scene.area), np.bool_)
    chosen = list[Mask]()
    least = LEAST * scene.area.sum()
    for i in np.argsort(-worth, kind="stable"):
        if len(chosen) >= most or worth[i] < WORTH:
            break
        free = regions[i] & ~taken
        area = float(scene.area[free].sum())
        if with_back and scene.area[~(taken | free)].sum() < least:
            continue
        if area >= max(least, FREE * float(scene.area[regions[i]].sum())):
            taken |= free
            chosen.append(free)
    return chosen


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
    first = masks[:1] if support is None and masks[0].any() else []
    stack = first + back_to_front([m for m in masks[len(first) :] if m.any()], maps)
    names = [description(rgb, mask) for mask in stack]
    if support is None:
        names[0] = "back"
        stack = extended_beneath(stack, [float(maps.figure[mask].mean()) for mask in stack])
    return [Region(n, m) for n, m in zip(unique_names(names), stack, strict=True)]
