"""Export to OpenRaster (.ora): one PNG file for each layer, hidden parts included.

The files follow the OpenRaster baseline (https://www.openraster.org/baseline/, 0.0.5), which Krita,
GIMP and MyPaint open. With plain source-over compositing, the layers give the rendered picture.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..io import xml
from ..io.color import COLOUR
from ..io.png import encode_png
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Layer, Picture, Pictured
from ..render.cache import Cache
from ..render.pixels import render
from .common import Draw, chosen_layers, opacity_text, sheets

THUMBNAIL_SIDE = 256


def build(
    image: Pictured,
    *,
    layers: Sequence[str | int] | None = None,
    background: bool = True,
    dtype: Any = np.uint8,
    engine: str = "auto",
    limits: Limits = DEFAULT_LIMITS,
    progress: Callable[[int], None] | None = None,
) -> bytes:
    """Bytes of an OpenRaster file.

    Layers are rendered visible and at full opacity, clipped to the canvas, and cropped to the
    pixels that are not empty; visibility and opacity are attributes.

    Args:
        image: The picture.
        layers: Names or positions of the layers to write; all by default.
        background: Whether to write the back layer of an opaque picture.
        dtype: uint8 or uint16, type of the samples.
        engine: As in `render.pixels.render`.
        limits: Bounds on each rendering.
        progress: Called with 1 after each layer.

    Raises:
        UsageError: A layer is unknown, none is left, or `dtype` is another type.
        LimitError: The canvas is too large.
    """
    picture = image.picture
    chosen = chosen_layers(picture, layers, background)
    draw = partial(render, engine=engine, limits=limits, cache=Cache())
    drawn = _layers(picture, chosen, partial(draw, dtype=dtype), progress or (lambda count: None))
    flat = _flat(picture, [v.name for v in chosen if not v.pose.hidden], draw, dtype)
    return _zipped({"mimetype": b"image/openraster", **drawn, **flat})


def _layers(
    picture: Picture, chosen: Sequence[Layer], draw: Draw, progress: Callable[[int], None]
) -> dict[str, bytes]:
    """Files of the layers, front to back, and stack.xml, which lists them."""
    width, height = picture.size
    size = {"w": str(width), "h": str(height), "xres": "72", "yres": "72"}
    root = ElementTree.Element("image", {"version": "0.0.5", **size})
    stack = ElementTree.SubElement(root, "stack")
    parts = {}
    for k, sheet in enumerate(sheets(picture, chosen[::-1], draw), 1):
        source = f"data/layer{len(chosen) - k}.png"
        parts[source] = encode_png(sheet.pixels, _profile(picture))
        attributes = _attributes(sheet.layer, source, sheet.x, sheet.y)
        ElementTree.SubElement(stack, "layer", attributes)
        progress(1)
    return {**parts, "stack.xml": xml.serialize(root)}


def _flat(picture: Picture, shown: list[str], draw: Draw, dtype: Any) -> dict[str, bytes]:
    """Files of the flat picture of the layers `shown`, and of its thumbnail."""

    def png(width: int, height: int, dtype: Any) -> bytes:
        if shown:
            pixels = draw(picture, layers=shown, width=width, height=height, dtype=dtype)
        else:
            pixels = np.zeros((height, width, 4), dtype)
        return encode_png(pixels, _profile(picture))

    width, height = picture.size
    shrink = min(1.0, THUMBNAIL_SIDE / max(width, height))
    small = max(round(width * shrink), 1), max(round(height * shrink), 1)
    return {
        "mergedimage.png": png(width, height, dtype),
        "Thumbnails/thumbnail.png": png(*small, np.uint8),
    }


def _profile(picture: Picture) -> dict[str, bytes]:
    """Metadata for PNG files: what says the colour, if anything does."""
    return {k: v for k, v in picture.blocks.items() if k in COLOUR}


def _attributes(layer: Layer, source: str, x: int, y: int) -> dict[str, str]:
    """Attributes in stack.xml of a layer whose pixels begin at x, y."""
    return {
        "name": xml.text(layer.name),
        "src": source,
        "x": str(x),
        "y": str(y),
        "opacity": opacity_text(layer),
        "visibility": "hidden" if layer.pose.hidden else "visible",
        "composite-op": "svg:src-over",
    }


def _zipped(parts: dict[str, bytes]) -> bytes:
    """ZIP archive of files in the given order; its bytes do not depend on the time."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in parts.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            kind = zipfile.ZIP_DEFLATED if name.endswith(".xml") else zipfile.ZIP_STORED
            archive.writestr(entry, data, kind)
    return buffer.getvalue()
