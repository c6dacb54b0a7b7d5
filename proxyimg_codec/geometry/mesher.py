"""Default mesher: triangles of even size over the shape of a layer, in numpy alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import coverage as cover
from .boundary import Boundary
from .delaunay import triangulate
from .mesh import Base, Mesh
from .outline import CELLS, Outline, outline
from .polygons import touching, winding

EDGE_FRONT, EDGE_BACK = 0.05, 0.2
"""Edge lengths relative to the diagonal of the layer: objects, back (ProxyImg, l_r^f, l_r^b)."""


def derived(boundary: Boundary | None, size: tuple[int, int], edge: float | None = None) -> Mesh:
    """Makes a mesh by `delaunay` for a layer whose file has none.

    Args:
        boundary: Boundary of the layer at rest; None for the whole canvas.
        size: Width and height of the canvas in pixels.
        edge: Target edge length as for `delaunay`; None = a length that suits edits.

    Raises:
        UsageError: `edge` is out of range.
    """
    suits = EDGE_BACK if boundary is None else EDGE_FRONT
    return Mesh.build(delaunay(boundary, size, suits if edge is None else edge))


def delaunay(boundary: Boundary | None, size: tuple[int, int], edge: float) -> Base:
    """Meshes the shape of a layer with triangles of about the same size.

    The mesh reaches at least two pixels beyond the shape. Gaps and holes stay open if they are
    wider than about a dozen pixels, or than six lattice cells of a layer of more than 500 pixels.
    The same input gives the same mesh.

    Args:
        boundary: Boundary that encloses the shape; None for the whole canvas.
        size: Width and height of the canvas in pixels; only used if `boundary` is None.
        edge: Target edge length relative to the diagonal of the box around the shape and two
            pixels of padding, 0.01..1; in pixels it is never less than 4.

    Returns:
        A mesh without folds in which each directed edge occurs once, and no two parts meet in a
        single vertex. It has at most max(32, 9.3 / edge**2) triangles, usually fewer than
        1 / edge**2. If the shape has too many parts or too rough an outline for that, parts are
        merged and the outline is simplified.

    Raises:
        UsageError: `edge` is out of range.
    """
    shape = outline(boundary, size, edge)
    return fill(shape, shape.points)


def fill(shape: Outline, points: NDArray[np.int64]) -> Base:
    """Fills an outline with a constrained Delaunay triangulation.

    Args:
        shape: The outline.
        points: int64 [P, 2] lattice points to use besides the corners of the loops; points outside
            the loops are left out.
    """
    corners = np.concatenate(shape.loops)
    vertices = np.unique(np.concatenate([corners, points]), axis=0)
    number = {tuple(v): i for i, v in enumerate(vertices.tolist())}
    walls = [
        (number[tuple(a)], number[tuple(b)])
        for loop in shape.loops
        for a, b in zip(loop.tolist(), np.roll(loop, -1, 0).tolist(), strict=True)
    ]
    # The lattice is stretched, so that circumcircles are round on the canvas. Small factors are
    # enough, and keep the integers short.
    stretch = np.maximum(np.rint(np.array(shape.step) * 64 / max(shape.step)), 1).astype(np.int64)
    triangles = triangulate(vertices * stretch, np.array(walls))
    middles = vertices[triangles].sum(1)
    inside = winding(middles, [3 * p for p in shape.loops]) > 0
    return base(shape, vertices, triangles[inside])


def base(shape: Outline, vertices: NDArray[np.int64], triangles: NDArray[Any]) -> Base:
    """Makes a mesh of triangles [T, 3], with those of the lattice points [N, 2] that they use."""
    used, number = np.unique(triangles, return_inverse=True)
    renumbered = number.reshape(-1, 3).astype(np.int32)
    return Base(shape.origin, shape.step, vertices[used].astype(np.uint8), renumbered)


def sound(mesh: Base, covered: NDArray[np.bool_]) -> bool:
    """Whether a mesh made by another program is a valid `Base` and covers a shape.

    All triangles must have positive orientation, each directed edge must occur once, the rim must
    consist of polygons that do not touch, and all cells of the shape must lie inside.

    Args:
        mesh: The mesh.
        covered: bool [CELLS, CELLS], True for the lattice cells that hold a part of the shape.
    """
    corners = mesh.vertices[mesh.triangles].astype(np.int64)
    (ux, uy), (vx, vy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    loops = rim(mesh.triangles)
    if not len(corners) or (ux * vy <= uy * vx).any() or loops is None:
        return False
    polygons = [mesh.vertices[loop].astype(np.int64) for loop in loops]
    if touching(polygons).any():
        return False
    # A segment with its inner control points at the thirds is straight, so it becomes one chord.
    thirds = np.arange(3)[:, None] * cover.ONE // 3
    paths = [
        (p[:, None] * cover.ONE + (np.roll(p, -1, 0) - p)[:, None] * thirds).reshape(-1, 2)
        for p in polygons
    ]
    return bool((cover.coverage(paths, 0, 0, CELLS, CELLS)[covered] == cover.FULL).all())


def rim(triangles: NDArray[np.int32]) -> list[list[int]] | None:
    """Loops of the edges at the rim of a mesh.

    Args:
        triangles: int32 [T, 3] vertices of each triangle.

    Returns:
        For each loop its vertices, in the direction of the triangles; None if a directed edge
        occurs twice, or loops meet in a vertex.
    """
    edges = [(int(t[k]), int(t[(k + 1) % 3])) for t in triangles for k in range(3)]
    known = set(edges)
    open_ends = [(a, b) for a, b in edges if (b, a) not in known]
    follows = dict(open_ends)
    if len(known) < len(edges) or len(follows) < len(open_ends):
        return None
    loops = []
    for start in sorted(follows):
        loop = []
        while start in follows:
            loop.append(start)
            start = follows.pop(start)
        if loop:
            loops.append(loop)
    return loops
