"""Collisions with the edges of the canvas, with a floor, and between layers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Index = NDArray[np.int64]

GRIP = 0.5
"""Share of its movement along a wall that a particle loses in a step in which it touches it."""


class Walls:
    """Walls: each particle stays in a box of its own, and slows down where it touches its sides.

    Args:
        low: float64 [2, P] least x and y of each particle in pixels.
        high: float64 [2, P] greatest x and y.
    """

    def __init__(self, low: Real, high: Real) -> None:
        self.low, self.high = low, high

    def project(self, x: Real, before: Real) -> None:
        """Moves particles back into their boxes.

        Args:
            x: float64 [2, P] positions; they are changed.
            before: float64 [2, P] positions before the step.
        """
        inside = np.clip(x, self.low, self.high)
        touching = (inside != x)[::-1]
        x[...] = inside
        x[touching] += GRIP * (before - x)[touching]


class Outline:
    """Outline of a body for collisions: the edges of its mesh that belong to one triangle.

    Args:
        part: Particles of the body.
        edges: int64 [E, 2] particles at the ends of the edges.
        nodes: float64 [2, P] rest positions.

    Attributes:
        outside: bool [P], True for particles of other bodies that lie outside at rest.
    """

    def __init__(self, part: slice, edges: Index, nodes: Real) -> None:
        self.part, self.edges = part, edges
        self.outside = ~inside(nodes, nodes[:, edges])
        self.outside[part] = False


def inside(points: Real, edges: Real) -> NDArray[np.bool_]:
    """Finds the points that edges surround, by the even-odd rule.

    Args:
        points: float64 [2, P] points.
        edges: float64 [2, E, 2] x of both ends of each edge, then y.

    Returns:
        bool [P].
    """
    (ax, bx), (ay, by) = edges.transpose(0, 2, 1)[..., None]
    x, y = points
    crossed = (ay <= y) != (by <= y)
    rise = np.where(ay == by, 1.0, by - ay)
    right = ax + (y - ay) / rise * (bx - ax) > x
    return np.asarray((crossed & right).sum(0) % 2 == 1)


class Layers:
    """Collisions between bodies: a particle that enters another body is put on its nearest edge.

    A particle that lies inside a body at rest may be inside it at any time. The ends of the edge
    move the other way, so that momentum is conserved. If several particles meet an edge in a step,
    each goes a share of its way, and the rest in later steps.

    Args:
        bodies: Outlines of all bodies.
        w: float64 [P] inverse masses.
    """

    def __init__(self, bodies: Sequence[Outline], w: Real) -> None:
        self.bodies, self.w = bodies, w

    def project(self, x: Real) -> None:
        """Moves particles out of other bodies; `x` float64 [2, P] is changed."""
        boxes = [(x[:, b.part].min(1), x[:, b.part].max(1)) for b in self.bodies]
        for body, (low, high) in zip(self.bodies, boxes, strict=True):
            near = body.outside & ((x > low[:, None]) & (x < high[:, None])).all(0)
            at = np.flatnonzero(near)
            if len(at):
                at = at[inside(x[:, at], x[:, body.edges])]
            if len(at):
                self._push(x, body.edges, at)

    def _push(self, x: Real, edges: Index, at: Index) -> None:
        """Moves each of the particles `at` [n] to the nearest of the edges [E, 2], and its ends."""
        a, b = x[:, edges[:, 0], None], x[:, edges[:, 1], None]
        along = b - a
        square = np.maximum((along**2).sum(0), 1e-30)
        t = np.clip(((x[:, None, at] - a) * along).sum(0) / square, 0, 1)  # [E, n]
        way = a + t * along - x[:, None, at]
        nearest = (way**2).sum(0).argmin(0)
        each = np.arange(len(at))
        t, way = t[nearest, each], way[:, nearest, each]
        members = np.concatenate([at[None], edges[nearest].T])  # [3, n]
        gradient = np.stack([np.ones(len(at)), t - 1, -t])
        w = self.w[members]
        change = w * gradient / np.maximum((w * gradient**2).sum(0), 1e-30) * way[:, None]
        hits = np.bincount(members.ravel())[members]
        change /= np.where(w > 0, hits, 1).max(0)
        for axis in range(2):
            x[axis] += np.bincount(members.ravel(), change[axis].ravel(), len(self.w))
