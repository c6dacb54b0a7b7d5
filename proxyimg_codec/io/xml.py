"""Safe parsing of untrusted XML: no document type, so no entities; bounded size and depth."""

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
    """Parses an XML document, and returns its root element.

    Args:
        data: The document.
        name: Name of the document in error messages.

    Raises:
        InputError: The document is not well-formed, has a DOCTYPE, or is nested deeper than
            `DEPTH_MAX`.
        LimitError: The document is larger than `BYTES_MAX`.
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
    """Returns `value` with every character that XML cannot hold replaced by U+FFFD."""
    return _NOT_XML.sub("\ufffd", value)


def serialize(root: ElementTree.Element) -> bytes:
    """Returns the document of `root` in UTF-8, indented."""
    ElementTree.indent(root, " ")
    document: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return document + b"\n"
