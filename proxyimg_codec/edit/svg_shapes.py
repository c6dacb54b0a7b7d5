"""Shapes of an SVG file as cubic curves on the canvas of a picture.

The page of the file (its viewBox, otherwise width and height) is the canvas, in whatever unit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnsupportedError
from ..model import Picture
from .svg_style import fill_rule, tag_of, transform_of

try:
    import svgelements
except ImportError:
    raise UnsupportedError(
        "outlines from SVG need svgelements: pip install 'proxyimg-codec[svg]'"
    ) from None

Points = NDArray[np.float64]

SHAPES = ("path", "rect", "circle", "ellipse", "polygon", "polyline")
GROUPS = ("g", "a", "switch")
GEOMETRY = ("x", "y", "width", "height", "rx", "ry", "cx", "cy", "r", "points")

ASPECT = 0.005
"""Largest relative difference between the aspect ratios of page and canvas."""

_MALFORMED = (ValueError, AttributeError, TypeError, IndexError, KeyError, ArithmeticError)
"""Exceptions that svgelements raises on malformed data."""


def page_of(root: Element, picture: Picture, name: str) -> tuple[Points, tuple[float, float]]:
    """Transform from user units to canvas pixels, and the size of the page.

    Args:
        root: Root element of the file.
        picture: The picture whose canvas the page is.
        name: Name of the file in error messages.

    Returns:
        float64 [3, 3] transform; width and height of the page in user units.

    Raises:
        InputError: The file has no valid page, or one of another aspect ratio than the canvas.
    """
    try:
        if "viewBox" in root.attrib:
            x, y, width, height = map(float, re.split(r"[\s,]+", root.attrib["viewBox"].strip()))
        else:
            x = y = 0.0
            width, height = (
                _pixels(root.get(key, "100%"), default)
                for key, default in (("width", picture.width), ("height", picture.height))
            )
        scale = picture.width / width, picture.height / height
        good = all(map(math.isfinite, (x, y, *scale))) and min(scale) > 0
        stretch = _stretch(root, width / height)
    except _MALFORMED:
        good = False
    if not good:
        raise InputError(f"{name}: viewBox, width and height make no page")
    if abs(scale[0] / scale[1] - 1) > ASPECT:
        raise InputError(
            f"{name}: the page of {width:g}x{height:g} has another shape than the canvas of "
            f"{picture.width}x{picture.height}; set the page back"
        )
    if abs(stretch - 1) > ASPECT:
        raise InputError(
            f"{name}: width and height have another shape than the viewBox; make them alike"
        )
    matrix = np.diag([*scale, 1.0])
    matrix[:2, 2] = -scale[0] * x, -scale[1] * y
    return matrix, (width, height)


def _stretch(root: Element, aspect: float) -> float:
    """Aspect ratio of width and height relative to that of the viewBox; 1 if they do not say."""
    lengths = [root.get(key, "100%") for key in ("width", "height")]
    if any("%" in v or v.strip() == "auto" for v in lengths):
        return 1.0
    width, height = (_pixels(v, 0) for v in lengths)
    return width / height / aspect


def _pixels(length: str, whole: int) -> float:
    """Length in pixels at 96 pixels per inch; percentages are of `whole`."""
    if length.strip().endswith("%"):
        return float(length.strip()[:-1]) / 100 * whole
    return float(svgelements.Length(length).value(ppi=96))


def shapes(
    parent: Element, matrix: Points, name: str, rule: str = "nonzero"
) -> Iterator[tuple[Element, Points, str]]:
    """Finds all shapes that are drawn, and their transforms to the canvas.

    Args:
        parent: The element whose descendants are searched.
        matrix: float64 [3, 3] transform of `parent` to canvas pixels.
        name: Name of the file in error messages.
        rule: Rule by which `parent` is filled.

    Yields:
        Each shape, its transform, float64 [3, 3], and the rule by which it is filled.

    Raises:
        UnsupportedError: The file has clones, nested documents, or shapes that are moved or cut in
            a way that cannot be applied.
        InputError: A transform is malformed.
    """
    for element in parent:
        tag = tag_of(element)
        if tag in ("use", "svg"):
            raise UnsupportedError(
                f"{name}: element {tag} {element.get('id', '')!r} cannot be an outline; delete it, "
                "or make it a path (in Inkscape: unlink the clone)"
            )
        if tag not in SHAPES and tag not in GROUPS:
            continue
        if tag == "switch" and sum(tag_of(v) in (*SHAPES, *GROUPS) for v in element) > 1:
            raise UnsupportedError(f"{name}: switch is not supported; keep one of its choices")
        with np.errstate(all="ignore"):  # coordinates that overflow are refused later
            placed = matrix @ _own(element, f"{name}: {tag} {element.get('id', '')!r}")
        filled = fill_rule(element, rule)
        if tag in GROUPS:
            yield from shapes(element, placed, name, filled)
        else:
            yield element, placed, filled


def _own(element: Element, where: str) -> Points:
    """Transform float64 [3, 3] of an element itself."""
    text, origin = transform_of(element, where)
    try:
        x, y = (_pixels(v, 0) for v in origin)
        m = svgelements.Matrix(text)
        m.render(ppi=96)
    except _MALFORMED:
        raise InputError(f"{where}: the transform {text[:60]!r} cannot be read") from None
    there = np.array([[1, 0, x], [0, 1, y], [0, 0, 1]], np.float64)
    own = np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0, 0, 1]], np.float64)
    back = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1]], np.float64)
    placed: Points = there @ own @ back
    return placed


def curves_of(element: Element, size: tuple[float, float], where: str) -> list[Points]:
    """Cubic curves of a shape, one for each subpath, in user units; not yet closed.

    Args:
        element: The shape.
        size: Width and height of the page in user units, which percentages refer to.
        where: Name of the file and layer in error messages.

    Returns:
        float64 [3 m + 1, 2] for each subpath of m segments: its first point, then three control
        points for each segment.

    Raises:
        InputError: The shape is malformed.
    """
    try:
        path = _path(element, size)
        curves: list[list[Any]] = []
        drawing = False
        for segment in path:
            if isinstance(segment, svgelements.Close):
                drawing = False
                continue
            if isinstance(segment, svgelements.Move):
                curves.append([segment.end])
                drawing = True
                continue
            if not drawing:
                curves.append([segment.start])
                drawing = True
            curves[-1] += _cubics(segment)
        return [np.array([(p.x, p.y) for p in c], np.float64) for c in curves]
    except _MALFORMED:
        raise InputError(f"{where}: its {tag_of(element)} cannot be read; draw it anew") from None


def _path(element: Element, size: tuple[float, float]) -> Any:
    """Converts a shape to a path of svgelements, in user units."""
    tag = tag_of(element)
    if tag == "path":
        return svgelements.Path(element.get("d", ""))
    attributes = {k: element.attrib[k] for k in GEOMETRY if k in element.attrib}
    shape = getattr(svgelements, tag.title())(attributes)
    shape.render(ppi=96, width=size[0], height=size[1])
    return svgelements.Path(shape)


def _cubics(segment: Any) -> list[Any]:
    """Control points of a segment as cubic curves, without its start.

    The control points of a straight line are its ends.
    """
    a, b = segment.start, segment.end
    if isinstance(segment, svgelements.CubicBezier):
        return [segment.control1, segment.control2, b]
    if isinstance(segment, svgelements.QuadraticBezier):
        q = segment.control
        return [a + (q - a) * (2 / 3), b + (q - b) * (2 / 3), b]
    if isinstance(segment, svgelements.Arc):
        curves = list(segment.as_cubic_curves())
        if curves:
            return [p for c in curves for p in (c.control1, c.control2, c.end)]
    return [a, b, b]
