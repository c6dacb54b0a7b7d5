"""Masses, springs and stiff triangles of a mesh, from the material of its layer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .body import Body
from .motion_types import LayerMotion

Real = NDArray[np.float64]
Index = NDArray[np.int64]

LIGHTEST = 0.05
"""Least mass of a node, relative to the mean of its body."""

THINNEST = 1e-4
"""Least area, relative to the square of the longest side, of triangles that resist its change."""


def masses(body: Body, layer: LayerMotion) -> Real:
    """Masses of the nodes, float64 [N]: a third of each triangle around a node."""
    shares = np.repeat(np.abs(body.areas) / 3, 3)
    mass = np.bincount(body.faces.ravel(), shares, len(body.nodes))
    mass = np.maximum(mass, LIGHTEST * mass[~body.loose].mean())
    return np.asarray(mass * layer.material.density * layer.mass)


def springs(body: Body, layer: LayerMotion) -> tuple[Index, Real, Real]:
    """Makes springs along edges, and across them between the far corners of adjacent triangles.

    In a lattice of equilateral triangles, springs of stiffness E * (area on both sides) / length**2
    make a sheet of modulus about E, however fine the lattice is. Springs of length 0 are left out.

    Args:
        body: The body.
        layer: Motion of the body, for its material.

    Returns:
        int64 [S, 2] nodes at the ends, float64 [S] lengths at rest in pixels, and float64 [S]
        stiffnesses.
    """
    edges, number, face = body.sides
    bends, beside = body.bends()
    area = np.abs(body.areas)
    around = np.bincount(number, area[face], len(edges))
    kind = layer.material
    pairs = np.concatenate([edges, bends])
    near = np.concatenate([kind.stretch**2 * around, kind.bend**2 * area[beside].sum(1)])
    length = np.hypot(*(body.nodes[pairs[:, 0]] - body.nodes[pairs[:, 1]]).T)
    kept = (length > 0) & (near > 0)
    stiffness = _modulus(body, layer) * near[kept] / length[kept] ** 2
    return pairs[kept], length[kept], stiffness


def triangles(body: Body, layer: LayerMotion) -> tuple[Index, Real, Real]:
    """Makes triangles that resist a change of area; slivers are left out.

    The energy of a triangle is K (A - A0)**2 / 2 A0 with the modulus K.

    Args:
        body: The body.
        layer: Motion of the body, for its material.

    Returns:
        int64 [T, 3] nodes, float64 [T] twice the signed areas at rest, and float64 [T] stiffnesses
        against a change of twice the area.
    """
    area = np.abs(body.areas)
    corners = body.nodes[body.faces]
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(2).max(1)
    kept = (area > THINNEST * longest) & (layer.material.area > 0)
    stiffness = _modulus(body, layer) * layer.material.area**2 / (4 * area[kept])
    return body.faces[kept].astype(np.int64), 2 * body.areas[kept], stiffness


def _modulus(body: Body, layer: LayerMotion) -> float:
    """Modulus that corresponds to a frequency of 1 Hz; see `Material`."""
    return layer.material.density * layer.mass * (2 * body.diagonal) ** 2
