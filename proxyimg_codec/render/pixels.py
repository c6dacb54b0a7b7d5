"""Rendering of a picture to pixels: checks the request, and has it drawn by `compose`."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..limits import DEFAULT_LIMITS, Limits, enough_memory
from ..model import Layer, Pictured
from ..native import kernel
from . import engines, finish_native, thumbnail
from .cache import Cache
from .compose import compose
from .moment import at
from .view import make_view


def render(
    image: Pictured,
    *,
    t: float | None = None,
    width: int | None = None,
    height: int | None = None,
    scale: float | None = None,
    region: tuple[int, int, int, int] | None = None,
    layers: Sequence[str | int] | None = None,
    background: bool = True,
    dtype: Any = np.uint8,
    engine: str = "auto",
    limits: Limits = DEFAULT_LIMITS,
    progress: Callable[[int], None] | None = None,
    cache: Cache | None = None,
    out: NDArray[Any] | None = None,
) -> NDArray[Any]:
    """Renders a picture, or part of it, at any size: see `api.Image.render`.

    Args:
        image: The picture.
        t: Time in seconds in the timeline; by default the still is drawn.
        width: Output columns; without `height`, the aspect ratio is kept.
        height: Output rows; without `width`, the aspect ratio is kept.
        scale: Output pixels per canvas pixel, instead of `width` and `height`.
        region: x, y, width, height in canvas pixels; the whole canvas by default.
        layers: Names or positions of the layers to draw; by default all that are not hidden.
        background: Whether to draw the back layer of an opaque picture.
        dtype: uint8 or uint16 (rounded), or float32 in 0..1.
        engine: ``auto``, ``numpy``, ``native`` or ``ort``.
        limits: Bounds on the output and on the work.
        progress: Called with how much more is done, in output pixels; what it raises ends it.
        cache: Colours computed before; this call adds to them.
        out: Array for the pixels, of the shape and type of the result; by default a new one.

    Returns:
        Pixels of type `dtype`: [height, width, 3] if the picture is opaque and its back layer is
        drawn, otherwise [height, width, 4] with straight alpha.

    Raises:
        UsageError, UnsupportedError, LimitError, FormatError: As `api.Image.render`.
    """
    picture = image.picture if t is None else at(image.picture, t)
    kind = _sample_type(dtype)
    chosen = selected(picture, layers, background)
    view = make_view(picture.size, width, height, scale, region)
    if not isinstance(limits, Limits) or not (progress is None or callable(progress)):
        raise UsageError("limits must be Limits, and progress a function of one number")
    limits.check("output_pixels", view.width * view.height)
    solid = picture.opaque and chosen[:1] == [picture.layers[0]]
    shape = view.height, view.width, 3 if solid else 4
    with kernel.for_engine(engine), enough_memory("to draw the picture; ask for a smaller one"):
        result = _fitting(out, shape, kind)
        put = partial(_put, result)
        engines.find(engine)
        if (planes := thumbnail.raster(picture, chosen, view)) is not None:
            thumbnail.draw(planes, view, put, progress)
        else:
            compose(picture, view, chosen, engine, put, limits, cache, progress)
    return result


def _fitting(out: Any, shape: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
    """Array that is to hold pixels: a new one, or one that is given.

    Raises:
        UsageError: It is no array that can.
    """
    if out is None:
        return np.empty(shape, kind)
    wanted = f"out must be a writeable array of shape {shape} and type {kind}"
    if not isinstance(out, np.ndarray):
        raise UsageError(f"{wanted}; it is a {type(out).__name__}")
    if out.shape != shape or out.dtype != kind:
        raise UsageError(f"{wanted}; it has shape {out.shape} and type {out.dtype}")
    if not out.flags.writeable:
        raise UsageError(f"{wanted}; it is read-only")
    return out


def _put(
    result: NDArray[Any],
    row: int,
    column: int,
    tile: NDArray[np.float32],
) -> None:
    """Puts a finished tile, premultiplied [h, w, 4] or opaque [h, w, 3], in its place."""
    h, w = tile.shape[:2]
    finished = _finished(tile, result.shape[2] == 3, result.dtype)
    result[row : row + h, column : column + w] = finished


def _sample_type(dtype: Any) -> np.dtype[Any]:
    try:
        kind: np.dtype[Any] = np.dtype(dtype)
    except TypeError:
        raise UsageError(f"dtype {dtype!r} is not known to numpy") from None
    if kind not in (np.uint8, np.uint16, np.float32):
        raise UsageError(f"dtype {kind} is not uint8, uint16 or float32")
    return kind


def selected(image: Pictured, layers: Sequence[str | int] | None, background: bool) -> list[Layer]:
    """Selects the layers to draw, back to front.

    Args:
        image: The picture.
        layers: Names or positions of the wanted layers; None for all that are not hidden.
        background: Whether the back layer of an opaque picture may be among them.

    Raises:
        UsageError: A layer is unknown, or the arguments leave no layer.
    """
    picture = image.picture
    if layers is None:
        wanted = [layer for layer in picture.layers if not layer.pose.hidden]
    else:
        wanted = [picture.layers[k] for k in _keys(layers)]
    chosen = [
        layer
        for i, layer in enumerate(picture.layers)
        if any(layer is w for w in wanted) and (background or i > 0 or not picture.opaque)
    ]
    if not chosen and (layers is not None or not background):
        raise UsageError("no layer is left to draw")
    return chosen


def _keys(layers: Sequence[str | int]) -> list[str | int]:
    try:
        if not isinstance(layers, str):
            return [k if isinstance(k, str) else operator.index(k) for k in layers]
    except TypeError:
        pass
    raise UsageError(f"layers {layers!r} is not a list of names and positions of layers")


def _finished(tile: NDArray[np.float32], solid: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Converts premultiplied [h, w, 4] to output samples, opaque or with straight alpha."""
    if dtype != np.float32 and kernel.available():
        return finish_native.finished(tile, solid, dtype)
    if not solid:
        tile = tile.copy()
        tile[..., :3] /= np.maximum(tile[..., 3:], np.float32(1e-6))
    tile = np.clip(tile, 0, 1)
    if dtype != np.float32:
        tile = np.rint(tile * np.iinfo(dtype).max).astype(dtype)
    return tile[..., :3] if solid else tile
