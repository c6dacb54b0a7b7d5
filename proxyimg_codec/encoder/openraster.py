"""Reader of OpenRaster files (.ora), as Krita, GIMP and MyPaint write them.

It follows the OpenRaster baseline (https://www.openraster.org/baseline/, 0.0.5).
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
from ..io.color import COLOUR
from ..io.raster import parse as parse_picture
from ..io.raster import stripped
from ..limits import DEFAULT_LIMITS, Limits
from .shapes.masks import unique_names

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
        blocks: Metadata blocks; `read_openraster` gives ``icc`` and ``cicp``, if there are such.
        left_out: Names of the layers without visible pixels, and of hidden layers and groups that
            cannot be imported.
    """

    width: int
    height: int
    layers: tuple[SourceLayer, ...]
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def is_openraster(data: bytes) -> bool:
    """Whether a file is marked as OpenRaster, by an uncompressed first entry with its type."""
    return data[:4] == b"PK\3\4" and data[30:].startswith(b"mimetypeimage/openraster")


def read_openraster(data: bytes, name: str, limits: Limits = DEFAULT_LIMITS) -> LayeredPicture:
    """Reads an OpenRaster file.

    Groups are flattened: each layer takes the opacity of its groups. The result differs from the
    original where layers of a translucent group overlap.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages.
        limits: Bounds on the number of layers, the pixels and the bytes of each entry.

    Raises:
        InputError: The file is not OpenRaster or damaged, or no layer has a visible pixel.
        UnsupportedError: The file has layers that are not PNG, or what can be seen of it has a
            blend mode other than source-over or is no layer.
        LimitError: The file exceeds `limits`.
    """
    archive = _opened(data, name)
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
    blocks: dict[str, bytes] | None = None
    pixels = 0
    for unique, (layer, source) in zip(names, found, strict=True):
        if source is None:
            left_out.append(unique)
            continue
        where = f"{name}: layer {unique!r}"
        png = _entry(archive, source, where, limits.file_bytes)
        pixels += _png_pixels(png, where, limits)
        _check(limits, "output_pixels", pixels, f"{where}, with those behind it")
        picture = parse_picture(png, f"{where}: {source}")
        colours = {k: v for k, v in picture.blocks.items() if k in COLOUR}
        blocks = colours if blocks is None else blocks
        if colours != blocks and blocks:
            raise UnsupportedError(
                f"{where}: its colour profile is not that of the layers behind it; give all layers "
                "the same"
            )
        picture = picture if colours == blocks else stripped(picture)
        placed = _clipped(replace(layer, name=unique, pixels=picture.pixels), width, height)
        if placed is None:
            left_out.append(unique)
        else:
            layers.append(placed)
    if not layers:
        raise InputError(f"{name}: no layer has a pixel on the canvas of {width}x{height}")
    return LayeredPicture(width, height, tuple(layers), blocks or {}, tuple(left_out))


def _opened(data: bytes, name: str) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error) as error:  # new ZIP
        raise InputError(f"{name}: not an OpenRaster file ({error})") from None


def _check(limits: Limits, name: str, value: int, where: str) -> None:
    try:
        limits.check(name, value)
    except LimitError as error:
        raise LimitError(f"{where}: {error}") from None


def _entry(archive: zipfile.ZipFile, path: str, where: str, most: int) -> bytes:
    """Reads an entry of the archive; raises `LimitError` if it has more than `most` bytes."""
    try:
        info = archive.getinfo(path)
        if info.file_size > most:
            raise LimitError(f"{where}: {path} has {info.file_size} bytes, more than {most}")
        return archive.read(info)
    except KeyError:
        raise InputError(f"{where}: {path!r} is not in the file") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:
        # A RuntimeError says that the entry is encrypted or needs an unknown decompressor.
        raise InputError(f"{where}: {path} is damaged ({error})") from None


def _walk(
    elements: Sequence[Element], around: SourceLayer, name: str
) -> Iterator[tuple[SourceLayer, str | None]]:
    """Yields the layers of a stack, front to back, without pixels.

    Args:
        elements: Elements of the stack.
        around: Position, opacity, visibility and groups that the layers inherit.
        name: Name of the file in error messages.

    Yields:
        A layer, with its own name that need not be unique, and the entry that holds its pixels;
        None for what shows nothing and could not be imported if it did.

    Raises:
        InputError: An attribute makes no sense.
        UnsupportedError: Something that shows is no layer, or has a blend mode.
    """
    for element in elements:
        if element.tag.startswith("{"):
            continue  # an extension, which readers may ignore
        where = f"{name}: {element.tag} {element.get('name', '')!r}"
        placed = replace(
            around,
            name=element.get("name", ""),
            x=around.x + _integer(element, "x", where, "0"),
            y=around.y + _integer(element, "y", where, "0"),
            opacity=around.opacity * _opacity(element, where),
            hidden=around.hidden or element.get("visibility", "visible") == "hidden",
        )
        problem = _unsupported(element)
        if problem and not (placed.hidden or placed.opacity == 0):
            raise UnsupportedError(f"{where}: {problem}")
        if problem:
            yield placed, None
        elif element.tag == "stack":
            groups = (*around.groups, _printable(placed.name) or "group")
            yield from _walk(list(element), replace(placed, groups=groups), name)
        else:
            source = element.get("src")
            if source is None:
                raise InputError(f"{where}: has no src, so no pixels")
            yield placed, source


def _unsupported(element: Element) -> str:
    """Returns why an element of a stack cannot be imported; nothing if it can."""
    if element.tag not in ("layer", "stack"):
        return "only layers and stacks of them can be imported"
    blend = element.get("composite-op", "svg:src-over")
    if blend == "svg:src-over":
        return ""
    return (
        f"composite-op {blend!r} is not supported, only svg:src-over; set the blending mode to "
        "normal, merge the layer with those below it, or hide it"
    )


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
    """Replaces characters of a name that cannot be shown by spaces, and shortens it."""
    return "".join(c if c.isprintable() else " " for c in name).strip()[:NAME_MAX].strip()


def _png_pixels(png: bytes, where: str, limits: Limits) -> int:
    """Number of pixels in the header of a PNG file; its sides are checked before it is decoded."""
    if png[:8] != b"\x89PNG\r\n\x1a\n" or png[12:16] != b"IHDR" or len(png) < 33:
        raise UnsupportedError(f"{where}: its pixels are not a PNG file")
    width, height = struct.unpack(">II", png[16:24])
    _check(limits, "side", max(width, height), where)
    return int(width) * int(height)


def _clipped(layer: SourceLayer, width: int, height: int) -> SourceLayer | None:
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
