"""Operations on the geometry of layers: place, shape and boundary (ProxyImg, equation 4)."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..geometry import mesher
from ..geometry.boundary import COORDINATE_MAX, Boundary
from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import NODE_BITS, NODE_MAX, Matrix, Pose, fixed, inverse, product
from ..geometry.warp import WEIGHT_BITS, barycentric
from ..io.files import read_bytes
from ..model import Layer, Picture
from ..render.neighbours import present_outline
from . import deform
from .operations import layer_named, members, operation, substituted

REST_UNIT = 6
"""Unit of boundaries that are mapped from the present place of a layer back to rest."""

PINS_MAX = 120
"""Most points of an outline that are held when a control point takes the inside along."""

BESIDE = 1.0
"""Distance from a mesh in pixels up to which a point counts as on its layer."""

Pair = Sequence[float]
_SCALE = 1 << FRACTION_BITS

TARGET = "layer: a layer's name or position, or a group's name"
PIVOT = "pair?: a canvas point x, y; by default the centre of the layer or group"


def centre(picture: Picture, layers: Sequence[Layer]) -> tuple[float, float]:
    """Centre of the bounding box of layers, in canvas pixels; a multiple of 1/2048.

    Sums of such coordinates are exact, so that mirroring twice about the centre is exact, too.
    """
    x0, y0, x1, y1 = bounds(picture, layers)
    return round((x0 + x1) * _SCALE) / (2 * _SCALE), round((y0 + y1) * _SCALE) / (2 * _SCALE)


def bounds(picture: Picture, layers: Sequence[Layer]) -> tuple[float, float, float, float]:
    """Bounding box x0, y0, x1, y1 of points along the present outlines, in canvas pixels."""
    points = []
    for layer in layers:
        shape = present_outline(picture, layer)
        if shape is None:
            points.append(np.array([[0, 0], picture.size], float))
        else:
            points.append(sampled(shape))
    every = np.concatenate(points)
    (x0, y0), (x1, y1) = every.min(0).tolist(), every.max(0).tolist()
    return x0, y0, x1, y1


def sampled(boundary: Boundary) -> NDArray[np.float64]:
    """Points along a boundary, 16 per segment, float64 [16 S, 2] in canvas pixels; exact."""
    t = np.arange(16) / 16
    weights = np.stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3])
    parts = []
    for path in boundary.paths:
        p = np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)], 1)
        parts.append(np.einsum("kt,skd->std", weights, p.astype(float)).reshape(-1, 2))
    return np.asarray(np.concatenate(parts) / (1 << boundary.unit))


def mapped(
    picture: Picture, target: str | int, matrix: Matrix, pivot: Pair | None, what: str
) -> Picture:
    """Applies an affine map about a pivot to a layer and its followers, or to a group.

    Args:
        picture: The picture.
        target: Name or position of a layer, or name of a group.
        matrix: a, b, c, d, e, f of the map, in canvas pixels.
        pivot: Canvas point that is the origin of the map; by default the centre of the layer or
            group.
        what: Name of the operation in error messages.

    Raises:
        UsageError: A layer would become singular, too large, or too far away.
    """
    layers = members(picture, target)
    if pivot is None:
        # If other layers follow a layer, the pivot is the centre of that layer alone.
        single = not (isinstance(target, str) and target in picture.groups)
        pivot = centre(picture, [layer_named(picture, target)] if single else layers)
    x, y = pivot
    about = product((1, 0, 0, 1, x, y), product(matrix, (1, 0, 0, 1, -x, -y)))
    moved = []
    for layer in layers:
        values = fixed(product(about, layer.pose.floats))
        if values is None:
            raise UsageError(
                f"{what}: layer {layer.name!r} would become singular, more than 127 times as "
                "large, or leave the range of coordinates"
            )
        moved.append(replace(layer, pose=replace(layer.pose, matrix=values[0], shift=values[1])))
    return substituted(picture, moved)


@operation("move", layer=TARGET, by="pair: dx, dy in canvas pixels")
def move(picture: Picture, layer: str | int, by: Pair) -> Picture:
    """Moves a layer; there and back is exact."""
    dx, dy = (round(v * _SCALE) for v in by)
    moved = []
    for each in members(picture, layer):
        e, f = each.pose.shift
        pose = replace(each.pose, shift=(e + dx, f + dy))
        if fixed(pose.floats) is None:
            raise UsageError(f"move: layer {each.name!r} would leave the range of coordinates")
        moved.append(replace(each, pose=pose))
    return substituted(picture, moved)


@operation("rotate", layer=TARGET, degrees="number: an angle, clockwise", pivot=PIVOT)
def rotate(
    picture: Picture, layer: str | int, degrees: float, pivot: Pair | None = None
) -> Picture:
    """Turns a layer."""
    turns, rest = divmod(degrees, 90)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns % 4)):  # quarter turns are exact
        c, s = -s, c
    return mapped(picture, layer, (c, s, -s, c, 0, 0), pivot, "rotate")


@operation("scale", layer=TARGET, by="pair: factors across and down", pivot=PIVOT)
def scale(picture: Picture, layer: str | int, by: Pair, pivot: Pair | None = None) -> Picture:
    """Makes a layer larger or smaller."""
    return mapped(picture, layer, (by[0], 0, 0, by[1], 0, 0), pivot, "scale")


@operation("shear", layer=TARGET, by="pair: growth of x a pixel of y, and of y a pixel of x",
           pivot=PIVOT)  # fmt: skip
def shear(picture: Picture, layer: str | int, by: Pair, pivot: Pair | None = None) -> Picture:
    """Slants a layer."""
    return mapped(picture, layer, (1, by[1], by[0], 1, 0, 0), pivot, "shear")


@operation("affine", layer=TARGET, matrix="matrix: a, b, c, d, e, f as in SVG", pivot=PIVOT)
def affine(
    picture: Picture, layer: str | int, matrix: Sequence[float], pivot: Pair | None = None
) -> Picture:
    """Maps a layer by x' = a x + c y + e, y' = b x + d y + f, about the pivot."""
    a, b, c, d, e, f = matrix
    return mapped(picture, layer, (a, b, c, d, e, f), pivot, "affine")


@operation("flip", layer=TARGET, axis="axis: horizontal or vertical", pivot=PIVOT)
def flip(
    picture: Picture, layer: str | int, axis: str = "horizontal", pivot: Pair | None = None
) -> Picture:
    """Mirrors a layer; twice is exact."""
    across, down = (-1, 1) if axis == "horizontal" else (1, -1)
    return mapped(picture, layer, (across, 0, 0, down, 0, 0), pivot, "flip")


def meshed(picture: Picture, layer: Layer) -> Layer:
    """Returns a layer with a mesh: its own, or one that is derived from its shape."""
    if layer.mesh is not None:
        return layer
    return replace(layer, mesh=mesher.derived(layer.boundary, picture.size))


@operation(
    "drag",
    layer="layer: a layer's name or position",
    handles="handles: a list of 1 to 500 x, y, dx, dy: points of the layer and where they go",
)
def drag(picture: Picture, layer: str | int, handles: Sequence[Sequence[float]]) -> Picture:
    """Bends a layer so that points of it move; a point with 0, 0 stays.

    One point alone moves the whole layer. A point outside the layer takes the nearest one inside
    along, which is logged as a warning.
    """
    chosen = meshed(picture, layer_named(picture, layer))
    assert chosen.mesh is not None, "`meshed` gives it one"
    refined, pose = chosen.mesh.refined, chosen.pose
    values = np.array(handles, float)
    present = pose.present(refined) / _SCALE
    rest = pose.apply(refined.nodes) / _SCALE
    moved = deform.drag(present, refined.faces, values[:, :2], values[:, :2] + values[:, 2:], rest)
    _warn_of_points_outside(chosen, values, deform.distances(present, refined.faces, values[:, :2]))
    return substituted(picture, [replace(chosen, pose=_bent(chosen, moved, "drag"))])


def _warn_of_points_outside(
    layer: Layer, handles: NDArray[np.float64], distances: NDArray[np.float64]
) -> None:
    """Logs which of the handles [H, 4] of a drag are how many pixels [H] away from the layer."""
    outside = np.flatnonzero(distances > BESIDE)
    if len(outside):
        x, y = handles[outside[0], :2]
        more = f" and {len(outside) - 1} more" if len(outside) > 1 else ""
        logging.getLogger(__name__).warning(
            "drag: %g,%g%s outside of %r, by %.3g pixels: its nearest point goes along",
            x, y, more, layer.name, distances[outside[0]],
        )  # fmt: skip


def _bent(layer: Layer, present: NDArray[np.float64], what: str) -> Pose:
    """Pose that brings the nodes of a layer to present positions float64 [N, 2] in pixels.

    `what` is the name of the operation in error messages.

    Raises:
        UsageError: A displacement would be out of range.
    """
    assert layer.mesh is not None, "what bends has a mesh"
    pose = layer.pose
    a, b, c, d, e, f = inverse(pose.floats)
    x, y = present.T
    back = np.stack([a * x + c * y + e, b * x + d * y + f], axis=1)
    away = back - layer.mesh.refined.nodes / _SCALE
    nodes = np.rint(away * (1 << NODE_BITS))
    if not (np.abs(nodes) < NODE_MAX).all():
        raise UsageError(f"{what}: layer {layer.name!r} would leave the range of coordinates")
    return replace(pose, nodes=nodes.astype(np.int64) if nodes.any() else None)


@operation("point", layer="layer: a layer's name or position",
           path="integer: a path of the boundary, counted from 0",
           point="integer: a control point of the path, counted from 0",
           by="pair: dx, dy in canvas pixels",
           follow="flag?: whether the inside goes along, as if it were dragged there")  # fmt: skip
def point(
    picture: Picture, layer: str | int, path: int, point: int, by: Pair, follow: bool = False
) -> Picture:
    """Moves one control point of a boundary; the inside may follow.

    Without `follow` the point moves in steps of the boundary's unit, and texture appears or
    disappears there. With it the layer is bent: the proxy nodes, and so the texture, follow the
    point as rigidly as possible, while the rest of the outline stays.

    Raises:
        UsageError: There is no such point, or something would leave the range of coordinates.
    """
    chosen = layer_named(picture, layer)
    shape = chosen.boundary
    if shape is None:
        raise UsageError(f"point: layer {chosen.name!r} has no boundary")
    if not 0 <= path < len(shape.paths):
        raise UsageError(f"point: layer {chosen.name!r} has paths 0..{len(shape.paths) - 1}")
    points = shape.paths[path]
    if not 0 <= point < len(points):
        raise UsageError(f"point: path {path} has control points 0..{len(points) - 1}")

    def shaped(step: NDArray[np.int64]) -> Boundary:
        paths = list(shape.paths)
        paths[path] = points.copy()
        paths[path][point] += step
        return Boundary(shape.unit, tuple(paths))

    if follow:
        new = _followed(meshed(picture, chosen), shaped(np.array([1, 0])), by)
        return substituted(picture, [new])
    a, b, c, d, _, _ = inverse(chosen.pose.floats)
    step = np.array([a * by[0] + c * by[1], b * by[0] + d * by[1]]) * (1 << shape.unit)
    if not (np.abs(points[point] + step) < COORDINATE_MAX).all():
        raise UsageError("point: the control point would leave the range of coordinates")
    boundary = shaped(np.rint(step).astype(np.int64))
    return substituted(picture, [replace(chosen, boundary=boundary)])


def _followed(layer: Layer, moved: Boundary, by: Pair) -> Layer:
    """Bends a layer with a mesh so that its outline takes a shape, and the inside goes along.

    Points along the outline are the handles. Those in triangles that have a node in common with
    that of the point which moves most go along freely, since that one is to arrive.

    Args:
        layer: The layer, with a mesh.
        moved: Its boundary with one control point moved by (1, 0) in its unit.
        by: How far this point is to move, dx, dy in canvas pixels.
    """
    assert layer.boundary is not None, "it has a control point"
    assert layer.mesh is not None, "`meshed` gives it one"
    refined, pose = layer.mesh.refined, layer.pose
    rest = sampled(layer.boundary)
    share = (sampled(moved) - rest)[:, 0] * (1 << moved.unit)
    face, weights = barycentric(
        np.rint(rest * _SCALE).astype(np.int64), refined.nodes, refined.faces
    )
    corners = refined.faces[face]
    now = pose.present(refined) / _SCALE
    places = (weights[..., None] * now[corners]).sum(1) / (1 << WEIGHT_BITS)
    first = int(share.argmax())
    away = np.hypot(*(places - places[first]).T)
    held = ~np.isin(corners, corners[first]).any(1)
    if not held.any():  # in so coarse a mesh all that can stay is what is farthest away
        held = away == away.max()
    still = np.flatnonzero(held & (share == 0))
    still = still[:: max(-(-len(still) // PINS_MAX), 1)]
    handles = np.array([first, *np.flatnonzero(held & (share > 0)), *still])
    targets = places[handles] + share[handles, None] * np.array(by)
    base = pose.apply(refined.nodes) / _SCALE
    bent = deform.drag(now, refined.faces, places[handles], targets, base)
    return replace(layer, pose=_bent(layer, bent, "point"))


@operation("outlines", source="text: the name of an SVG file, whose paths name layers")
def outlines(picture: Picture, source: str) -> Picture:
    """Takes the boundaries of layers from an SVG file, such as `pxi-decode` writes."""
    from .outlines import load, same

    new = []
    for name, shape in load(picture, read_bytes(source), source).items():
        layer = layer_named(picture, name)
        outline = present_outline(picture, layer)
        if outline is None or not same(shape, outline):
            new.append(replace(layer, boundary=_at_rest(layer, shape)))
    return substituted(picture, new)


def _at_rest(layer: Layer, shape: Boundary) -> Boundary:
    """Boundary whose outline, in the pose of a layer, is `shape`.

    Raises:
        UsageError: The layer is bent, or the boundary leaves the range of coordinates.
    """
    pose = layer.pose
    if pose.nodes is not None:
        raise UsageError(f"outlines: layer {layer.name!r} is bent; undo that first")
    if not pose.affine:
        return shape
    a, b, c, d, e, f = inverse(pose.floats)
    paths = []
    for path in shape.paths:
        x, y = (path / (1 << shape.unit)).T
        points = np.stack([a * x + c * y + e, b * x + d * y + f], axis=1) * (1 << REST_UNIT)
        if not (np.abs(points) < COORDINATE_MAX).all():
            raise UsageError(f"outlines: layer {layer.name!r} would leave the range of coordinates")
        paths.append(np.rint(points).astype(np.int64))
    return Boundary(REST_UNIT, tuple(paths))
