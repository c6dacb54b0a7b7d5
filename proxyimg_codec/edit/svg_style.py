"""Styles and attributes of an SVG file that move or cut shapes: applied, or refused.

Fills, strokes, opacity and visibility are not read: only the outline of a shape is taken.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

from ..errors import InputError, UnsupportedError
from ..export.svg import NAMESPACE

MOVES = ("transform", "transform-origin", "transform-box", "translate", "rotate", "scale", "zoom",
         "-webkit-transform", "offset-path")  # fmt: skip
"""Properties that move shapes."""

CUTS = ("clip-path", "mask", "clip", "-webkit-mask", "-webkit-clip-path")
"""Properties that take something from shapes."""

FORMS = ("d", "x", "y", "width", "height", "cx", "cy", "r", "rx", "ry")
"""Properties that replace attributes of shapes."""

ANIMATIONS = ("animate", "animateTransform", "animateMotion", "set")

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_SEPARATOR = r"(?:\s*,\s*|\s+|(?=[-+]))"
_UNIT = "(?:px|mm|cm|in|pt|pc)"
_LENGTH = rf"(?:{_NUMBER}{_UNIT}|[-+]?0+)"
_ANGLE = rf"(?:{_NUMBER}(?:deg|grad|rad|turn)|[-+]?0+)"


def _grammar(*functions: tuple[str, str, int]) -> re.Pattern[str]:
    """Pattern of a list of functions, each given by its names, its argument and their number."""
    calls = (
        rf"(?:{names})\(\s*{argument}(?:{_SEPARATOR}{argument}){{{count - 1}}}\s*\)"
        for names, argument, count in functions
    )
    return re.compile(rf"\s*(?:(?:{'|'.join(calls)})[\s,]*)*")


_ATTRIBUTE = _grammar(
    ("matrix", _NUMBER, 6), ("translate|scale", _NUMBER, 1), ("translate|scale", _NUMBER, 2),
    ("rotate|skewX|skewY", _NUMBER, 1), ("rotate", _NUMBER, 3),
)  # fmt: skip
"""Transforms as an attribute: plain numbers."""

_STYLE = _grammar(
    ("matrix", _NUMBER, 6), ("scale|scaleX|scaleY", _NUMBER, 1), ("scale", _NUMBER, 2),
    ("translate|translateX|translateY", _LENGTH, 1), ("translate", _LENGTH, 2),
    ("rotate|skewX|skewY", _ANGLE, 1),
)  # fmt: skip
"""Transforms in a style: lengths and angles have units."""

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def tag_of(element: Element) -> str:
    """Local name of an SVG element; empty for elements of other namespaces."""
    namespace, _, local = element.tag.rpartition("}")
    return local if namespace in ("", "{" + NAMESPACE) else ""


def check_document(root: Element, data: bytes, name: str) -> None:
    """Refuses what acts on shapes from elsewhere in the file.

    Args:
        root: Root element of the file.
        data: The file.
        name: Name of the file in error messages.

    Raises:
        UnsupportedError: A style sheet moves or cuts shapes, or is outside the file; shapes are
            animated; or the root element is transformed.
    """
    if b"<?xml-stylesheet" in data:
        raise UnsupportedError(
            f"{name}: its style sheet is another file; write styles into the elements"
        )
    names = "|".join(map(re.escape, (*MOVES, *CUTS, *FORMS, "fill-rule")))
    for element in root.iter():
        tag = tag_of(element)
        if tag == "style":
            found = re.search(rf"(?:^|[{{;\s])({names})\s*:|@import", _text_of(element))
            if found:
                raise UnsupportedError(
                    f"{name}: its style sheet has {found[1] or found[0]!r}, which is not "
                    "supported there; write it into the elements as an attribute"
                )
        if tag in ANIMATIONS:
            raise UnsupportedError(f"{name}: {tag} is not supported; delete it")
    if any(_given(root, key) not in ("", "none") for key in MOVES):
        raise UnsupportedError(f"{name}: the svg element is transformed; transform a group in it")
    _check_cuts(root, f"{name}: svg {root.get('id', '')!r}")


def transform_of(element: Element, where: str) -> tuple[str, tuple[str, str]]:
    """Transform and its origin that an element asks for, by attribute or style.

    Args:
        element: A shape or group.
        where: Name of the file and the element in error messages.

    Returns:
        The list of transforms as in the attribute of SVG, where lengths and angles may have units;
        and x and y of its origin, numbers that may have units.

    Raises:
        UnsupportedError: The element is moved, cut or formed in a way that cannot be applied.
        InputError: The transform is malformed.
    """
    _check_cuts(element, where)
    styled = declarations(element)
    formed = [key for key in FORMS if key in styled]
    if formed:
        raise UnsupportedError(f"{where}: its style has {formed[0]!r}; make it an attribute")
    for key in MOVES[2:]:
        if _given(element, key) not in ("", "none", "view-box", "1"):
            raise UnsupportedError(
                f"{where}: {key} is not supported; apply it, or write it as a transform"
            )
    text, grammar = element.get("transform", ""), _ATTRIBUTE
    if "transform" in styled:
        text, grammar = styled["transform"], _STYLE
    text = "" if text.strip() == "none" else text
    if not grammar.fullmatch(text):
        kind = UnsupportedError if re.search(r"%|3[dD]|calc|var|[XYZ]\(|em\b", text) else InputError
        raise kind(f"{where}: the transform {text[:60]!r} cannot be read; apply it to the path")
    return text, _origin(element, where) if text.strip() else ("0", "0")


def _origin(element: Element, where: str) -> tuple[str, str]:
    """Point x, y that stays where it is when the transform of an element is applied."""
    text = _given(element, "transform-origin")
    if not text:
        return "0", "0"
    length = _LENGTH if "transform-origin" in declarations(element) else f"{_NUMBER}{_UNIT}?"
    found = re.fullmatch(rf"({length})(?:\s*,\s*|\s+)({length})", text)
    if not found:
        raise UnsupportedError(
            f"{where}: transform-origin {text[:60]!r} is not supported, only two lengths such as "
            "'8px 5px'"
        )
    return found[1], found[2]


def fill_rule(element: Element, inherited: str) -> str:
    """Rule by which an element, or what is in it, is filled: ``nonzero`` or ``evenodd``."""
    rule = _given(element, "fill-rule")
    return inherited if rule in ("", "inherit") else rule


def declarations(element: Element) -> dict[str, str]:
    """Declarations of the attribute ``style``: values by the name of the property."""
    found = {}
    for part in _COMMENT.sub("", element.get("style", "")).split(";"):
        key, _, value = part.partition(":")
        found[key.strip().lower()] = value.replace("!important", "").strip()
    return found


def _given(element: Element, key: str) -> str:
    """Value of a property: that of the style, else that of the attribute; empty if there is none.

    `d`, `x` and the like are no properties in this sense.
    """
    return declarations(element).get(key, element.get(key, "").strip())


def _check_cuts(element: Element, where: str) -> None:
    for key in CUTS:
        if _given(element, key) not in ("", "none", "auto"):
            raise UnsupportedError(
                f"{where}: {key} is not supported; release it (in Inkscape: Object > Clip > "
                "Release), and cut the path itself"
            )


def _text_of(element: Element) -> str:
    return _COMMENT.sub("", "".join(element.itertext()))
