"""Export of the outlines of layers as SVG, exact to the last bit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..geometry.boundary import Boundary
from ..geometry.pose import OPACITY_MAX
from ..io import xml
from ..io.color import is_srgb, to_srgb
from ..model import Layer, Picture, Pictured
from ..render.cache import Cache
from ..render.neighbours import present_outline
from ..render.pixels import render
from .common import at_full_opacity, chosen_layers, opacity_text, region_of

NAMESPACE = "http://www.w3.org/2000/svg"
INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"

SWATCH = 64
"""Most samples in a row or column from which the mean colour of a layer is computed."""


def build(
    image: Pictured,
    *,
    layers: Sequence[str | int] | None = None,
    background: bool = True,
    engine: str = "auto",
) -> bytes:
    """Bytes of an SVG file with one element for each layer, back to front.

    A layer is a path with its control points as exact decimal numbers, or a rectangle if it covers
    the whole canvas. It is filled with its mean colour, in sRGB. Its name is the Inkscape label,
    and `identifiers` makes its id.

    Args:
        image: The picture.
        layers: Names or positions of the layers to write; all by default.
        background: Whether to write the back layer of an opaque picture.
        engine: As in `render.pixels.render`.

    Raises:
        UsageError: A layer is unknown, or none is left.
        UnsupportedError: The picture is not sRGB, and imagecodecs, which converts it, is not
            installed, or its profile is damaged.
    """
    picture = image.picture
    size = {"width": str(picture.width), "height": str(picture.height)}
    spaces = {"xmlns": NAMESPACE, "xmlns:inkscape": INKSCAPE}
    page = {**spaces, **size, "viewBox": f"0 0 {picture.width} {picture.height}"}
    root = ElementTree.Element("svg", page)
    full, cache = at_full_opacity(picture), Cache()
    ids = dict(zip(picture.layers, identifiers([v.name for v in picture.layers]), strict=True))
    for layer in chosen_layers(picture, layers, background):
        outline = present_outline(picture, layer)
        look = _look(layer, ids[layer], _mean_colour(full, layer, engine, cache))
        if outline is None:
            ElementTree.SubElement(root, "rect", {**look, **size})
        else:
            drawn = {"fill-rule": "nonzero", "d": path_data(outline)}
            ElementTree.SubElement(root, "path", {**look, **drawn})
    return xml.serialize(root)


def _look(layer: Layer, identifier: str, colour: str) -> dict[str, str]:
    """Attributes of the shape of a layer, except for its geometry."""
    look = {"id": identifier, "inkscape:label": xml.text(layer.name), "fill": colour}
    if layer.pose.opacity < OPACITY_MAX:
        look["opacity"] = opacity_text(layer)
    if layer.pose.hidden:
        look["display"] = "none"
    return look


def identifiers(names: Sequence[str]) -> list[str]:
    """XML ids for names: ASCII letters, digits, ``_``, ``-`` and ``.``; all are different."""
    result: list[str] = []
    for name in names:
        plain = re.sub(r"[^\w.-]", "_", name, flags=re.ASCII)
        plain = plain if re.match(r"[^\W\d]", plain) else f"_{plain}"
        unique, number = plain, 1
        while unique in result:
            number += 1
            unique = f"{plain}_{number}"
        result.append(unique)
    return result


def path_data(boundary: Boundary) -> str:
    """Attribute ``d`` of a boundary: for each path M, C with all control points, Z."""
    parts = []
    for path in boundary.paths:
        points = [f"{_decimal(x, boundary.unit)},{_decimal(y, boundary.unit)}" for x, y in path]
        parts.append(f"M {points[0]} C {' '.join([*points[1:], points[0]])} Z")
    return " ".join(parts)


def _decimal(value: int, unit: int) -> str:
    """Decimal number `value` times 2**-unit; `unit` decimals hold it exactly."""
    whole = f"{int(value) / (1 << unit):.{unit}f}"
    return whole.rstrip("0").rstrip(".") if "." in whole else whole


def _mean_colour(picture: Picture, layer: Layer, engine: str, cache: Cache) -> str:
    """Mean colour of a layer in sRGB, ``#rrggbb``; black if no pixel is on the canvas."""
    region = region_of(picture, layer)
    width, height = (min(n, SWATCH) for n in region[2:])
    pixels: NDArray[np.float32] = render(
        picture, layers=[layer.name], region=region, width=width, height=height, dtype=np.float32,
        engine=engine, cache=cache,
    )  # fmt: skip
    alpha = pixels[..., 3:] if pixels.shape[2] == 4 else np.ones_like(pixels[..., :1])
    mean = (pixels[..., :3] * alpha).sum((0, 1)) / max(float(alpha.sum()), 1e-6)
    if not is_srgb(picture.blocks):
        mean = to_srgb(np.clip(mean, 0, 1)[None, None], picture.blocks)[0, 0]
    return "#" + "".join(f"{round(float(c) * 255):02x}" for c in mean)
