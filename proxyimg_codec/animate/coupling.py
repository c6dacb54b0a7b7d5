"""Layers that move as one: what touches must not tear apart.

A picture is often cut into layers that are parts of one thing, such as the colours of a character.
Such layers are simulated as one body, the union of their shapes, and ride on its mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry import coverage as cover
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS, Mesh
from ..geometry.mesher import delaunay
from ..model import Layer
from .body import Body

Size = tuple[int, int]

NEAR = 2
"""Layers touch if less than so many canvas pixels lie between them; on large canvases more."""

LONGEST = 512
"""Longest side in cells of the grid on which that is found."""


def touching(layers: Sequence[Layer], size: Size) -> list[list[int]]:
    """Numbers of layers that touch, at rest and directly or through others; in their order.

    Args:
        layers: Any layers of a picture.
        size: Width and height of its canvas.
    """
    masks = [_mask(v, size) for v in layers]
    group = list(range(len(layers)))
    for i in range(len(layers)):
        for j in range(i):
            if group[i] != group[j] and (masks[i] & masks[j]).any():
                old, new = max(group[i], group[j]), min(group[i], group[j])
                group = [new if g == old else g for g in group]
    return [[i for i, g in enumerate(group) if g == first] for first in sorted(set(group))]


def _mask(layer: Layer, size: Size) -> NDArray[np.bool_]:
    """Cells [h, w] that a layer touches, or nearly so."""
    cell = max(-(-max(size) // LONGEST), 1)
    columns, rows = (-(-n // cell) for n in size)
    if layer.boundary is None:
        return np.ones((rows, columns), bool)
    unit = layer.boundary.unit
    paths = [
        np.stack([cover.to_output(p[:, k], unit, 0, cell, 1) for k in (0, 1)], axis=1)
        for p in layer.boundary.paths
    ]
    near = cover.coverage(paths, 0, 0, columns, rows) > 0
    for axis in (0, 1):
        for _ in range(NEAR // 2):
            padded = np.pad(near, [(1, 1) if k == axis else (0, 0) for k in (0, 1)])
            near = near | np.take(padded, range(2, near.shape[axis] + 2), axis)
            near |= np.take(padded, range(near.shape[axis]), axis)
    return near


def united(name: str, layers: Sequence[Layer], size: Size, edge: float) -> Body:
    """A body of the union of the shapes of layers.

    Args:
        name: Of the body.
        layers: Layers of a picture.
        size: Width and height of its canvas.
        edge: Length of edges relative to the diagonal.
    """
    shapes = [v.boundary for v in layers]
    if any(shape is None for shape in shapes):
        union = None
    else:
        found = [shape for shape in shapes if shape is not None]
        unit = max(shape.unit for shape in found)
        union = Boundary(unit, tuple(p << (unit - s.unit) for s in found for p in s.paths))
    refined = Mesh.build(delaunay(union, size, edge)).refined
    return Body(name, refined.nodes / (1 << FRACTION_BITS), refined.faces)


def ridden(
    body: Body, moved: NDArray[np.float64], nodes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Displacements [F, n, 2] of points [n, 2] that ride on a body whose nodes move [F, N, 2]."""
    corners, weights = body.holding(nodes)
    return np.asarray((moved[:, corners] * weights[..., None]).sum(2))
