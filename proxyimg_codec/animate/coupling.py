"""Coupling of layers that move as one, so that layers that touch do not tear apart.

A picture often has layers that are parts of one thing, such as the colours of a character. Such
layers are simulated as one body, the union of their shapes, and their nodes follow its mesh.
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
"""Distance in cells below which layers touch; a cell is one canvas pixel, or more on large
canvases."""

LONGEST = 512
"""Most cells along a side of the canvas."""


def touching(layers: Sequence[Layer], size: Size) -> list[list[int]]:
    """Groups layers that touch at rest, directly or through others.

    Args:
        layers: Some layers of a picture.
        size: Width and height of its canvas in pixels.

    Returns:
        For each group the ascending numbers of its layers in `layers`.
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
    """Mask of the cells that a layer touches, or that are next to such cells, bool [h, w]."""
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
    """Makes a body of the union of the shapes of layers at rest.

    Args:
        name: Name of the body.
        layers: Layers of a picture.
        size: Width and height of its canvas in pixels.
        edge: Target edge length relative to the diagonal of the union, 0.01..1.

    Raises:
        UsageError: `edge` is out of range.
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
    """Displacements of points that follow a body.

    Args:
        body: The body.
        moved: float64 [F, N, 2] displacements of its nodes in F frames.
        nodes: float64 [n, 2] points at rest in canvas pixels.

    Returns:
        float64 [F, n, 2].
    """
    corners, weights = body.holding(nodes)
    return np.asarray((moved[:, corners] * weights[..., None]).sum(2))
