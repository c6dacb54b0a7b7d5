"""Masks as arrays: what is inside a mask, and the regions of what a program passes as masks."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .labels import label_regions
from .masks import Region, check_size
from .soft import is_soft

Masks = Region | NDArray[Any] | Mapping[str, NDArray[Any]] | Iterable[Region | NDArray[Any]]
"""What a program may pass as masks."""

EXPECTED = (
    "pass a list of arrays [{h}, {w}] or of Regions, a dict of arrays by name, an array "
    "[N, {h}, {w}] of masks, or an array [{h}, {w}] of labels 0, 1, 2, ..."
)
"""End of the messages about what cannot be masks."""


def regions_of(masks: Masks, height: int, width: int) -> list[Region]:
    """Makes regions of masks, back to front.

    A list of arrays, or an array [N, H, W], has a mask a layer: `object 1`, `object 2` and so on; a
    dict names them, and ``cat/eye`` is a part that follows ``cat``. One array [H, W] of whole
    numbers, or of bool, has labels: 0 for the back layer, then 1, 2, ... for objects. An array of
    floats [H, W] is one mask. What is inside a mask: see `inside`.

    Args:
        masks: The masks, or regions, whose masks may be of any kind that arrays may be.
        height: Height of the picture in pixels.
        width: Width of the picture in pixels.

    Raises:
        InputError: They are something else, or have another size.
    """
    if isinstance(masks, Region):
        masks = [masks]
    if isinstance(masks, np.ndarray) and masks.ndim == 2 and masks.dtype.kind in "iub":
        check_size("the array of labels", masks, width, height)
        return label_regions(masks, "the array of labels")
    if isinstance(masks, np.ndarray) and masks.ndim == 2:
        masks = masks[None]
    named = _named(masks, height, width)
    regions = list[Region]()
    for name, values in named:
        mask = _array(values, name, height, width)
        regions.append(Region(name, *inside(mask, f"mask {name!r}")))
    warn_of_cut({repr(r.name): r.alpha for r in regions})
    return regions


def inside(values: NDArray[Any], what: str) -> tuple[NDArray[np.bool_], NDArray[np.float32] | None]:
    """Decides what is inside a mask [H, W].

    That is: True; everything but 0 in an array that has 0 and one other value; otherwise at least
    one half of the whole range, which is 255, 65535, or 1.0.

    Args:
        values: bool, uint8, uint16, or floats in 0..1; other numbers if only 0 and one more occur.
        what: What is read, for error messages.

    Returns:
        bool [H, W]; and if the mask has more than two values, these as float32 [H, W] in 0..1,
        otherwise None.

    Raises:
        InputError: The values are something else, or none of more than two reaches one half.
    """
    if values.dtype.kind == "b":
        return np.asarray(values, np.bool_), None
    if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
        raise InputError(f"{what}: {values.dtype} with these values is no mask; pass bool, or 0..1")
    found = np.unique(values)
    if (found[0] == 0 and len(found) <= 2) or (found == 1).all():
        return np.asarray(values != 0), None
    top = {"uint8": 255, "uint16": 65535}.get(str(values.dtype), 1)
    if found[0] < 0 or found[-1] > top or (top == 1 and values.dtype.kind != "f"):
        raise InputError(
            f"{what}: {values.dtype} values {found[0]}..{found[-1]} are no mask, which is bool, 0 "
            "and one other value, or 0..255 in uint8, 0..65535 in uint16, 0..1 in floats"
        )
    half = 0.5 if top == 1 else (top + 1) // 2
    if found[-1] < half:
        raise InputError(
            f"{what}: has {len(found)} values up to {found[-1]}, none of which is half of {top}; a "
            "mask has two values, or is brighter; labels are given alone, as whole numbers"
        )
    alpha = np.asarray(values, np.float32) / np.float32(top) if len(found) > 2 else None
    return np.asarray(values >= half), alpha


def warn_of_cut(alphas: Mapping[str, NDArray[np.float32] | None]) -> None:
    """Says which masks are cut at one half: by name, those with alpha that are not soft."""
    names = [name for name, alpha in alphas.items() if alpha is not None and not is_soft(alpha)]
    if names:
        logging.getLogger(__name__).warning("soft masks are cut at one half: %s", ", ".join(names))


def _named(masks: Any, height: int, width: int) -> list[tuple[str, Any]]:
    """Names and values of masks that were passed one by one."""
    expected = EXPECTED.format(h=height, w=width)
    if isinstance(masks, Mapping):
        for name in masks:
            if not isinstance(name, str):
                raise InputError(f"masks: the name {name!r} is no text; {expected}")
        return [(name, _values(v) if isinstance(v, Region) else v) for name, v in masks.items()]
    if isinstance(masks, np.ndarray) and (masks.ndim != 3 or masks.shape[1:] != (height, width)):
        raise InputError(f"masks: an array of shape {masks.shape} is no masks; {expected}")
    if isinstance(masks, (str, bytes)) or not isinstance(masks, Iterable):
        raise InputError(f"masks: {type(masks).__name__} is not what masks can be; {expected}")
    return [
        (v.name, _values(v)) if isinstance(v, Region) else (f"object {k}", v)
        for k, v in enumerate(masks, 1)
    ]


def _values(region: Region) -> NDArray[Any]:
    return region.mask if region.alpha is None else region.alpha


def _array(values: Any, name: str, height: int, width: int) -> NDArray[Any]:
    """Mask as an array [height, width].

    Raises:
        InputError: It is something else.
    """
    expected = EXPECTED.format(h=height, w=width)
    try:
        mask = np.asarray(values)
    except Exception:  # what makes an array of itself may fail in any way
        mask = np.empty(0, object)
    if mask.dtype.kind not in "biuf" or mask.ndim != 2:
        kind = type(values).__name__ if mask.dtype.kind not in "biuf" else f"shape {mask.shape}"
        raise InputError(f"mask {name!r}: {kind} is not what a mask can be; {expected}")
    check_size(f"mask {name!r}", mask, width, height)
    return mask
