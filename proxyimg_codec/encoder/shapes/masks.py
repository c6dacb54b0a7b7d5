"""Regions of a picture: masks with names, and their stacking order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..settings import LAYERS_MAX

BACK_NAMES = ("back", "background")
NAME_MAX = 200  # characters
# Upper ends of the lightness of greys, and of the hue angle in Lab, in degrees.
_GREYS = ((22, "black"), (40, "dark"), (70, "grey"), (88, "light"), (101, "white"))
_HUES = ((10, "pink"), (47, "red"), (78, "orange"), (108, "yellow"), (165, "green"),
         (225, "teal"), (297, "blue"), (330, "purple"), (361, "pink"))  # fmt: skip


@dataclass(frozen=True)
class Region:
    """Mask with a name, from which a layer is made.

    Attributes:
        name: Name of the layer. ``cat/eye`` is a part of ``cat`` and follows it.
        mask: bool [H, W], True for the pixels of the layer, also where others in front hide it.
        alpha: float32 [H, W] in 0..1, how much of each pixel belongs to the layer, if that is known
            better than `mask` says it; or None.
    """

    name: str
    mask: NDArray[np.bool_]
    alpha: NDArray[np.float32] | None = None

    @property
    def parent(self) -> str | None:
        """Name of what the region is a part of, or None."""
        return parent_of(self.name)


def resolve(
    regions: Sequence[Region],
    height: int,
    width: int,
    support: NDArray[np.bool_] | None = None,
) -> list[Region]:
    """Makes a stack of masks, so that their union is the picture or its support.

    Masks stay as they are where others in front hide them: a pixel in several shows the frontmost.
    Pixels in none go to the back layer of an opaque picture, which is made if there is none, or to
    a new rearmost region `rest` of a transparent one. A region named `back` or `background` is
    moved to the back. Names become unique: `cat`, `cat 2`.

    Args:
        regions: Regions back to front, with masks bool [height, width] that may overlap.
        height: Height of the picture in pixels.
        width: Width of the picture in pixels.
        support: bool [height, width], True for pixels that belong to a layer; None for all pixels
            of an opaque picture.

    Returns:
        Regions back to front, something of each visible; none if the support is empty.

    Raises:
        InputError: A mask has the wrong size, or nothing of it remains visible.
    """
    for region in regions:
        check_size(f'mask "{region.name}"', region.mask, width, height)
    if support is not None:
        check_size("the support of the picture", support, width, height)
    whole = np.ones((height, width), np.bool_) if support is None else support
    ordered = sorted(regions, key=lambda r: not is_back(r.name))
    stack = [replace(r, mask=r.mask & whole) for r in ordered]
    free = whole.copy()
    for region in stack:
        free &= ~region.mask
    if support is None and stack and is_back(stack[0].name):
        stack[0] = replace(stack[0], mask=stack[0].mask | free)
    elif free.any():
        stack.insert(0, Region("back" if support is None else "rest", free))
    for region, seen in zip(stack, visible(stack), strict=True):
        if not seen.any():
            raise InputError(
                f'mask "{region.name}" is empty, hidden by the masks in front of it or fully '
                "outside the visible part; draw it where it can be seen, or leave it out"
            )
    names = unique_names(region.name for region in stack)
    return [replace(r, name=name) for r, name in zip(stack, names, strict=True)]


def visible(regions: Sequence[Region]) -> list[NDArray[np.bool_]]:
    """Visible parts bool [H, W] of regions that are given back to front: disjoint masks."""
    masks: list[NDArray[np.bool_]] = []
    covered: NDArray[np.bool_] | np.bool_ = np.False_
    for region in reversed(regions):
        masks.insert(0, region.mask & ~covered)
        covered = covered | region.mask
    return masks


def parent_of(name: str) -> str | None:
    """Name of what a part belongs to: `cat` for `cat/eye`; None for what is no part."""
    return name.rpartition("/")[0] if all(name.split("/")) and "/" in name else None


def groups_of(regions: Sequence[Region]) -> dict[str, str | None]:
    """Parents that are no regions, with their own parents: `cat` if there is only `cat/eye`."""
    names = {region.name for region in regions}
    groups: dict[str, str | None] = {}
    for region in regions:
        above = region.parent
        while above is not None and above not in names and above not in groups:
            groups[above] = parent_of(above)
            above = groups[above]
    return groups


def unique_names(names: Iterable[str]) -> list[str]:
    """Numbers repeated names, in their order: `cat`, `cat` become `cat`, `cat 2`."""
    names = list(names)
    taken, result = set(names), list[str]()
    for name in names:
        unique, number = name, 1
        while unique in result or (number > 1 and unique in taken):
            number += 1
            unique = f"{name} {number}"
        result.append(unique)
    return result


def nearness(mask: NDArray[np.bool_], salience: float) -> float:
    """Estimates how near a region is to the viewer; only the order of values has a meaning.

    Near regions are salient, low in the picture and compact. Far ones lie along the frame of the
    picture, above all at its top.

    Args:
        mask: bool [H, W], not empty.
        salience: Mean saliency of the region in 0..1.
    """
    height, width = mask.shape
    down = (np.arange(height) + 0.5) / height
    rows = mask.sum(1)
    far_frame = 1.5 * mask[0].sum() + 0.5 * mask[-1].sum()
    far_frame += float((1.5 - down) @ mask[:, [0, -1]].sum(1))
    box = np.ptp(np.flatnonzero(rows)) * np.ptp(np.flatnonzero(mask.any(0))) / mask.size
    frame, low = far_frame / (height + width), (rows @ down) / rows.sum()
    return float(2.5 * salience + 0.5 * low - 0.4 * box - 1.5 * frame)


def description(rgb: NDArray[np.uint8], mask: NDArray[np.bool_]) -> str:
    """Names a region by its mean colour and place, such as `red center` or `dark bottom left`.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        mask: bool [H, W] pixels of the region, not empty.
    """
    height, width = mask.shape
    y = float(mask.sum(1) @ np.arange(height)) / mask.sum() / height
    x = float(mask.sum(0) @ np.arange(width)) / mask.sum() / width
    place = f"{('top', '', 'bottom')[int(y * 3)]} {('left', '', 'right')[int(x * 3)]}".strip()
    return f"{_colour_word(rgb[mask].mean(0, dtype=np.float32))} {place or 'center'}"


def _colour_word(rgb: NDArray[np.float32]) -> str:
    lab = cv2.cvtColor(rgb.reshape(1, 1, 3) / 255, cv2.COLOR_RGB2LAB)
    light, a, b = (float(v) for v in lab[0, 0])
    if np.hypot(a, b) < 10:
        return next(word for top, word in _GREYS if light <= top)
    if light < 22:
        return "dark"
    hue = float(np.degrees(np.arctan2(b, a))) % 360
    word = next(word for top, word in _HUES if hue <= top)
    return "brown" if word == "orange" and light < 50 else word


def is_back(name: str) -> bool:
    """Whether a region of this name belongs to the back."""
    return name.lower() in BACK_NAMES


def check_count(count: int, what: str) -> None:
    """Raises `InputError` if there are more masks or layers than a picture can have."""
    if count > LAYERS_MAX:
        raise InputError(f"{count} {what} are too many; at most {LAYERS_MAX} are possible")


def check_size(what: str, mask: NDArray[np.generic], width: int, height: int) -> None:
    """Raises `InputError` if a mask [H, W] has not the size of the picture."""
    if mask.shape[:2] != (height, width):
        found = f"{mask.shape[1]}x{mask.shape[0]}"
        raise InputError(f"{what} is {found}, the picture {width}x{height}; make them equal")
