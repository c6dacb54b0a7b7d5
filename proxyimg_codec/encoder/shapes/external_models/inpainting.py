"""Inpainting of what objects hide: plug-ins, and models with the interface of LaMa."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from .... import plugins
from ....errors import InputError, UsageError
from ..masks import check_size
from ..onnx_model import Floats, Model, Tensor, load
from .kinds import Kind, check_kind, picture_and_hole
from .locate import is_path, locate
from .pixels import planes

Mask = NDArray[np.bool_]
Inpainter = Callable[[Floats, Mask], Floats]

LEAST, MOST, MULTIPLE = 256, 1024, 8
"""Least and most side of what a model sees that leaves it free, and the number that sides are
multiples of, in pixels."""

GAP = 16
"""Parts of a hole that are nearer to each other than this are filled at once, in pixels."""

MARGIN = 0.5
"""Surroundings that are seen on each side of a hole, relative to its longer side."""

RANGE = 1.5
"""Largest output of models that give 0..1; those that give 0..255 go beyond it."""


def find_inpainter(name: str, jobs: int = 1) -> Inpainter:
    """Function of a name that fills the hole of a picture.

    It takes the picture, float32 [H, W, 3] in 0..1, and bool [H, W], True in its hole, and returns
    the picture with other colours in the hole.

    Args:
        name: Name of a plug-in of the kind `inpainters`, or a model as `locate` finds it.
        jobs: Threads that a model uses.

    Raises:
        UsageError: There is no such plug-in or model.
        InputError: The model is not here, or is no inpainter.
    """
    there = plugins.names("inpainters")
    if not is_path(name) and name in there:
        return partial(_checked, plugins.find("inpainters", name), name)
    try:
        paths = locate(name)
    except UsageError as error:
        raise UsageError(f"background: {name!r} is no method; plug-ins: "
                         f"{', '.join(there) or 'none'}; {error}") from None  # fmt: skip
    if len(paths) != 1:
        raise InputError(f"{name}: a model of inpainting is one file, not {len(paths)}")
    model = load(paths[0], jobs)
    check_kind(model, (Kind.INPAINTING,), "a background")
    return partial(inpainted, model)


def _checked(fill: Inpainter, name: str, picture: Floats, hole: Mask) -> Floats:
    """Picture that a plug-in filled, if it is one."""
    found = np.asarray(fill(picture, hole), np.float32)
    if found.ndim != 3 or found.shape[2] != 3 or not np.isfinite(found).all():
        raise InputError(f"the picture of {name} must be [H, W, 3] and finite")
    check_size(f"the picture of {name}", found, hole.shape[1], hole.shape[0])
    return np.clip(found, 0, 1)


def inpainted(model: Model, picture: Floats, hole: Mask) -> Floats:
    """Picture whose hole a model has filled; all else stays as it is.

    Parts of the hole are filled one after the other, each seen with what is around it. The model
    sees nothing of what is in the hole.

    Args:
        model: Model with the interface of LaMa.
        picture: float32 [H, W, 3] in 0..1.
        hole: bool [H, W], True where the picture is to be filled.

    Returns:
        float32 [H, W, 3] in 0..1.

    Raises:
        InputError: The model has another interface, or its output is no such picture.
    """
    check_kind(model, (Kind.INPAINTING,), "what fills a hole")
    inputs = picture_and_hole(model)
    assert inputs is not None, "that makes the kind"
    least = min(n or LEAST for n in inputs[0].shape[2:4])
    out, left = np.array(picture, np.float32), hole.copy()
    for part, place in _parts(hole, least):
        filled = _run(model, inputs, out[place], left[place])
        out[place][part] = filled[part]
        left[place] &= ~part
    return out


def _parts(hole: Mask, least: int) -> Iterator[tuple[Mask, tuple[slice, slice]]]:
    """Yields parts of a hole, as masks of the place that they are seen in, and these places."""
    near = cv2.dilate(hole.astype(np.uint8), np.ones((GAP + 1, GAP + 1), np.uint8))
    count, labels = cv2.connectedComponents(near)
    for number in range(1, count):
        part = hole & (labels == number)
        spans = [np.flatnonzero(part.any(axis))[[0, -1]] for axis in (1, 0)]
        longest = max(int(last - first) + 1 for first, last in spans)
        side = max(longest + 2 * round(MARGIN * longest), least)
        rows, columns = (
            _window(int(a), int(b) + 1, side, n)
            for (a, b), n in zip(spans, hole.shape, strict=True)
        )
        yield part[rows, columns], (rows, columns)


def _window(start: int, stop: int, side: int, length: int) -> slice:
    """Window of a side around start .. stop within 0 .. length; shorter if that is."""
    side = min(side, length)
    first = min(max((start + stop - side) // 2, 0), length - side)
    return slice(first, first + side)


def _run(model: Model, inputs: tuple[Tensor, Tensor], picture: Floats, hole: Mask) -> Floats:
    """Picture float32 [H, W, 3] that a model makes of one with a hole, at its own size."""
    shown, missing = inputs
    limits = [n or MOST for n in shown.shape[2:4]]
    height, width = hole.shape
    scale = min(1.0, limits[0] / height, limits[1] / width)
    high, wide = (max(1, round(n * scale)) for n in (height, width))
    seen = np.where(hole[..., None], np.float32(0), picture)
    mask = hole.astype(np.float32)
    if scale < 1:
        seen, share = (cv2.resize(v, (wide, high), interpolation=cv2.INTER_AREA)
                       for v in (seen, mask))  # fmt: skip
        mask = (share > 0).astype(np.float32)
        seen = (seen * (1 - mask[..., None])).astype(np.float32)
    # Mirrored at the end, as LaMa itself fills up sides.
    beside = [
        (0, (n or -(-side // MULTIPLE) * MULTIPLE) - side)
        for n, side in zip(shown.shape[2:4], (high, wide), strict=True)
    ]
    seen = np.pad(seen, [*beside, (0, 0)], mode="symmetric")
    mask = np.pad(mask, beside, mode="symmetric")
    feeds = {shown.name: planes(seen, (0,) * 3, (1,) * 3), missing.name: mask[None, None]}
    found = model.run(feeds, [model.outputs[0].name])[0]
    if found.shape != (1, 3, *mask.shape):
        raise InputError(f"{model.name}: the model gives {list(found.shape)} for a picture of "
                         f"{list(feeds[shown.name].shape)}; both must be equal")  # fmt: skip
    filled = np.asarray(found[0, :, :high, :wide].transpose(1, 2, 0), np.float32)
    if filled.max() > RANGE:
        filled = filled / np.float32(255)
    if scale < 1:
        # So that only colours that are known are mixed in where the hole ends.
        filled = np.where(mask[:high, :wide, None] > 0, filled, seen[:high, :wide])
        large = cv2.resize(filled, (width, height), interpolation=cv2.INTER_CUBIC)
        filled = np.asarray(large, np.float32)
    return np.clip(filled, 0, 1)
