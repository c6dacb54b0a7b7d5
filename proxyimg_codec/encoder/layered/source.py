"""Layered pictures as all readers give them, and what the readers share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from numpy.typing import NDArray

from ...errors import LimitError, UnsupportedError
from ...io.color import COLOUR
from ...io.raster import Picture, stripped
from ...limits import Limits

NAME_MAX = 200
"""Most characters of a layer's name, without a number that makes it unique."""


@dataclass(frozen=True, eq=False)
class SourceLayer:
    """Layer of a layered picture.

    Attributes:
        name: Unique printable name.
        pixels: uint8 or uint16 [h, w, C] with C = 1 for grey, 2 for grey and alpha, 3 for RGB, 4
            for RGB and alpha; alpha is straight; nothing lies outside the canvas.
        x: Canvas column of the left edge, 0..canvas width - 1.
        y: Canvas row of the upper edge, 0..canvas height - 1.
        opacity: Opacity in 0..1, multiplied by those of the groups around the layer.
        hidden: Whether the layer, or a group around it, is switched off.
        groups: Names of the groups around the layer, outermost first.
    """

    name: str
    pixels: NDArray[Any]
    x: int
    y: int
    opacity: float = 1.0
    hidden: bool = False
    groups: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LayeredPicture:
    """Picture as layers on a canvas.

    Attributes:
        width: Width of the canvas in pixels.
        height: Height of the canvas in pixels.
        layers: Layers that are not empty, back to front.
        blocks: Metadata blocks, such as ``icc`` and ``cicp``.
        left_out: Names of the layers without visible pixels, and of hidden layers and groups that
            cannot be imported.
        notes: Remarks for the user: what was flattened, converted or not drawn.
    """

    width: int
    height: int
    layers: tuple[SourceLayer, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def printable(name: str) -> str:
    """Replaces characters of a name that cannot be shown by spaces, and shortens it."""
    return "".join(c if c.isprintable() else " " for c in name).strip()[:NAME_MAX].strip()


def check_limit(limits: Limits, name: str, value: int, where: str) -> None:
    """Raises `LimitError` that begins with `where` if `value` exceeds the limit called `name`."""
    try:
        limits.check(name, value)
    except LimitError as error:
        raise LimitError(f"{where}: {error}") from None


def clipped(layer: SourceLayer, width: int, height: int) -> SourceLayer | None:
    """Clips a layer to the canvas; returns None if nothing visible is left."""
    rows, columns = layer.pixels.shape[:2]
    x0, y0 = max(-layer.x, 0), max(-layer.y, 0)
    x1, y1 = min(width - layer.x, columns), min(height - layer.y, rows)
    if x0 >= x1 or y0 >= y1:
        return None
    pixels = layer.pixels[y0:y1, x0:x1]
    if pixels.shape[2] in (2, 4) and not pixels[..., -1].any():
        return None
    return replace(layer, pixels=pixels, x=layer.x + x0, y=layer.y + y0)


class Colours:
    """Colours of the layers of a picture, which all have those of the first one.

    Attributes:
        blocks: Blocks ``icc`` and ``cicp`` of the first layer; None before it was seen.
    """

    def __init__(self) -> None:
        self.blocks: Mapping[str, bytes] | None = None

    def adopted(self, picture: Picture, where: str) -> NDArray[Any]:
        """Pixels of a layer in the colours of the first; sRGB if that has no blocks.

        Raises:
            UnsupportedError: The layer has other colours than the first, which are not sRGB.
        """
        own = {k: v for k, v in picture.blocks.items() if k in COLOUR}
        self.blocks = own if self.blocks is None else self.blocks
        if own == self.blocks:
            return picture.pixels
        if self.blocks:
            raise UnsupportedError(
                f"{where}: its colour profile is not that of the layers behind it; give all layers "
                "the same"
            )
        return stripped(picture).pixels
