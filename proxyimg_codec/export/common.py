"""Helpers of the exports of layers: the chosen layers, their regions, their opacity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..geometry.pose import OPACITY_MAX
from ..model import Layer, Layers, Picture
from ..render.neighbours import present_outline
from ..render.pixels import selected


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


def opacity_text(layer: Layer) -> str:
    """Opacity of a layer as a decimal number in 0..1."""
    return f"{layer.pose.opacity / OPACITY_MAX:.6g}"
