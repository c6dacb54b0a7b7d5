"""Segmenters and depth by name: plug-ins, and models of the user."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .... import plugins
from ....errors import InputError, UsageError
from ..figure_parts import regions_of_figure, regions_of_labels
from ..maps import find_maps
from ..masks import Region, check_size
from ..onnx_model import Floats, load
from .depth import depth_map
from .everything import Found, everything
from .figure import figure_map
from .kinds import Kind, kind_of
from .locate import is_path, load_pair, locate

Mask = NDArray[np.bool_]
Segmenter = Callable[[NDArray[np.uint8], int, Mask | None], list[Region]]
Depth = Callable[[NDArray[np.uint8]], Floats]

LEAST, MOST = 0.01, 0.85
"""Least and most share of the picture of a mask that becomes a layer."""

CLEAR = 128
"""Grey that models see where a picture is clear."""

FRAME = 0.5
"""Share of the picture's frame from which on a mask is the back, no object."""

INSIDE = 0.8
"""Share of a mask in another from which on it is a part of it, chosen after whole objects."""

_log = logging.getLogger(__name__)


def find_segmenter(name: str, jobs: int = 1) -> Segmenter:
    """Segmenter of a name.

    Args:
        name: Name of a plug-in of the kind `segmenters`, or a model as `locate` finds it.
        jobs: Threads that a model uses.

    Raises:
        UsageError: There is no such plug-in or model.
        InputError: The model is not here.
    """
    if not is_path(name) and name in plugins.names("segmenters"):
        found: Segmenter = plugins.find("segmenters", name)
        return found
    return partial(_by_model, _paths(name, "segmenters"), jobs)


def find_depth(name: str, jobs: int = 1) -> Depth:
    """Function of a name that makes a map of nearness, float32 [H, W], of a picture.

    Args:
        name: Name of a plug-in of the kind `depth`, or a model as `locate` finds it.
        jobs: Threads that a model uses.

    Raises:
        UsageError: There is no such plug-in or model.
        InputError: The model is not here.
    """
    if not is_path(name) and name in plugins.names("depth"):
        return partial(_checked_depth, plugins.find("depth", name), name)
    paths = _paths(name, "depth")
    if len(paths) != 1:
        raise InputError(f"{name}: a model of depth is one file, not {len(paths)}")
    return lambda rgb: depth_map(load(paths[0], jobs), rgb)


def _paths(name: str, kind: str) -> list[Path]:
    try:
        return locate(name)
    except UsageError as error:
        there = ", ".join(plugins.names(kind)) or "none"
        raise UsageError(f"{kind}: {name!r} is unknown; plug-ins: {there}; {error}") from None


def _checked_depth(depth: Depth, name: str, rgb: NDArray[np.uint8]) -> Floats:
    """Map of a plug-in, if it is one."""
    found = np.asarray(depth(rgb), np.float32)
    if found.ndim != 2 or not np.isfinite(found).all():
        raise InputError(f"the depth of {name} must be one finite number for each pixel")
    check_size(f"the depth of {name}", found, rgb.shape[1], rgb.shape[0])
    return found


def _by_model(
    paths: list[Path],
    jobs: int,
    rgb: NDArray[np.uint8],
    max_layers: int = 4,
    support: Mask | None = None,
) -> list[Region]:
    """Segmenter that a model makes, of saliency or of the SAM family."""
    if support is not None and not support.any():
        return []
    if support is not None:  # colours of what is clear mean nothing
        rgb = np.where(support[..., None], rgb, np.uint8(CLEAR))
    kind = kind_of(load(paths[0], jobs))
    if kind in (Kind.U2NET, Kind.ISNET):
        figure = figure_map(load(paths[0], jobs), rgb)
        boundary = find_maps(rgb, jobs).boundary
        regions = regions_of_figure(rgb, figure, max_layers, support, boundary)
    elif kind in (Kind.DEPTH, Kind.INPAINTING):
        flag = "depth" if kind is Kind.DEPTH else "background"
        raise InputError(f"{paths[0]}: this is a model of {kind.value}, which finds no layers; "
                         f"give it to --{flag}")  # fmt: skip
    else:
        found = everything(*load_pair(paths, jobs), rgb)
        regions = regions_of_masks(rgb, found, max_layers, support)
    if len(regions) == 1 and max_layers > 1:
        _log.warning("%s: no object was found; the picture is one layer", paths[0].name)
    return regions


def regions_of_masks(
    rgb: NDArray[np.uint8], found: list[Found], max_layers: int, support: Mask | None = None
) -> list[Region]:
    """Layers of a picture from many masks that may overlap: a handful of the whole objects.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        found: Masks, all of one size, that of the picture or smaller.
        max_layers: Most regions to return, at least 1.
        support: bool [H, W], not empty, True for the pixels to segment; None for all.

    Returns:
        Disjoint regions back to front; a single one without masks.
    """
    shape = found[0].mask.shape if found else (1, 1)
    labels = np.zeros(shape, np.intp)
    objects = [f for f in found if LEAST <= f.mask.mean() <= MOST and _frame(f.mask) < FRAME]
    chosen = _chosen(objects, max_layers - 1)
    # Smaller ones are drawn over larger ones, of which they may be parts.
    for number, one in enumerate(sorted(chosen, key=lambda f: -int(f.mask.sum())), 1):
        labels[one.mask] = number
    inside = _reduced(support, shape)
    labels = np.where(inside, labels, 0)
    used = np.unique(np.append(labels, 0))
    return regions_of_labels(rgb, np.searchsorted(used, labels), None, support)


def _chosen(found: list[Found], most: int) -> list[Found]:
    """At most so many masks: large, sure, away from the frame, and parts of others only at last."""
    ranked = sorted(found, key=lambda f: -_worth(f))
    chosen: list[Found] = []
    for parts_too in (False, True):
        for one in ranked:
            if len(chosen) < most and all(one is not other for other in chosen):
                apart = all(_shared(one.mask, other.mask) < INSIDE for other in chosen)
                if apart or parts_too:
                    chosen.append(one)
    return chosen


def _worth(one: Found) -> float:
    """Worth of a mask as a layer."""
    return float(one.mask.mean() ** 0.5 * one.quality * (1 - _frame(one.mask)))


def _frame(mask: Mask) -> float:
    """Share of the frame of the picture that a mask covers."""
    rim = (mask[0], mask[-1], mask[:, 0], mask[:, -1])
    return sum(int(side.sum()) for side in rim) / (2 * sum(mask.shape))


def _shared(a: Mask, b: Mask) -> float:
    """Share of the smaller of two masks that lies in the other."""
    return float((a & b).sum() / max(1, min(int(a.sum()), int(b.sum()))))


def _reduced(support: Mask | None, shape: tuple[int, int]) -> Mask:
    """Support of a smaller size, bool [h, w]."""
    if support is None:
        return np.ones(shape, np.bool_)
    weight = cv2.resize(support.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(weight >= 0.5)
