"""Reading of OpenRaster files (.ora), as Krita, GIMP and MyPaint write them.

Follows the OpenRaster baseline (https://www.openraster.org/baseline/, 0.0.5).
"""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, LimitError, UnsupportedError
from ..io import xml
from ..io.raster import parse as parse_picture
from ..limits import DEFAULT_LIMITS, Limits
from .shapes.masks import unique_names

NAME_MAX = 200
"""Characters of a layer's name before a number that makes it unique."""


@dataclass(frozen=True, eq=False)
class SourceLayer:
    """A layer of a layered picture.

    Attributes:
        name: Unique and printable.
        pixels: [h, w, 1..4] uint8 or uint16, straight alpha, clipped to the canvas.
        x: Column of its left edge, 0..canvas width - 1.
        y: Row of its upper edge.
        opacity: 0..1, those of its groups multiplied in.
        hidden: Whether it, or a group that it is in, is switched off.
        groups: Names of the groups that it is in, outermost first.
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
    """Layers back to front on a canvas.

    Attributes:
        width: Canvas width in pixels.
        height: Canvas height.
        layers: Those with anything in them, back to front.
        blocks: Metadata: the ICC profile, if there is one.
        left_out: Names of the layers without a pixel that could be seen.
    """

    width: int
    height: int
    layers: tuple[SourceLayer, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def is_openraster(data: bytes) -> bool:
    """Whether a file says that it is OpenRaster: its first entry is its type, not compressed."""
    return data[:4] == b"PK\3\4" and data[30:].startswith(b"mimetypeimage/openraster")


def read_openraster(data: bytes, name: str, limits: Limits = DEFAULT_LIMITS) -> LayeredPicture:
    """Reads an OpenRaster file in memory, called `name` in messages.

    Groups are flattened: their opacity goes to each of their layers, which differs from the
    original where layers of a translucent group overlap.

    Raises:
        InputError: Not an OpenRaster file, damaged, or nothing in it to be seen.
        UnsupportedError: It needs more than layers of PNG composited with source-over.
        LimitError: It exceeds `limits`.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error) as error:
        raise InputError(f"{name}: not an OpenRaster file ({error})") from None
    root = xml.parse(_entry(archive, "stack.xml", name, xml.BYTES_MAX), f"{name}: stack.xml")
    if root.tag != "image" or root.find("stack") is None:
        raise InputError(f"{name}: stack.xml holds no stack of layers")
    width, height = (_integer(root, key, f"{name}: the canvas") for key in ("w", "h"))
    if min(width, height) < 1:
        raise InputError(f"{name}: the canvas of {width}x{height} is empty")
    _check(limits, "side", max(width, height), name)
    _check(limits, "output_pixels", width * height, name)
    found = list(_walk(root.findall("stack/*"), SourceLayer("", np.zeros(0), 0, 0), name))[::-1]
    _check(limits, "layers", len(found), name)
    names = unique_names(
        _printable(layer.name) or f"layer {k + 1}" for k, (layer, _) in enumerate(found)
    )
    layers: list[SourceLayer] = []
    left_out: list[str] = []
    blocks: dict[str, bytes] = {}
    pixels = 0
    for unique, (layer, source) in zip(names, found, strict=True):
        where = f"{name}: layer {unique!r}"
        png = _entry(archive, source, where, limits.file_bytes)
        pixels += _png_pixels(png, where, limits)
        _check(limits, "output_pixels", pixels, f"{where}, with those behind it")
        picture = parse_picture(png, f"{where}: {source}")
        blocks = blocks or {k: v for k, v in picture.blocks.items() if k == "icc"}
        placed = _clipped(replace(layer, name=unique, pixels=picture.pixels), width, height)
        if placed is None:
            left_out.append(unique)
        else:
            layers.append(placed)
    if not layers:
        raise InputError(f"{name}: no layer has a pixel on the canvas of {width}x{height}")
    return LayeredPicture(width, height, tuple(layers), blocks, tuple(left_out))


