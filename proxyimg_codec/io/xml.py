"""XML from strangers: no document type, so no entities; bounded in size and depth."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from ..errors import InputError, LimitError

BYTES_MAX = 1 << 24
DEPTH_MAX = 64

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def parse(data: bytes, name: str) -> ElementTree.Element:
    """The root element of an XML document called `name` in messages.

    Raises:
        InputError: Not well-formed XML, a DOCTYPE, or nested deeper than `DEPTH_MAX`.
        LimitError: Larger than `BYTES_MAX`.
    """
    if len(data) > BYTES_MAX:
        raise LimitError(f"{name}: {len(data)} bytes of XML exceed the limit of {BYTES_MAX}")
    depth = 0

    def start(*_: Any) -> None:
        nonlocal depth
        depth += 1
        if depth > DEPTH_MAX:
            raise InputError(f"{name}: elements are nested deeper than {DEPTH_MAX}")

    def end(*_: Any) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: Any) -> None:
        raise InputError(f"{name}: has a DOCTYPE, which could hide anything; remove that line")

    scan = expat.ParserCreate()
    scan.StartElementHandler, scan.EndElementHandler = start, end
    scan.StartDoctypeDeclHandler = doctype
    try:
        scan.Parse(data, True)
        return ElementTree.fromstring(data)
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{name}: not valid XML ({error})") from None


def text(value: str) -> str:
    """`value` with every character that XML cannot hold replaced by U+FFFD."""
    return _NOT_XML.sub("\ufffd", value)


def serialize(root: ElementTree.Element) -> bytes:
    """The document of `root`, indented."""
    ElementTree.indent(root, " ")
    document: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return document + b"\n"
