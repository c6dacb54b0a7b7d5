"""Node sampling: features from the nodes of a mesh and from the boundary (ProxyImg, literally).

The *local* feature of a point is the barycentric mean of the plane sampled at the three nodes of
its triangle. The *global* feature is the mean of the plane sampled at the anchors, one for each
boundary segment, weighted by inverse squared distance. The constants below say which of them the
network gets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.boundary import Boundary
from .implicit import Box, ImplicitTexture
from .network import Floats

DIRECT, BOTH, LOCAL, GLOBAL = range(4)
"""Sampling modes: at the point itself; local and global, local, or global feature."""

NEAR = 1e-4
"""Least squared distance to an anchor that counts, in canvas px^2; keeps weights finite."""

CHUNK = 1 << 12
"""Points handled at a time, so that sums stay in the processor cache."""

Reals = NDArray[np.float64]


def anchors(boundary: Boundary | None, size: tuple[int, int]) -> Reals:
    """Anchors of a layer: the point at t = 1/2 of every boundary segment.

    Args:
        boundary: Boundary at rest. None has the four sides of the canvas as its segments: top,
            right, bottom, left.
        size: Width and height of the canvas in pixels.

    Returns:
        float64 [S, 2] in canvas pixels.
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
    """Features of n points; those of a point do not depend on the other points.

    `GLOBAL` does not use `nodes`, `faces`, `face` and `weights`; `LOCAL` does not use `anchors` and
    `points`.

    Args:
        texture: The plane of codes.
        box: Rectangle of the layer, over which the plane is stretched.
        sampling: `BOTH`, `LOCAL` or `GLOBAL`.
        nodes: float64 [N, 2] rest positions of the nodes in canvas pixels.
        faces: int32 [F, 3] nodes of each face.
        anchors: float64 [S, 2] anchors in canvas pixels.
        face: int64 [n] face of each point.
        weights: float64 [n, 3] barycentric weights of each point in its face.
        points: float64 [n, 2] texture points in canvas pixels.

    Returns:
        float32 [n, D] or, for `BOTH`, [n, 2 D]: local, then global features.
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
    """Features float64 [N, D] of the plane at points [N, 2] in canvas pixels."""
    return texture.features(texture.taps(points[:, 0], points[:, 1], box)).astype(np.float64)


def _local(corners: Reals, weights: Reals) -> Reals:
    """Combines features [n, 3, D] of three corners with weights [n, 3] to [n, D]."""
    w = weights[:, :, None]
    return w[:, 0] * corners[:, 0] + w[:, 1] * corners[:, 1] + w[:, 2] * corners[:, 2]


def _global(values: Reals, anchors: Reals, points: Reals) -> Reals:
    """Combines features [S, D] of anchors to [n, D], term by term, so that sums are repeatable."""
    x, y = np.ascontiguousarray(points.T)
    total = np.zeros(len(x))
    out = np.zeros((values.shape[1], len(x)))
    for (ax, ay), value in zip(anchors, values, strict=True):
        weight = 1 / np.maximum((x - ax) ** 2 + (y - ay) ** 2, NEAR)
        total += weight
        out += value[:, None] * weight
    return (out / total).T
