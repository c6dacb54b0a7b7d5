"""What the material of a layer makes of its mesh: masses, springs and stiff triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .body import Body
from .motion_types import LayerMotion

Real = NDArray[np.float64]
Index = NDArray[np.int64]

LIGHTEST = 0.05
"""Least mass of a node relative to the mean of its layer."""

THINNEST = 1e-4
"""Triangles of less area relative to the square of their longest side keep no area."""


def masses(body: Body, layer: LayerMotion) -> Real:
    """Masses of the nodes [N]: each has a third of the triangles round it."""
    shares = np.repeat(np.abs(body.areas) / 3, 3)
    mass = np.bincount(body.faces.ravel(), shares, len(body.nodes))
    mass = np.maximum(mass, LIGHTEST * mass[~body.loose].mean())
    return np.asarray(mass * layer.material.density * layer.mass)


def springs(body: Body, layer: LayerMotion) -> tuple[Index, Real, Real]:
    """Pairs of nodes [S, 2] along edges and across them, their distances and stiffnesses [S].

    Springs of stiffness E * (area on both sides) / length**2 make a sheet whose modulus is about E
    of a lattice of equilateral triangles, however fine it is. Springs without length are left out.
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
    """Faces [T, 3] that keep their area, twice that area and the stiffness of twice it [T].

    The energy is K (A - A0)**2 / 2 A0, whose modulus is K. Slivers are left out.
    """
    area = np.abs(body.areas)
    corners = body.nodes[body.faces]
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(2).max(1)
    kept = (area > THINNEST * longest) & (layer.material.area > 0)
    stiffness = _modulus(body, layer) * layer.material.area**2 / (4 * area[kept])
    return body.faces[kept].astype(np.int64), 2 * body.areas[kept], stiffness


def _modulus(body: Body, layer: LayerMotion) -> float:
    """The modulus that a frequency of 1 Hz means; see `Material`."""
    return layer.material.density * layer.mass * (2 * body.diagonal) ** 2
