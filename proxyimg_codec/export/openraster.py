"""A picture as OpenRaster (.ora): one PNG a layer, hidden parts included.

Follows the OpenRaster baseline (https://www.openraster.org/baseline/, 0.0.5), which Krita, GIMP
and MyPaint open. The layers composite to the rendered picture with plain source-over.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..io import xml
from ..io.raster import encode_png
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Layer, Pictured
from ..render.cache import Cache
from ..render.pixels import render
from .common import at_full_opacity, chosen_layers, opacity_text, region_of

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
    """The bytes of an OpenRaster file.

    Layers are rendered visible and at full opacity, clipped to the canvas, and cropped to the
    pixels that are not empty; visibility and opacity are attributes.

    Args:
        image: The picture.
        layers: Names or positions of the layers to write; all by default.
        background: Whether to write the back layer of an opaque picture.
        dtype: uint8 or uint16 samples.
        engine: As in `render.pixels.render`.
        limits: Bounds each rendering.
        progress: Called with 1 after each layer.

    Raises:
        UsageError: An unknown layer, none at all, or another `dtype`.
        LimitError: The canvas is too large.
    """
    picture = image.picture
    chosen = chosen_layers(picture, layers, background)
    icc = {k: v for k, v in picture.blocks.items() if k == "icc"}
    draw = partial(render, engine=engine, limits=limits, cache=Cache())
    width, height = picture.size
    parts = {"mimetype": b"image/openraster"}
    size = {"w": str(width), "h": str(height), "xres": "72", "yres": "72"}
    root = ElementTree.Element("image", {"version": "0.0.5", **size})
    stack = ElementTree.SubElement(root, "stack")
    full = at_full_opacity(picture)
    for k, layer in reversed(list(enumerate(chosen))):
        region = region_of(picture, layer)
        pixels, x, y = _cropped(draw(full, layers=[layer.name], region=region, dtype=dtype))
        source = f"data/layer{k}.png"
        parts[source] = encode_png(pixels, icc)
        attributes = _attributes(layer, source, region[0] + x, region[1] + y)
        ElementTree.SubElement(stack, "layer", attributes)
        if progress:
            progress(1)
    parts["stack.xml"] = xml.serialize(root)
    shown = [layer.name for layer in chosen if not layer.pose.hidden]

    def flat(width: int, height: int, dtype: Any) -> NDArray[Any]:
        if not shown:
            return np.zeros((height, width, 4), dtype)
        return draw(picture, layers=shown, width=width, height=height, dtype=dtype)

    parts["mergedimage.png"] = encode_png(flat(width, height, dtype), icc)
    shrink = min(1.0, THUMBNAIL_SIDE / max(width, height))
    small = flat(max(round(width * shrink), 1), max(round(height * shrink), 1), np.uint8)
    parts["Thumbnails/thumbnail.png"] = encode_png(small, icc)
    return _zipped(parts)


def _attributes(layer: Layer, source: str, x: int, y: int) -> dict[str, str]:
    """What stack.xml says of a layer whose pixels lie at x, y."""
    return {
        "name": xml.text(layer.name),
        "src": source,
        "x": str(x),
        "y": str(y),
        "opacity": opacity_text(layer),
        "visibility": "hidden" if layer.pose.hidden else "visible",
        "composite-op": "svg:src-over",
    }


def _cropped(pixels: NDArray[Any]) -> tuple[NDArray[Any], int, int]:
    """The smallest rectangle with all that is not transparent, and its x and y."""
    if pixels.shape[2] == 3:
        return pixels, 0, 0
    solid = pixels[..., 3] > 0
    rows, columns = np.flatnonzero(solid.any(1)), np.flatnonzero(solid.any(0))
    if not len(rows):
        return pixels[:1, :1], 0, 0
    y, x = int(rows[0]), int(columns[0])
    return pixels[y : rows[-1] + 1, x : columns[-1] + 1], x, y


def _zipped(parts: dict[str, bytes]) -> bytes:
    """A ZIP archive in the given order, the same bytes whenever it is made."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in parts.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            kind = zipfile.ZIP_DEFLATED if name.endswith(".xml") else zipfile.ZIP_STORED
            archive.writestr(entry, data, kind)
    return buffer.getvalue()
