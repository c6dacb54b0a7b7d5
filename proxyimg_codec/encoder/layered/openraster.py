"""Reader of OpenRaster files (.ora), as Krita, GIMP and MyPaint write them.

It follows the OpenRaster baseline (https://www.openraster.org/baseline/, 0.0.5).
"""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ...errors import InputError, LimitError, UnsupportedError
from ...io import xml
from ...io.raster import parse as parse_picture
from ...limits import DEFAULT_LIMITS, Limits
from .blending import MODE, MODES, merged
from .nodes import Node, Patch, layered_picture
from .source import Colours, LayeredPicture, check_limit, printable

NORMAL = "svg:src-over"


def is_openraster(data: bytes) -> bool:
    """Whether a file is marked as OpenRaster, by an uncompressed first entry with its type."""
    return data[:4] == b"PK\3\4" and data[30:].startswith(b"mimetypeimage/openraster")


def read_openraster(
    data: bytes, name: str, limits: Limits = DEFAULT_LIMITS, blend: str = "flatten"
) -> LayeredPicture:
    """Reads an OpenRaster file.

    Groups are flattened: each layer takes the opacity of its groups. The result differs from the
    original where layers of a translucent group overlap. Layers with a blending mode are flattened
    with what lies behind them, and those that are hidden are left out.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages.
        limits: Bounds on the number of layers, the pixels and the bytes of each entry.
        blend: ``flatten``, or ``refuse`` to refuse layers with a blending mode.

    Raises:
        InputError: The file is not OpenRaster or damaged, or no layer has a visible pixel.
        UnsupportedError: The file has layers that are not PNG, or what can be seen of it has a
            blending mode that is not known or may not be flattened, or is no layer; or psd-tools,
            which knows the modes, is not installed.
        LimitError: The file exceeds `limits`.
    """
    archive = _opened(data, name)
    root = xml.parse(_entry(archive, "stack.xml", name, xml.BYTES_MAX), f"{name}: stack.xml")
    if root.tag != "image" or root.find("stack") is None:
        raise InputError(f"{name}: stack.xml holds no stack of layers")
    width, height = (_integer(root, key, f"{name}: the canvas") for key in ("w", "h"))
    if min(width, height) < 1:
        raise InputError(f"{name}: the canvas of {width}x{height} is empty")
    check_limit(limits, "side", max(width, height), name)
    check_limit(limits, "output_pixels", width * height, name)
    reader = _Reader(archive, name, limits)
    nodes = reader.nodes(root.findall("stack/*"), _Around())
    size = (width, height)

    def merge(below: Sequence[Node], scope: Node | None) -> Patch:
        return merged(below, size, name)

    found = layered_picture(nodes, size, blend, merge, limits, name)
    return replace(found, blocks=dict(reader.colours.blocks or {}))


class _Around(NamedTuple):
    """Attributes that the elements of a stack inherit.

    Attributes:
        x: Canvas column that positions count from.
        y: Canvas row that positions count from.
        groups: Names of the groups around them.
        shown: Whether these are all visible.
    """

    x: int = 0
    y: int = 0
    groups: tuple[str, ...] = ()
    shown: bool = True


class _Reader:
    """Reader of the layers of an archive.

    Attributes:
        archive: The file.
        name: Its name in messages.
        limits: Bounds on the pixels and the bytes of each entry.
        colours: Colours of the layers read so far.
    """

    def __init__(self, archive: zipfile.ZipFile, name: str, limits: Limits) -> None:
        self.archive, self.name, self.limits = archive, name, limits
        self.colours = Colours()

    def nodes(self, elements: Sequence[Element], around: _Around) -> tuple[Node, ...]:
        """Layers and groups of a stack, back to front, of elements front to back.

        Raises:
            InputError: An attribute makes no sense.
        """
        # What has a namespace is an extension, which readers may ignore.
        known = [e for e in elements if not e.tag.startswith("{")]
        return tuple(self._node(element, around) for element in known)[::-1]

    def _node(self, element: Element, around: _Around) -> Node:
        where = f"{self.name}: {element.tag} {element.get('name', '')!r}"
        x = around.x + _integer(element, "x", where, "0")
        y = around.y + _integer(element, "y", where, "0")
        mode = element.get("composite-op", NORMAL)
        node = Node(
            printable(element.get("name", "")),
            around.groups,
            _opacity(element, where),
            element.get("visibility", "visible") == "hidden",
            "" if mode == NORMAL else f"{MODE}{mode.removeprefix('svg:')}",
            _problem(element, mode),
        )
        shown = around.shown and node.shows
        if node.problem or (node.blend and not shown):
            return node  # left out, or refused
        if element.tag == "stack":
            inner = _Around(x, y, (*around.groups, node.name or "group"), shown)
            automatic = element.get("isolation", "auto") == "auto"
            isolated = not automatic or node.opacity < 1 or mode != NORMAL
            return replace(node, children=self.nodes(list(element), inner), isolated=isolated)
        source = element.get("src")
        if source is None:
            raise InputError(f"{where}: has no src, so no pixels")
        return replace(node, draw=partial(self._drawn, source, x, y))

    def _drawn(self, source: str, x: int, y: int, where: str) -> Patch:
        """Reads the pixels of a layer."""
        png = _entry(self.archive, source, where, self.limits.file_bytes)
        check_limit(self.limits, "output_pixels", _png_pixels(png, where, self.limits), where)
        picture = parse_picture(png, f"{where}: {source}")
        return Patch(self.colours.adopted(picture, where), x, y)


def _opened(data: bytes, name: str) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error) as error:  # new ZIP
        raise InputError(f"{name}: not an OpenRaster file ({error})") from None


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


def _problem(element: Element, mode: str) -> str:
    """Returns why an element of a stack cannot be imported if it shows; nothing if it can."""
    if element.tag not in ("layer", "stack"):
        return f"{element.tag}: only layers and stacks of them can be imported"
    if mode == NORMAL or mode.removeprefix("svg:") in MODES:
        return ""
    return (
        f"composite-op {mode!r} is not known; set the blending mode to normal, merge the layer "
        "with those below it, or hide it"
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


def _png_pixels(png: bytes, where: str, limits: Limits) -> int:
    """Number of pixels in the header of a PNG file; its sides are checked before it is decoded."""
    if png[:8] != b"\x89PNG\r\n\x1a\n" or png[12:16] != b"IHDR" or len(png) < 33:
        raise UnsupportedError(f"{where}: its pixels are not a PNG file")
    width, height = struct.unpack(">II", png[16:24])
    check_limit(limits, "side", max(width, height), where)
    return int(width) * int(height)
