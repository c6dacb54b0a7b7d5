"""Collisions: with the edges of the canvas, with a floor, and between layers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Index = NDArray[np.int64]

GRIP = 0.5
"""Share of its way along a wall that a particle loses in a step in which it touches it."""


class Walls:
    """Particles stay in a box each, and slow down where they touch its sides.

    Args:
        low: Least x and y of each particle [2, P].
        high: Greatest [2, P].
    """

    def __init__(self, low: Real, high: Real) -> None:
        self.low, self.high = low, high

    def project(self, x: Real, before: Real) -> None:
        """Brings positions `x` [2, P] back, in place, that were at `before` [2, P]."""
        inside = np.clip(x, self.low, self.high)
        touching = (inside != x)[::-1]
        x[...] = inside
        x[touching] += GRIP * (before - x)[touching]


class Outline:
    """The outline of a layer for collisions: the edges of its mesh that belong to one triangle.

    Args:
        part: The layer's particles.
        edges: int64 [E, 2] particles, in the direction they have in their triangle.
        nodes: Places at rest [2, P].
    """

    def __init__(self, part: slice, edges: Index, nodes: Real) -> None:
        self.part, self.edges = part, edges
        self.outside = ~inside(nodes, nodes[:, edges])
        self.outside[part] = False


def inside(points: Real, edges: Real) -> NDArray[np.bool_]:
    """Which points [2, P] edges [2, E, 2] surround, by the even-odd rule: bool [P]."""
    (ax, bx), (ay, by) = edges.transpose(0, 2, 1)[..., None]
    x, y = points
    crossed = (ay <= y) != (by <= y)
    rise = np.where(ay == by, 1.0, by - ay)
    right = ax + (y - ay) / rise * (bx - ax) > x
    return np.asarray((crossed & right).sum(0) % 2 == 1)


class Layers:
    """Particles of one layer that enter another are put back on its nearest edge.

    A particle that lies inside a layer at rest may be inside it at any time. The ends of an edge
    move the other way, so that momentum stays; where several particles meet an edge in a step,
    each goes a share of its way, and the rest in the steps after it.

    Args:
        bodies: The outlines of all layers.
        w: Inverse masses [P].
    """

    def __init__(self, bodies: Sequence[Outline], w: Real) -> None:
        self.bodies, self.w = bodies, w

    def project(self, x: Real) -> None:
        """Moves positions `x` [2, P], in place."""
        boxes = [(x[:, b.part].min(1), x[:, b.part].max(1)) for b in self.bodies]
        for body, (low, high) in zip(self.bodies, boxes, strict=True):
            near = body.outside & ((x > low[:, None]) & (x < high[:, None])).all(0)
            at = np.flatnonzero(near)
            if len(at):
                at = at[inside(x[:, at], x[:, body.edges])]
            if len(at):
                self._push(x, body.edges, at)

    def _push(self, x: Real, edges: Index, at: Index) -> None:
        """Puts particles `at` [n] on the nearest of `edges` [E, 2]."""
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
