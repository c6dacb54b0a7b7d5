"""Helpers of the exports of layers: the chosen layers, their regions, their opacity."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.pose import OPACITY_MAX
from ..model import Layer, Layers, Picture
from ..render.neighbours import present_outline
from ..render.pixels import selected

Draw = Callable[..., NDArray[Any]]
"""`render.pixels.render` with some arguments bound."""


class Sheet(NamedTuple):
    """Pixels of a layer alone, without its opacity, cut to those that are not empty.

    Attributes:
        layer: The layer.
        pixels: [h, w, 3] or, with straight alpha, [h, w, 4].
        x: Column of the canvas of the first pixel.
        y: Row of the canvas of the first pixel.
    """

    layer: Layer
    pixels: NDArray[Any]
    x: int
    y: int


def chosen_layers(
    picture: Picture, layers: Sequence[str | int] | None, background: bool
) -> list[Layer]:
    """Layers to export, back to front; by default all, including hidden ones.

    Raises:
        UsageError: A layer is unknown, or none is left.
    """
    return selected(picture, range(len(picture.layers)) if layers is None else layers, background)


def region_of(picture: Picture, layer: Layer) -> tuple[int, int, int, int]:
    """Part of the canvas that holds a layer: x, y, width, height in pixels, at least one pixel."""
    outline = present_outline(picture, layer)
    if outline is None:
        return 0, 0, picture.width, picture.height
    x0, y0, x1, y1 = outline.bounds()
    x0, y0 = min(max(x0, 0), picture.width - 1), min(max(y0, 0), picture.height - 1)
    x1, y1 = max(min(x1, picture.width), x0 + 1), max(min(y1, picture.height), y0 + 1)
    return x0, y0, x1 - x0, y1 - y0


def at_full_opacity(picture: Picture) -> Picture:
    """Picture with all layers at full opacity."""
    layers = [replace(v, pose=replace(v.pose, opacity=OPACITY_MAX)) for v in picture.layers]
    return replace(picture, layers=Layers(layers))


def opacity(layer: Layer) -> float:
    """Opacity of a layer, 0..1."""
    return layer.pose.opacity / OPACITY_MAX


def opacity_text(layer: Layer) -> str:
    """Opacity of a layer as a decimal number in 0..1."""
    return f"{opacity(layer):.6g}"


def sheets(picture: Picture, chosen: Sequence[Layer], draw: Draw) -> Iterator[Sheet]:
    """Draws layers one by one, visible and at full opacity, clipped to the canvas."""
    full = at_full_opacity(picture)
    for layer in chosen:
        region = region_of(picture, layer)
        pixels, x, y = _cropped(draw(full, layers=[layer.name], region=region))
        yield Sheet(layer, pixels, region[0] + x, region[1] + y)


def _cropped(pixels: NDArray[Any]) -> tuple[NDArray[Any], int, int]:
    """Smallest rectangle with all pixels that are not transparent, and its x and y."""
    if pixels.shape[2] == 3:
        return pixels, 0, 0
    solid = pixels[..., 3] > 0
    rows, columns = np.flatnonzero(solid.any(1)), np.flatnonzero(solid.any(0))
    if not len(rows):
        return pixels[:1, :1], 0, 0
    y, x = int(rows[0]), int(columns[0])
    return pixels[y : rows[-1] + 1, x : columns[-1] + 1], x, y
