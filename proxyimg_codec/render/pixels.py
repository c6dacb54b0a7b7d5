"""From a picture to pixels: what is asked for, checked; drawn tile by tile (`compose`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Layer, Pictured
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
) -> NDArray[Any]:
    """Renders a picture, or part of it, at any size.

    Args:
        image: The picture.
        t: Time in seconds, of a picture with a timeline; by default the still is drawn.
        width: Output columns; with `height` left out, the aspect is kept.
        height: Output rows.
        scale: Output pixels a canvas pixel, instead of width and height.
        region: x, y, width, height in canvas pixels.
        layers: Names or positions of the layers to draw; all that are not hidden by default.
        background: Whether to draw the back layer of an opaque picture.
        dtype: uint8 or uint16 (rounded), or float32 in 0..1.
        engine: ``auto``, ``numpy``, ``native`` or ``ort``.
        limits: Bounds the output.
        progress: Called with the number of pixels after each tile.
        cache: Colours that were computed before; this call adds to them.

    Returns:
        [height, width, 3] if the result is opaque by construction, otherwise
        [height, width, 4] with straight alpha.

    Raises:
        UsageError: A request that makes no sense, an unknown layer, or a time of a picture
            that does not move.
        UnsupportedError: The engine is not installed.
        LimitError: The output is too large.
    """
    picture = image.picture if t is None else at(image.picture, t)
    kind = _sample_type(dtype)
    chosen = selected(picture, layers, background)
    view = make_view(picture.size, width, height, scale, region)
    limits.check("output_pixels", view.width * view.height)
    solid = picture.opaque and bool(chosen) and chosen[0] is picture.layers[0]
    result = np.empty((view.height, view.width, 3 if solid else 4), kind)

    def put(row: int, column: int, tile: NDArray[np.float32]) -> None:
        h, w = tile.shape[:2]
        result[row : row + h, column : column + w] = _finished(tile, solid, kind)
        if progress:
            progress(h * w)

    compose(picture, view, chosen, engine, put, limits, cache)
    return result


def _sample_type(dtype: Any) -> np.dtype[Any]:
    try:
        kind: np.dtype[Any] = np.dtype(dtype)
    except TypeError:
        raise UsageError(f"dtype {dtype!r} is not known to numpy") from None
    if kind not in (np.uint8, np.uint16, np.float32):
        raise UsageError(f"dtype {kind} is not uint8, uint16 or float32")
    return kind


def selected(image: Pictured, layers: Sequence[str | int] | None, background: bool) -> list[Layer]:
    """The layers to draw, back to front; those that are not hidden by default.

    Raises:
        UsageError: An unknown layer, or none is left.
    """
    picture = image.picture
    if layers is None:
        wanted = [layer for layer in picture.layers if not layer.pose.hidden]
    else:
        wanted = [picture.layers[k] for k in layers]
    chosen = [
        layer
        for i, layer in enumerate(picture.layers)
        if any(layer is w for w in wanted) and (background or i > 0 or not picture.opaque)
    ]
    if not chosen and (layers is not None or not background):
        raise UsageError("no layer is left to draw")
    return chosen


def _finished(tile: NDArray[np.float32], solid: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Premultiplied [h, w, 4] as straight alpha or opaque output samples."""
    if not solid:
        tile = tile.copy()
        tile[..., :3] /= np.maximum(tile[..., 3:], np.float32(1e-6))
    tile = np.clip(tile, 0, 1)
    if dtype != np.float32:
        tile = np.rint(tile * np.iinfo(dtype).max).astype(dtype)
    return tile[..., :3] if solid else tile