def _check(limits: Limits, name: str, value: int, where: str) -> None:
    try:
        limits.check(name, value)
    except LimitError as error:
        raise LimitError(f"{where}: {error}") from None


def _entry(archive: zipfile.ZipFile, path: str, where: str, most: int) -> bytes:
    """The bytes of a file in the archive, at most `most`."""
    try:
        info = archive.getinfo(path)
        if info.file_size > most:
            raise LimitError(f"{where}: {path} has {info.file_size} bytes, more than {most}")
        return archive.read(info)
    except KeyError:
        raise InputError(f"{where}: {path!r} is not in the file") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:
        # RuntimeError: it is encrypted, or compressed in a way that Python cannot undo.
        raise InputError(f"{where}: {path} is damaged ({error})") from None


def _walk(
    elements: Sequence[Element], around: SourceLayer, name: str
) -> Iterator[tuple[SourceLayer, str]]:
    """Layers without pixels, and where these are, front to back; `around` has what they inherit."""
    for element in elements:
        if element.tag.startswith("{"):
            continue  # an extension, which readers are free not to know
        where = f"{name}: {element.tag} {element.get('name', '')!r}"
        if element.tag not in ("layer", "stack"):
            raise UnsupportedError(f"{where}: only layers and stacks of them can be imported")
        blend = element.get("composite-op", "svg:src-over")
        if blend != "svg:src-over":
            raise UnsupportedError(
                f"{where}: composite-op {blend!r} is not supported, only svg:src-over; set the "
                "blending mode to normal, or merge the layer with those below it"
            )
        placed = replace(
            around,
            name=element.get("name", ""),
            x=around.x + _integer(element, "x", where, "0"),
            y=around.y + _integer(element, "y", where, "0"),
            opacity=around.opacity * _opacity(element, where),
            hidden=around.hidden or element.get("visibility", "visible") == "hidden",
        )
        if element.tag == "stack":
            groups = (*around.groups, _printable(placed.name) or "group")
            yield from _walk(list(element), replace(placed, groups=groups), name)
        else:
            source = element.get("src")
            if source is None:
                raise InputError(f"{where}: has no src, so no pixels")
            yield placed, source


def _integer(element: Element, key: str, where: str, default: str = "") -> int:
    value = element.get(key, default)
    try:
        return int(value)
    except ValueError:
        raise InputError(f"{where}: {key} is {value[:40]!r}, not a whole number") from None


def _opacity(element: Element, where: str) -> float:
    value = element.get("opacity", "1")
    try:
        opacity = float(value)
    except ValueError:
        opacity = math.nan
    if not 0 <= opacity <= 1:
        raise InputError(f"{where}: opacity is {value[:40]!r}, not a number in 0..1")
    return opacity


def _printable(name: str) -> str:
    """`name` with spaces in place of characters that cannot be shown, and cut."""
    return "".join(c if c.isprintable() else " " for c in name).strip()[:NAME_MAX].strip()


def _png_pixels(png: bytes, where: str, limits: Limits) -> int:
    """Pixels that a PNG file declares, checked before they are decoded."""
    if png[:8] != b"\x89PNG\r\n\x1a\n" or png[12:16] != b"IHDR" or len(png) < 33:
        raise UnsupportedError(f"{where}: its pixels are not a PNG file")
    width, height = struct.unpack(">II", png[16:24])
    _check(limits, "side", max(width, height), where)
    return int(width) * int(height)


def _clipped(layer: SourceLayer, width: int, height: int) -> SourceLayer | None:
    """The layer within the canvas, or None if nothing of it is there."""
    rows, columns = layer.pixels.shape[:2]
    x0, y0 = max(-layer.x, 0), max(-layer.y, 0)
    x1, y1 = min(width - layer.x, columns), min(height - layer.y, rows)
    if x0 >= x1 or y0 >= y1:
        return None
    pixels = layer.pixels[y0:y1, x0:x1]
    if pixels.shape[2] in (2, 4) and not pixels[..., -1].any():
        return None
    return replace(layer, pixels=pixels, x=layer.x + x0, y=layer.y + y0)
