"""Import of outlines from SVG: takes the boundaries of layers from a file.

The file is one that `export.svg` wrote and that was edited by hand, or one like it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from ..errors import InputError, UnsupportedError
from ..export.svg import INKSCAPE, identifiers
from ..geometry.boundary import COORDINATE_MAX, Boundary
from ..io import xml
from ..limits import DEFAULT_LIMITS, Limits
from ..model import Layer, Picture, Pictured
from ..render.neighbours import present_outline
from .svg_shapes import Points, curves_of, page_of, shapes
from .svg_style import check_document, fill_rule, tag_of

OTHERS = ("text", "image", "line", "foreignObject")
"""Elements that are drawn and have no outline that could be taken."""

UNITS = (6, 5, 4)
"""Units of new boundaries, the finest first; the first in which all coordinates fit is taken."""

EXACT = 0.02
"""Distance, in a layer's own unit, at which a coordinate is taken as a multiple of that unit."""

_TOKEN = re.compile(r"[A-DF-Za-df-z]|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
"""A command or number of path data; a cubic curve has at most seven."""


def load(
    image: Pictured, data: bytes, name: str = "the SVG", limits: Limits = DEFAULT_LIMITS
) -> dict[str, Boundary]:
    """Reads the outlines in an SVG file, by the name of the layer that each belongs to.

    The page is the canvas. A shape belongs to the layer that its Inkscape label, id or title names.
    Transforms are applied, as attributes and in styles, and open paths are closed; lines, quadratic
    curves and arcs become cubic curves. Fills, strokes, opacity and visibility are not read.
    Coordinates that are multiples of the unit of a layer at rest keep that unit, so that an
    unchanged file gives identical control points. Two kinds of shapes are skipped: the rectangle of
    a layer that covers the whole canvas, and an unchanged outline of a layer that is not at rest,
    because no file can hold its unit.

    Args:
        image: The picture.
        data: The SVG file. Its outlines are in the present places of the layers.
        name: Name of the file in error messages.
        limits: Bounds on the number of segments.

    Raises:
        InputError: The file is not SVG, has no outlines, or has a shape that belongs to no layer or
            cannot be a boundary.
        UnsupportedError: The file has clones, nested documents, clips, masks, animations, style
            sheets that move or cut shapes, transforms of other kinds, or holes filled by the
            even-odd rule; or text, a picture or a line has the name of a layer.
        LimitError: The file has too many segments.
    """
    picture = image.picture
    root = xml.parse(data, name)
    if tag_of(root) != "svg":
        raise InputError(f"{name}: not an SVG file, its root element is {root.tag[:80]!r}")
    drawn = [e.get(key, "") for e in root.iter() for key in ("d", "points")]
    limits.check("segments", sum(1 for text in drawn for _ in _TOKEN.finditer(text)) // 7)
    check_document(root, data, name)
    known = _Known.of(picture)
    _check_others(root, known, name)
    page, size = page_of(root, picture, name)
    found: dict[str, Boundary | None] = {}
    for element, matrix, rule in shapes(root, page, name, fill_rule(root, "nonzero")):
        layer = _layer_of(element, known, name)
        where = f"{name}: layer {layer.name!r}"
        if layer.name in found:
            raise InputError(f"{where}: two shapes have its name; combine them into one path")
        curves = curves_of(element, size, where)
        with np.errstate(all="ignore"):  # what overflows is refused below
            curves = [c @ matrix[:2, :2].T + matrix[:2, 2] for c in curves]
        if len(curves) > 1 and rule == "evenodd":
            raise UnsupportedError(
                f"{where}: fill-rule evenodd is not supported; set it to nonzero and make its "
                "holes run the other way (in Inkscape: Path > Union)"
            )
        found[layer.name] = _boundary(curves, layer, picture, where)
        segments = sum(sum(b.segments) for b in found.values() if b is not None)
        limits.check("segments", segments)
    if not found:
        raise InputError(f"{name}: there is no path, so no outline of any layer")
    return {layer: boundary for layer, boundary in found.items() if boundary is not None}


class _Known(NamedTuple):
    """Layers by their names and by the ids that the export gives them."""

    by_name: Mapping[str, Layer]
    by_id: Mapping[str, Layer]

    @classmethod
    def of(cls, picture: Picture) -> _Known:
        names = [layer.name for layer in picture.layers]
        by_name = {xml.text(layer.name): layer for layer in picture.layers}
        return cls(by_name, dict(zip(identifiers(names), picture.layers, strict=True)))

    def named(self, element: Element) -> Layer | None:
        """Layer that the label, id or title of an element names, or None."""
        label, id_ = element.get(f"{{{INKSCAPE}}}label", ""), element.get("id", "")
        for key, known in (
            (label, self.by_name), (id_, self.by_id), (id_, self.by_name),
            (_title(element), self.by_name),
        ):  # fmt: skip
            if key in known:
                return known[key]
        return None


def _title(element: Element) -> str:
    return next((child.text or "" for child in element if tag_of(child) == "title"), "")


def _layer_of(element: Element, known: _Known, name: str) -> Layer:
    """Layer that the label, id or title of a shape names.

    Raises:
        InputError: They name no layer.
    """
    layer = known.named(element)
    if layer is not None:
        return layer
    label = element.get(f"{{{INKSCAPE}}}label") or element.get("id") or _title(element)
    names = ", ".join(repr(layer.name) for layer in known.by_id.values())
    raise InputError(
        f"{name}: {tag_of(element)} {label!r} has the name of no layer; delete it, or label it "
        f"with one of {names}"
    )


def _check_others(root: Element, known: _Known, name: str) -> None:
    """Refuses text, pictures and lines that are named like layers: they are no outlines."""
    for element in root.iter():
        if tag_of(element) in OTHERS and known.named(element) is not None:
            raise UnsupportedError(
                f"{name}: {tag_of(element)} {element.get('id', '')!r} has the name of a layer, but "
                "cannot be an outline; make it a path"
            )


def _boundary(curves: list[Points], layer: Layer, picture: Picture, where: str) -> Boundary | None:
    """Converts curves on the canvas to a boundary; None for a shape that `load` skips.

    Raises:
        InputError: The curves cannot be the boundary of the layer.
    """
    points = np.concatenate(curves) if curves else np.zeros((0, 2))
    if not np.isfinite(points).all():
        raise InputError(f"{where}: a coordinate is not a finite number")
    present = present_outline(picture, layer)
    most = float(np.abs(points).max(initial=0))
    units = [u for u in UNITS if most * (1 << u) < COORDINATE_MAX - 0.5]
    if present is not None and most * (1 << present.unit) < COORDINATE_MAX - 0.5:
        own = points * (1 << present.unit)
        if present.unit < UNITS[0] and np.abs(own - np.rint(own)).max(initial=0) < EXACT:
            units.insert(0, present.unit)
    if not units:
        raise InputError(f"{where}: a coordinate of {most:g} pixels is out of range")
    result = _in_unit(units[0], curves)
    if not result.paths:
        raise InputError(f"{where}: its path is empty; draw an outline, or delete it")
    if present is None:
        sides = picture.width << result.unit, picture.height << result.unit
        corners = {(x, y) for x in (0, sides[0]) for y in (0, sides[1])}
        if {(int(x), int(y)) for p in result.paths for x, y in p[::3]} == corners:
            return None
        if picture.opaque and layer is picture.layers[0]:
            raise InputError(f"{where}: the back layer covers the whole canvas and stays so")
    elif present.unit > UNITS[0] and same(_in_unit(present.unit, curves), present):
        return None
    return result


def _in_unit(unit: int, curves: list[Points]) -> Boundary:
    """Boundary of curves float64 [3 m + 1, 2] in canvas pixels; single points are left out."""
    paths = []
    for curve in curves:
        path = np.rint(curve * (1 << unit)).astype(np.int64)
        if (path != path[0]).any():
            closed = (path[0] == path[-1]).all()
            paths.append(path[:-1] if closed else np.concatenate([path, path[[-1, 0]]]))
    return Boundary(unit, tuple(paths))


def same(one: Boundary, other: Boundary) -> bool:
    """Whether two outlines have the same control points; their units may differ."""
    return one.segments == other.segments and all(
        (p << other.unit == q << one.unit).all()
        for p, q in zip(one.paths, other.paths, strict=True)
    )
