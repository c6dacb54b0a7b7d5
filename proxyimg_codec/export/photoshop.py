"""Export to Photoshop (.psd): one pixel layer for each layer, hidden parts included.

psd-tools writes the file; wider or higher than 30,000 pixels it is of the large kind (.psb).
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from ..errors import UnsupportedError
from ..io.color import is_srgb, to_srgb
from ..io.samples import rounded
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Pictured
from ..render.cache import Cache
from ..render.pixels import render
from .common import chosen_layers, opacity, sheets

_WHITE = 255
"""What lies behind the layers in the flat picture that such a file holds, too."""


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
    """Bytes of a Photoshop file.

    Layers are rendered visible and at full opacity, clipped to the canvas, and cropped to the
    pixels that are not empty; visibility and opacity, in 255 steps, are theirs. An ICC profile goes
    along; pixels with other colours are converted to sRGB.

    Args:
        image: The picture.
        layers: Names or positions of the layers to write; all by default.
        background: Whether to write the back layer of an opaque picture.
        dtype: uint8 or uint16, type of the samples.
        engine: As in `render.pixels.render`.
        limits: Bounds on each rendering.
        progress: Called with 1 after each layer.

    Raises:
        UsageError: A layer is unknown, or none is left.
        LimitError: The canvas is too large.
        UnsupportedError: psd-tools is not installed.
    """
    try:
        tools = import_module("psd_tools")
    except ModuleNotFoundError:
        raise UnsupportedError(
            "writing .psd needs psd-tools: pip install 'proxyimg-codec[psd]'"
        ) from None
    picture = image.picture
    chosen = chosen_layers(picture, layers, background)
    draw = partial(render, engine=engine, limits=limits, cache=Cache(), dtype=dtype)
    document = tools.PSDImage.new("RGB", picture.size, _WHITE, 8 * np.dtype(dtype).itemsize)
    blocks = dict(picture.blocks)
    profile = None if "cicp" in blocks else blocks.get("icc")
    for sheet in sheets(picture, chosen, draw):
        pixels = sheet.pixels
        if profile is None and not is_srgb(blocks):
            pixels = rounded(to_srgb(pixels, blocks), dtype)
        made = document.create_pixel_layer_from_array(
            pixels, top=sheet.y, left=sheet.x, opacity=round(255 * opacity(sheet.layer))
        )
        made.name = sheet.layer.name
        made.visible = not sheet.layer.pose.hidden
        if progress is not None:
            progress(1)
    if profile is not None:
        resources = import_module("psd_tools.psd.image_resources")
        key = import_module("psd_tools.constants").Resource.ICC_PROFILE
        document.image_resources[key] = resources.ImageResource(key=key, data=profile)
    out = io.BytesIO()
    document.save(out)
    return out.getvalue()
