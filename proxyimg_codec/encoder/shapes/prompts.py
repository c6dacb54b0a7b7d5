"""Prompts: what a user points at, from which prompters make regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .masks import check_size

Point = tuple[float, float]

Box = tuple[float, float, float, float]
"""x, y, width and height in pixels."""


@dataclass(frozen=True, eq=False)
class Prompt:
    """Hints to one object, and its name.

    Points are x, y in pixels of the picture: x grows to the right, y down, and the first pixel
    reaches from 0, 0 to 1, 1.

    Attributes:
        name: Name of the object.
        inside: Points of the object.
        outside: Points that do not belong to it.
        box: x, y, width, height of a box that holds it, or None.
        strokes: bool [H, W], True for pixels of the object that were painted over, or None.
        mask: bool [H, W], a mask of the object that is to be improved, or None.
    """

    name: str
    inside: tuple[Point, ...] = ()
    outside: tuple[Point, ...] = ()
    box: Box | None = None
    strokes: NDArray[np.bool_] | None = None
    mask: NDArray[np.bool_] | None = None


def pixel(point: Point) -> tuple[int, int]:
    """Row and column of the pixel that a point lies in."""
    return int(np.floor(point[1])), int(np.floor(point[0]))


def checked(prompts: Sequence[Prompt], height: int, width: int) -> list[Prompt]:
    """Checks prompts against each other and a picture, so that prompters need not.

    Args:
        prompts: Prompts, one an object.
        height: Height of the picture in pixels.
        width: Width of the picture in pixels.

    Returns:
        The prompts. Boxes are clipped to the picture. Points inside an object are outside of the
        others, unless one is a part of the other: `cat/eye` of `cat`.

    Raises:
        InputError: A name is given twice, a point or box lies outside the picture, strokes or a
            mask have another size or are empty, there is nothing inside an object, or the same
            pixel is said to be inside and outside, or inside two objects.
    """
    owner: dict[tuple[int, int], str] = {}
    result, names = list[Prompt](), set[str]()
    for prompt in prompts:
        if prompt.name in names:
            raise InputError(f'"{prompt.name}" is the name of two prompts; join them in one')
        names.add(prompt.name)
        result.append(_checked(prompt, height, width))
        for place in map(pixel, prompt.inside):
            other = owner.setdefault(place, prompt.name)
            if other != prompt.name:
                raise InputError(
                    f"the pixel {place[1]},{place[0]} cannot be inside both "
                    f'"{other}" and "{prompt.name}"; leave one of the points out'
                )
    return [replace(p, outside=(*p.outside, *_points_of_others(p, result))) for p in result]


def are_parts(one: str, other: str) -> bool:
    """Whether names are those of the same object, or of an object and a part: `cat`, `cat/eye`."""
    return f"{one}/".startswith(f"{other}/") or f"{other}/".startswith(f"{one}/")


def _points_of_others(prompt: Prompt, prompts: Sequence[Prompt]) -> list[Point]:
    """Points inside the objects that are apart from that of a prompt."""
    apart = [p for p in prompts if not are_parts(p.name, prompt.name)]
    return [point for p in apart for point in p.inside]


def _checked(prompt: Prompt, height: int, width: int) -> Prompt:
    name = prompt.name
    for x, y in (*prompt.inside, *prompt.outside):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(
                f'the point {x:g},{y:g} of "{name}" lies outside the picture, which is '
                f"{width}x{height}; x must be 0..{width - 1}, y 0..{height - 1}"
            )
    both = {*map(pixel, prompt.inside)} & {*map(pixel, prompt.outside)}
    for y, x in sorted(both):
        raise InputError(f'the pixel {x},{y} cannot be inside and outside of "{name}"')
    for what, mask in (("strokes", prompt.strokes), ("the mask", prompt.mask)):
        if mask is not None:
            check_size(f'{what} of "{name}"', mask, width, height)
            if not mask.any():
                raise InputError(f'{what} of "{name}": no pixel is inside; paint over some')
    given = (prompt.strokes, prompt.mask, prompt.box)
    if not prompt.inside and all(v is None for v in given):
        raise InputError(f'nothing is said to be inside "{name}"; add a point or a box')
    return prompt if prompt.box is None else replace(prompt, box=_clipped(prompt, height, width))


def _clipped(prompt: Prompt, height: int, width: int) -> Box:
    """Part of the box of a prompt that lies in the picture."""
    x, y, wide, high = prompt.box or (0, 0, 0, 0)
    right, bottom = min(x + wide, width), min(y + high, height)
    left, top = max(x, 0), max(y, 0)
    if not (np.isfinite((x, y, wide, high)).all() and right - left >= 1 and bottom - top >= 1):
        raise InputError(
            f'the box {x:g},{y:g},{wide:g},{high:g} of "{prompt.name}" (x, y, width, height) '
            f"leaves no pixel of the picture, which is {width}x{height}"
        )
    return left, top, right - left, bottom - top
