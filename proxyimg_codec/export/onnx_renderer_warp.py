"""Warp in the renderer as ONNX: texture points, MSH-30 to MSH-33."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.pose import inverse
from ..geometry.warp import Warp
from ..model import Layer
from .onnx_graph import Value

NEAR = 2.0**-26
"""Distance outside of a face, in canvas pixels, at which a sample still counts as on its edge."""

FAR = 2.0**40
"""Coordinate beyond any node, in canvas pixels."""

Reals = NDArray[np.float64]


class Shown(NamedTuple):
    """Texture points that samples on a layer show.

    Attributes:
        points: float64 [N, 2] texture points.
        face: int64 [N] face that each sample lies in, or None if no mesh was needed.
        weights: float64 [N, 3] barycentric weights in that face, or None.
    """

    points: Value
    face: Value | None = None
    weights: Value | None = None


def locate(layer: Layer, at: Value) -> Shown:
    """Texture points that a layer shows at canvas points float64 [N, 2]."""
    warp = Warp(layer.pose, layer.mesh, layer.sampling in (1, 2))
    if warp.meshed:
        return _on_faces(warp, layer, at)
    if not layer.pose.affine:
        return Shown(at)
    a, b, c, d, e, f = layer.pose.floats
    a, b, c, d, _, _ = inverse((a, b, c, d, 0, 0))
    x, y = (at - np.array([e, f])).split(2, 1)
    return Shown(at.graph.concat([x * a + y * c, x * b + y * d], 1))


def _on_faces(warp: Warp, layer: Layer, at: Value) -> Shown:
    """Texture points of samples on the faces of a mesh."""
    graph = at.graph
    face = _faces(warp, layer, at)
    x, y = at.split(2, 1)
    start_x, x_by_x, x_by_y, start_y, y_by_x, y_by_y = (
        graph.constant(v[:, None]).take(face) for v in warp._away
    )
    shift = [start_x + x_by_x * x + x_by_y * y, start_y + y_by_x * x + y_by_y * y]
    points = at + graph.concat(shift, 1)
    if layer.sampling not in (1, 2):
        return Shown(points, face)
    away = at - graph.constant(warp._corners[:, 0]).take(face)
    second, third = (
        (graph.constant(v).take(face) * away).reduced("Sum", 1).reshape(-1, 1)
        for v in (warp._second, warp._third)
    )
    return Shown(points, face, graph.concat([1 - second - third, second, third], 1))


def _faces(warp: Warp, layer: Layer, at: Value) -> Value:
    """Face of each sample, int64 [N] [MSH-31]."""
    graph, corners = at.graph, warp._corners
    edges = np.roll(corners, -1, 1) - corners
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    solid = np.flatnonzero(area)
    if not len(solid):
        solid = np.arange(1)  # the specification leaves open which face is shown
    turned = (area[solid] < 0) != layer.pose.mirrored
    order = solid[np.argsort(turned, kind="stable")]
    faces = _in_reach(graph.constant(_table(corners[order], edges[order], area[order], order)), at)
    *lines, _, _, _, _, number = faces.split(14, 0)  # [1, C]
    x, y = at.split(2, 1)
    sides = [x * lines[k] + y * lines[k + 1] + lines[k + 2] for k in (0, 3, 6)]
    inside = sides[0].minimum(sides[1]).minimum(sides[2])  # [N, C]
    holds = (inside >= -NEAR).astype(np.float32)
    first = graph.op("ArgMax", holds, dtype=np.int64, axis=1, keepdims=0)
    face = number.reshape(-1).take(first).astype(np.int64)
    lost = inside.reduced("Max", 1) < -NEAR

    def beyond() -> Value:
        away = [v - graph.constant(warp._centres[solid, k]) for k, v in enumerate((x, y))]
        squared = away[0] * away[0] + away[1] * away[1]  # [N, faces]
        nearest = graph.op("ArgMin", squared, dtype=np.int64, axis=1, keepdims=0)
        return graph.where(lost, graph.constant(solid).take(nearest), face)

    return graph.choose(lost.astype(np.float32).reduced("Max") > 0, beyond, lambda: face)


def _table(corners: Reals, edges: Reals, area: Reals, number: NDArray[np.int64]) -> Reals:
    """Table of faces; its first column holds no sample and is in reach of every sample.

    Returns:
        float64 [14, 1 + faces]: for each of three edges a, b and c, with a x + b y + c the distance
        of x, y to the inner side; x0, y0, x1, y1 of the bounding box; number of the face.
    """
    length = np.maximum(np.hypot(edges[..., 0], edges[..., 1]), np.finfo(float).tiny)
    scale = np.sign(area)[:, None] / length
    a, b = -edges[..., 1] * scale, edges[..., 0] * scale
    c = -(a * corners[..., 0] + b * corners[..., 1])
    lines = np.stack([a, b, c], 2).reshape(-1, 9)
    around = [corners.min(1) - NEAR, corners.max(1) + NEAR]
    found = np.concatenate([lines, *around, number[:, None]], 1)
    nothing = np.array([[0, 0, -1] * 3 + [-FAR, -FAR, FAR, FAR, 0]])
    return np.concatenate([nothing, found]).T


def _in_reach(faces: Value, at: Value) -> Value:
    """Faces whose bounding box meets that of the samples."""
    low, high = at.reduced("Min", 0), at.reduced("Max", 0)
    near = (faces.take(9) <= high.take(0)) & (faces.take(10) <= high.take(1))
    near = near & (faces.take(11) >= low.take(0)) & (faces.take(12) >= low.take(1))
    return faces.compressed(near, 1)
