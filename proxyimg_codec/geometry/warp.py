"""Warp of a posed layer: its boundary in the present place, and the texture points of samples."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..limits import Budget
from .boundary import Boundary
from .mesh import FRACTION_BITS, Mesh
from .pose import NODE_BITS, Pose, inverse
from .raster import rasterize

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

PIECE = 4 << FRACTION_BITS
"""Length of the pieces of a bent boundary, about 4 canvas pixels, in 1/1024."""

PIECES_LOG2_MAX = 6
"""Base-2 logarithm of the most pieces of a segment."""

GRID_BITS = 22
"""Bits of the extent of a mesh above which positions are coarsened to compute weights."""

WEIGHT_BITS, WEIGHT_MAX = 16, 1 << 20
"""Fractional bits of barycentric weights, and the bound to which they are clamped."""

BATCH = 1 << 21
"""Pairs of points and triangles handled at a time, which bounds memory."""

RUN = 48
"""Control points that are located together, because neighbours on a path lie in few faces."""


def outline(
    boundary: Boundary | None, pose: Pose, mesh: Mesh | None, size: tuple[int, int]
) -> Boundary | None:
    """Brings the boundary of a layer to its present place.

    Args:
        boundary: Boundary at rest; None for the whole canvas.
        pose: Pose of the layer.
        mesh: Mesh of the layer; needed if the pose displaces nodes.
        size: Width and height of the canvas in pixels.

    Returns:
        The boundary, in 1/1024 canvas pixel if the pose moves it, otherwise `boundary` itself; None
        if the layer covers everything.
    """
    if not pose.affine and not pose.displaced:
        return boundary
    if boundary is None:
        boundary = rectangle(size)
    if not pose.displaced:
        up = FRACTION_BITS - boundary.unit
        return Boundary(FRACTION_BITS, tuple(pose.apply(p << up) for p in boundary.paths))
    assert mesh is not None, "displaced nodes need a mesh"
    ride = _ride(boundary, mesh)
    moved = ride.points + ride.displacement(pose.displacements)
    parts = np.split(pose.apply(moved), np.cumsum(ride.lengths)[:-1])
    return Boundary(FRACTION_BITS, tuple(parts))


@functools.lru_cache(maxsize=64)
def rectangle(size: tuple[int, int]) -> Boundary:
    """Canvas as a path of four straight segments, whose inner control points are its corners."""
    w, h = size
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]], np.int64)
    after = np.roll(corners, -1, 0)
    return Boundary(0, (np.stack([corners, corners, after], axis=1).reshape(-1, 2),))


@dataclass(frozen=True, eq=False)
class _Riders:
    """Control points of a boundary that follow a mesh.

    Attributes:
        points: int64 [n, 2] positions at rest in 1/1024 canvas pixel.
        nodes: int32 [n, 3] nodes of the face of each point.
        weights: int64 [n, 3] barycentric weights in that face, in 2**-16.
        lengths: Number of points of each path.
    """

    points: Ints
    nodes: NDArray[np.int32]
    weights: Ints
    lengths: list[int]

    def displacement(self, nodes: Ints) -> Ints:
        """Displacements [n, 2] of the points for those [N, 2] of all nodes, rounded half up."""
        total = (self.weights[..., None] * nodes[self.nodes]).sum(1)
        rounded: Ints = (total + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS
        return rounded


@functools.lru_cache(maxsize=64)
def _ride(boundary: Boundary, mesh: Mesh) -> _Riders:
    """Divides a boundary into short pieces, and attaches their control points to a mesh."""
    paths = [divide(p << (FRACTION_BITS - boundary.unit)) for p in boundary.paths]
    points = np.concatenate(paths)
    refined = mesh.refined
    face, weights = barycentric(points, refined.nodes, refined.faces)
    return _Riders(points, refined.faces[face], weights, [len(p) for p in paths])


def divide(path: Ints) -> Ints:
    """Divides each segment of a path into 2**k pieces of equal parameter.

    k is the smallest number, at most `PIECES_LOG2_MAX`, for which no coordinate of the four control
    points of the segment spans more than `PIECE` * 2**k. The new control points are blossoms
    (polar forms) of the curve, rounded down.

    Args:
        path: int64 [3 m, 2] control points in 1/1024 canvas pixel.

    Returns:
        int64 [3 n, 2] control points of the same path in n pieces.
    """
    p = np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)], 1)
    span = (p.max(1) - p.min(1)).max(1)
    k = np.zeros(len(p), np.int64)
    for _ in range(PIECES_LOG2_MAX):
        k += span > PIECE << k
    k = np.minimum(k, PIECES_LOG2_MAX)
    count = 1 << k
    segment = np.repeat(np.arange(len(p)), count)
    i = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    q, n, shift = p[segment], count[segment][:, None], 3 * k[segment][:, None]
    near, far = i[:, None], i[:, None] + 1

    def blossom(*times: Ints) -> Ints:
        points = [q[:, j] for j in range(4)]
        for t in times:
            points = [(n - t) * a + t * b for a, b in pairwise(points)]
        return points[0] >> shift

    parts = [blossom(near, near, near), blossom(near, near, far), blossom(near, far, far)]
    return np.stack(parts, axis=1).reshape(-1, 2)


def barycentric(
    points: Ints, nodes: Ints, faces: NDArray[np.int32], budget: Budget | None = None
) -> tuple[NDArray[np.int64], Ints]:
    """Finds the face that holds each point, and barycentric weights, in integer arithmetic.

    A point belongs to the first face whose three edge functions are not negative. A point beyond
    the mesh belongs to the first of the faces with the nearest centroid.

    Args:
        points: int64 [n, 2] in 1/1024 canvas pixel.
        nodes: int64 [N, 2] in 1/1024 canvas pixel.
        faces: int32 [F, 3] nodes of each face.
        budget: Running budget, whose `beyond` bounds the comparisons; by default a new one.

    Returns:
        int64 [n] face of each point, and int64 [n, 3] weights in 2**-16, which add up to 2**16.

    Raises:
        LimitError: There are too many points and faces, or too many points beyond the mesh.
    """
    low = nodes.min(0)
    extent = int((nodes.max(0) - low).max())
    shift = max(extent.bit_length() - GRID_BITS, 0)
    grid = (nodes - low) >> shift
    at = np.clip((points - low) >> shift, -(1 << GRID_BITS), 1 << (GRID_BITS + 1))
    corners = grid[faces]  # [F, 3, 2]
    first, last = corners.min(1), corners.max(1)
    face = np.full(len(points), -1, np.int64)
    budget = budget or Budget()
    budget.check("beyond", -(-len(points) // RUN) * len(faces))
    for start in range(0, len(points), RUN):
        part = at[start : start + RUN]
        near = np.flatnonzero(
            ((first <= part.max(0)) & (last >= part.min(0))).all(1)
        )  # ascending, so that the first of them is the first of all
        if len(near):
            inside = np.ones((len(part), len(near)), bool)
            for i, j in ((0, 1), (1, 2), (2, 0)):
                inside &= _side(corners[near, i], corners[near, j], part[:, None]) >= 0
            found = near[inside.argmax(1)]
            face[start : start + RUN] = np.where(inside.any(1), found, -1)
    lost = np.flatnonzero(face < 0)
    budget.check("beyond", len(lost) * len(faces))
    face[lost] = nearest(3 * at[lost], corners.sum(1))
    a, b, c = (corners[face, i] for i in range(3))
    area = np.maximum(_side(a, b, c), 1)
    weights = [
        np.clip((_side(p, q, at) << WEIGHT_BITS) // area, -WEIGHT_MAX, WEIGHT_MAX)
        for p, q in ((c, a), (a, b))
    ]
    rest = (1 << WEIGHT_BITS) - weights[0] - weights[1]
    return face, np.stack([rest, *weights], axis=1)


def _side(a: Ints, b: Ints, p: Ints) -> Ints:
    """Twice the signed area of the triangle a, b, p."""
    along, to = b - a, p - a
    return along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]


def nearest(points: NDArray[Any], centres: NDArray[Any]) -> NDArray[np.int64]:
    """Index int64 [n] of the centre [m, 2] nearest to each point [n, 2]; the first in a tie."""
    out = np.zeros(len(points), np.int64)
    per = max(BATCH // len(centres), 1)
    for start in range(0, len(points), per):
        part = points[start : start + per, None]
        out[start : start + per] = ((centres - part) ** 2).sum(2).argmin(1)
    return out


class Located(NamedTuple):
    """Texture points of samples on a posed layer.

    Attributes:
        x: float64 [n] x of the texture point of each sample, in canvas pixels at rest.
        y: float64 [n] y of the texture point.
        face: int64 [n] face that the sample lies in, or the nearest; None if no mesh was needed.
        weights: float64 [n, 3] barycentric weights of the sample in that face, or None.
    """

    x: Floats
    y: Floats
    face: NDArray[np.int64] | None = None
    weights: Floats | None = None


class Warp:
    """Map from canvas points to texture points of a layer.

    Args:
        pose: Pose of the layer.
        mesh: Mesh of the layer; only used if the pose is bent, or `meshed` is set.
        meshed: Whether faces and barycentric weights are wanted in any case.
        budget: Running budget of the rendering, which bounds how often the mesh covers samples, and
            how many samples lie beyond it; by default a new one.
    """

    def __init__(
        self,
        pose: Pose,
        mesh: Mesh | None,
        meshed: bool = False,
        budget: Budget | None = None,
    ) -> None:
        self._pose, self._budget = pose, budget or Budget()
        self._mesh = mesh if pose.bent or meshed else None
        if self._mesh is None:
            return
        refined = self._mesh.refined
        scale = 1 << FRACTION_BITS
        present = pose.present(refined) / scale
        shown = refined.nodes / scale
        if pose.places is not None:
            shown = shown + pose.places / (1 << NODE_BITS)
        self._corners = present[refined.faces]
        offset = (shown - present)[refined.faces]
        a, b, c = (self._corners[:, i] for i in range(3))
        ab, ac = b - a, c - a
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        solid = (area != 0)[:, None]
        self._centres = np.where(solid, self._corners.mean(1), np.inf)
        safe = np.where(solid, area[:, None], 1)
        # Weights of b and c at a point p are linear in p - a.
        self._second = np.stack([ac[:, 1], -ac[:, 0]], 1) / safe
        self._third = np.stack([-ab[:, 1], ab[:, 0]], 1) / safe
        to_b, to_c = offset[:, 1] - offset[:, 0], offset[:, 2] - offset[:, 0]
        # In each face, the offset from a point p to its texture point is affine in p. Offsets
        # instead of positions keep points that did not move exactly where they were.
        by_x, by_y = (
            to_b * self._second[:, k, None] + to_c * self._third[:, k, None] for k in (0, 1)
        )
        start = offset[:, 0] - by_x * a[:, :1] - by_y * a[:, 1:]
        self._away = [np.ascontiguousarray(v[:, k]) for k in (0, 1) for v in (start, by_x, by_y)]
        self._weighing = meshed

    @property
    def meshed(self) -> bool:
        """Whether `locate` needs the faces of the samples."""
        return self._mesh is not None

    def faces(
        self, origin: Floats, scale: Floats, box: tuple[int, int, int, int]
    ) -> NDArray[np.int32]:
        """Finds the face of the mesh at each sample of a rectangle.

        Args:
            origin: [2] canvas point of the corner of the sample grid.
            scale: [2] samples per canvas pixel, across and down.
            box: Rectangle x, y, w, h in samples.

        Returns:
            int32 [h, w] numbers of faces; -1 where there is none.

        Raises:
            LimitError: The mesh has too many faces, or is folded too often.
        """
        corners = (self._corners - origin) * scale
        # Mirroring reverses the orientation of faces, but must not change which one is on top.
        return rasterize(corners[:, ::-1] if self._pose.mirrored else corners, *box, self._budget)

    def locate(self, x: Floats, y: Floats, face: NDArray[np.int32] | None = None) -> Located:
        """Finds the texture points of canvas points.

        Args:
            x: float64 [n] x of the points in canvas pixels.
            y: float64 [n] y of the points.
            face: [n] face of each point, or -1, as `faces` finds them; needed if `meshed`. A point
                without a face belongs to the one with the nearest centroid.

        Raises:
            LimitError: Too many points lie beyond the mesh.
        """
        if self._mesh is None:
            if not self._pose.affine:
                return Located(x, y)
            a, b, c, d, e, f = self._pose.floats
            a, b, c, d, _, _ = inverse((a, b, c, d, 0, 0))
            x, y = x - e, y - f
            return Located(a * x + c * y, b * x + d * y)
        assert face is not None, "a meshed layer needs the faces of its samples"
        at = face.astype(np.int64)
        lost = np.flatnonzero(at < 0)
        points = np.stack([x, y], axis=1) if len(lost) or self._weighing else np.empty((0, 2))
        self._budget.spend("beyond", len(lost) * len(self._centres))
        at[lost] = nearest(points[lost], self._centres)
        start_x, x_by_x, x_by_y, start_y, y_by_x, y_by_y = (v.take(at) for v in self._away)
        shown_x = x + (start_x + x_by_x * x + x_by_y * y)
        shown_y = y + (start_y + y_by_x * x + y_by_y * y)
        if not self._weighing:
            return Located(shown_x, shown_y, at)
        away = points - self._corners[at, 0]
        second = (self._second[at] * away).sum(1)
        third = (self._third[at] * away).sum(1)
        return Located(shown_x, shown_y, at, np.stack([1 - second - third, second, third], axis=1))
