"""Label pictures: the number of a pixel, or its colour, says which layer it belongs to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .masks import Region

MAX_LABELS = 64
"""Most labels of a picture. Smoothed pictures have more."""

THIN, THIN_SHARE = 4, 0.25
"""Least number and share of labels nowhere 2 pixels wide by which a smoothed picture is known."""

MIXED, MIXED_SHARE = 4, 0.05
"""Least number of pixels between both neighbours' values, and their share of the pixels on edges,
by which a smoothed picture is known."""


def label_regions(image: NDArray[Any], where: str) -> list[Region]:
    """Makes a region of each label: `back` of 0, then `object 1`, `object 2` and so on.

    Numbers are labels as they are. Colours are labelled in the order of their packed values
    0xRRGGBB, black being 0; greys in three channels count as numbers.

    Args:
        image: Whole numbers from 0 on, [H, W], or colours [H, W, 3].
        where: What is read, for error messages.

    Returns:
        Regions back to front, disjoint, which cover the picture.

    Raises:
        InputError: There are negative numbers, too many labels, or colours without black; or the
            picture was smoothed, so that mixed values lie along its edges.
    """
    values = image.reshape(*image.shape[:2], -1)
    if values.min() < 0:
        raise InputError(f"{where}: labels must be 0, 1, 2, ...; there is {values.min()}")
    if values.shape[2] == 3 and (values == values[..., :1]).all():
        values = values[..., :1]
    colours = values.shape[2] == 3
    packed = values[..., 0].astype(np.int32) if colours else values[..., 0]
    for channel in range(1, values.shape[2]):
        packed = packed << 8 | values[..., channel]
    found = np.unique(packed)
    _check_flat(values, packed, found, where)
    if colours and found[0] != 0:
        raise InputError(
            f"{where}: no pixel is black, so that no colour is known to be the back; save the "
            "labels as greys or with a palette, 0 for the back"
        )
    labels = np.arange(len(found)) if colours else found
    return [
        Region("back" if label == 0 else f"object {int(label)}", packed == value)
        for label, value in zip(labels, found, strict=True)
    ]


def _check_flat(
    values: NDArray[Any], labels: NDArray[Any], found: NDArray[Any], where: str
) -> None:
    """Refuses pictures that were smoothed, scaled with interpolation or saved with loss.

    Args:
        values: [H, W, C] channels of the picture.
        labels: [H, W] labels, one for each colour.
        found: Different labels.
        where: What is read, for error messages.

    Raises:
        InputError: The picture is such a one.
    """
    # At the border a label is as wide as it would be if the picture went on.
    padded = np.pad(labels, 1, mode="edge")
    same = padded[:-1, :-1] == padded[1:, 1:]
    same &= (padded[:-1, :-1] == padded[1:, :-1]) & (padded[:-1, :-1] == padded[:-1, 1:])
    thin = len(found) - len(np.unique(padded[:-1, :-1][same]))
    edges, mixed = _mixed(values)
    smooth = thin >= THIN and thin > THIN_SHARE * len(found)
    smooth |= mixed >= MIXED and mixed > MIXED_SHARE * edges
    if len(found) > MAX_LABELS or smooth:
        raise InputError(
            f"{where}: the label picture has {len(found)} different labels, {thin} of them nowhere "
            f"2 pixels wide; it may have at most {MAX_LABELS}, and no smoothed edges. Save it "
            "without smoothing or loss, one flat value a layer. The soft mask of one object is "
            "given in a folder or list of masks"
        )


def _mixed(values: NDArray[Any]) -> tuple[int, int]:
    """Numbers of pixels on edges, and of those whose colour lies between both neighbours'."""
    edges = mixed = 0
    for v in (values, values.transpose(1, 0, 2)):
        before, now, after = v[:-2], v[1:-1], v[2:]
        unlike, unlike2 = (now != before).any(2), (now != after).any(2)
        edges += int((unlike | unlike2).sum())
        # Few pixels are unlike both neighbours.
        one, this, other = (w[unlike & unlike2] for w in (before, now, after))
        between = (np.minimum(one, other) <= this) & (this <= np.maximum(one, other))
        mixed += int(between.all(1).sum())
    return edges, mixed
