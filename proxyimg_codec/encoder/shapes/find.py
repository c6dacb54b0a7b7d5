"""Finding of layers: by a segmenter, or where a user points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import plugins
from ...errors import UsageError
from ...io.samples import to_float
from ...texture.network import Floats
from ..settings import Settings
from .external_models.locate import first_here
from .layers import regions_of_picture
from .mask_arrays import Masks, regions_of
from .masks import Region, is_back, resolve
from .prompts import Box, Point, Prompt, checked

PROMPTER = "maps"
"""Prompter where no model of the SAM family is installed."""


def find_layers(
    pixels: NDArray[Any],
    *,
    points: Mapping[str, Sequence[Point]] | None = None,
    boxes: Mapping[str, Box] | None = None,
    negatives: Mapping[str, Sequence[Point]] | None = None,
    scribbles: Masks | None = None,
    masks: Masks | None = None,
    refine: Sequence[str] = (),
    max_layers: int | None = None,
    segmenter: str | None = None,
    prompter: str | None = None,
    jobs: int = 1,
) -> list[Region]:
    """Finds the layers of a picture; what is pointed at, or else what a segmenter finds.

    Points are x, y in pixels. All that has one name belongs to one object; an object named
    ``cat/eye`` is a part of ``cat``. Points named ``back`` or ``background`` are outside of all.

    Args:
        pixels: The picture, as `encode` takes it.
        points: By name, points inside an object.
        boxes: By name, the x, y, width and height of a box that holds an object.
        negatives: By name, points outside of an object.
        scribbles: Strokes over objects, as masks or labels: 0 is no stroke.
        masks: Layers that there are already, as `encode` takes them; new ones lie in front.
        refine: Names of `masks` that are to be improved, by points or without.
        max_layers: Most layers that a segmenter finds; 4 by default.
        segmenter: Name of who finds layers where nothing is pointed at; see `plugins`.
        prompter: Name of who finds what is pointed at; see `plugins`.
        jobs: Threads to use.

    Returns:
        Regions back to front, for `encode`; what nobody named is the first, ``back``.

    Raises:
        InputError: The array cannot be a picture, or prompts or masks do not fit it or each other.
        UsageError: Arguments contradict each other, or there is no such mask or plug-in.

    Examples:
        >>> import numpy as np
        >>> import proxyimg_codec as pxi
        >>> pixels = np.full((48, 64, 3), 200, np.uint8)
        >>> pixels[10:30, 20:50] = (180, 40, 30)
        >>> [region.name for region in pxi.find_layers(pixels, points={"box": [(35, 20)]})]
        ['back', 'box']
    """
    picture = to_float(np.asarray(pixels))[0]
    size = picture.shape[:2]
    old = [] if masks is None else regions_of(masks, *size)
    strokes = [] if scribbles is None else regions_of(scribbles, *size)
    prompts = _gathered(points or {}, boxes or {}, negatives or {}, strokes, old, refine)
    pointing = bool(prompts) or masks is not None
    chosen: dict[str, Any] = {"max_layers": max_layers, "segmenter": segmenter}
    for name in _said(chosen if pointing else {"prompter": prompter}):
        where = "with prompts or masks" if pointing else "without points, boxes or scribbles"
        raise UsageError(f"{name} is of no use {where}; leave it out")
    if not pointing:
        return regions_of_picture(picture, Settings(jobs=jobs, **_said(chosen)))
    return with_objects(picture, old, prompts, prompter, jobs)


def _said(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options that are not left to their defaults."""
    return {name: value for name, value in options.items() if value is not None}


def with_objects(
    picture: Floats,
    old: Sequence[Region],
    prompts: Sequence[Prompt],
    prompter: str | None = None,
    jobs: int = 1,
) -> list[Region]:
    """Finds the objects of prompts, and stacks them on layers that there are already.

    Args:
        picture: float32 [H, W, 4] in 0..1 with straight alpha.
        old: Layers that there are, back to front.
        prompts: Prompts, one an object.
        prompter: Name of who finds the objects, see `plugins`; by default a model of the SAM family
            if one is here (`pxi-models`), else the built-in maps.
        jobs: Threads to use.

    Returns:
        Regions as of `find_layers`: small objects are in front of large ones.

    Raises:
        InputError: As `find_layers`.
        UsageError: There is no such prompter.
    """
    height, width = picture.shape[:2]
    find = plugins.find("prompters", prompter or ("sam" if first_here("sam") else PROMPTER))
    rgb = np.rint(picture[..., :3] * 255).astype(np.uint8)
    prompts = _against_back(prompts, height, width)
    found = find(rgb, prompts, jobs=jobs) if prompts else []
    by_name = {region.name: region for region in found}
    stack = [by_name.pop(region.name, region) for region in old]
    stack += sorted(by_name.values(), key=lambda region: -int(region.mask.sum()))
    support = None if (picture[..., 3] == 1).all() else picture[..., 3] >= 0.5
    return resolve(stack, height, width, support)


def _gathered(
    points: Mapping[str, Sequence[Point]],
    boxes: Mapping[str, Box],
    negatives: Mapping[str, Sequence[Point]],
    strokes: Sequence[Region],
    old: Sequence[Region],
    refine: Sequence[str],
) -> list[Prompt]:
    """Prompts of the arguments of `find_layers`, one a name in the order of the arguments."""
    known = {region.name: region.mask for region in old}
    for name in refine:
        if name not in known:
            there = ", ".join(known) or "none"
            raise UsageError(f"refine: there is no mask {name!r}; masks are {there}")
    painted = {region.name: region.mask for region in strokes if not is_back(region.name)}
    return [
        Prompt(
            name,
            tuple((float(x), float(y)) for x, y in points.get(name, ())),
            tuple((float(x), float(y)) for x, y in negatives.get(name, ())),
            boxes.get(name),
            painted.get(name),
            known[name] if name in refine else None,
        )
        for name in dict.fromkeys([*points, *boxes, *painted, *refine, *negatives])
    ]


def _against_back(prompts: Sequence[Prompt], height: int, width: int) -> list[Prompt]:
    """Checked prompts without those of the back, whose points are outside of the others.

    Raises:
        InputError: As `prompts.checked`; or the back has a box, strokes or a mask.
    """
    back = [p for p in prompts if is_back(p.name)]
    for prompt in back:
        if prompt.box is not None or prompt.strokes is not None or prompt.mask is not None:
            raise UsageError(
                f'"{prompt.name}" is what no object holds; only points can say where it is'
            )
    checked(back, height, width)
    points = tuple(point for p in back for point in p.inside)
    objects = [replace(p, outside=(*p.outside, *points)) for p in prompts if p not in back]
    return checked(objects, height, width)
