"""Node sampling: features from the nodes of a mesh and from the boundary (ProxyImg, literally).

The *local* feature of a point is the plane sampled at the three nodes of its triangle, combined
barycentrically. The *global* feature is the plane sampled at one anchor a boundary segment,
combined by inverse squared distance. The network gets both, one of them, or neither: see the
constants below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.boundary import Boundary
from .implicit import Box, ImplicitTexture
from .network import Floats

DIRECT, BOTH, LOCAL, GLOBAL = range(4)
"""How a layer's features are found: at the point itself, or local and global, local, global."""

NEAR = 1e-4
"""Squared distance in canvas px^2 below which an anchor is no nearer; keeps weights finite."""

CHUNK = 1 << 12
"""Points handled at a time, so that what is summed stays in the cache."""

Reals = NDArray[np.float64]


def anchors(boundary: Boundary | None, size: tuple[int, int]) -> Reals:
    """Boundary points [S, 2] in canvas pixels: the middle (t = 1/2) of every segment.

    Args:
        boundary: At rest; None has the four sides of the canvas as its segments: top, right,
            bottom, left.
        size: Width and height of the canvas.
    """
    if boundary is None:
        w, h = size
        return np.array([[w / 2, 0], [w, h / 2], [w / 2, h], [0, h / 2]], np.float64)
    middles = []
    for path in boundary.paths:
        p, q, r = (path[k::3] for k in range(3))
        middles.append(p + 3 * q + 3 * r + np.roll(p, -1, axis=0))
    return np.concatenate(middles) / float(8 << boundary.unit)


def features(
    texture: ImplicitTexture,
    box: Box,
    sampling: int,
    nodes: Reals,
    faces: NDArray[np.int32],
    anchors: Reals,
    face: NDArray[np.int64],
    weights: Reals,
    points: Reals,
) -> Floats:
    """Features of n points; those of a point do not depend on which others are asked for.

    Args:
        texture: The plane.
        box: The layer's rectangle, over which the plane is stretched.
        sampling: `BOTH`, `LOCAL` or `GLOBAL`.
        nodes: [N, 2] rest positions in canvas pixels. Not used by `GLOBAL`, nor are `faces`,
            `face` and `weights`.
        faces: [F, 3] nodes of each triangle.
        anchors: [S, 2] boundary points in canvas pixels. Not used by `LOCAL`.
        face: [n] triangle of each point.
        weights: [n, 3] its barycentric weights there.
        points: [n, 2] rest positions in canvas pixels. Not used by `LOCAL`.

    Returns:
        [n, D] or, for `BOTH`, [n, 2 D]: local, then global.
    """
    dim, parts = len(texture.steps), []
    if sampling != GLOBAL:
        parts.append(at(texture, box, nodes))
    if sampling != LOCAL:
        parts.append(at(texture, box, anchors))
    out = np.empty((len(points), dim * len(parts)), np.float32)
    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        if sampling != GLOBAL:
            out[part, :dim] = _local(parts[0][faces[face[part]]], weights[part])
        if sampling != LOCAL:
            out[part, -dim:] = _global(parts[-1], anchors, points[part])
    return out


def at(texture: ImplicitTexture, box: Box, points: Reals) -> Reals:
    """The plane sampled at points [N, 2]: [N, D]."""
    return texture.features(texture.taps(points[:, 0], points[:, 1], box)).astype(np.float64)


def _local(corners: Reals, weights: Reals) -> Reals:
    """Combines the features [n, 3, D] of the corners."""
    w = weights[:, :, None]
    return w[:, 0] * corners[:, 0] + w[:, 1] * corners[:, 1] + w[:, 2] * corners[:, 2]


def _global(values: Reals, anchors: Reals, points: Reals) -> Reals:
    """Combines the features [S, D] of the anchors; term by term, so that sums are repeatable."""
    x, y = np.ascontiguousarray(points.T)
    total = np.zeros(len(x))
    out = np.zeros((values.shape[1], len(x)))
    for (ax, ay), value in zip(anchors, values, strict=True):
        weight = 1 / np.maximum((x - ax) ** 2 + (y - ay) ** 2, NEAR)
        total += weight
        out += value[:, None] * weight
    return (out / total).T
