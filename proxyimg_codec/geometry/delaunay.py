"""Constrained Delaunay triangulation of points with integer coordinates; every test is exact.

Points are added from left to right, and edges are flipped until they are Delaunay (C. L. Lawson,
"Software for C1 surface interpolation", 1977). Then constraints are recovered by flips
(S. W. Sloan, "A fast algorithm for generating constrained Delaunay triangulations", 1993).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Edge = tuple[int, int]


def triangulate(points: NDArray[np.int64], constraints: NDArray[np.int64]) -> NDArray[np.int32]:
    """Triangulates the convex hull of `points`.

    Args:
        points: int64 [N, 2] distinct points, of any magnitude.
        constraints: int64 [C, 2] indices of the two ends of segments that have to be edges. A
            segment through another point becomes several edges.

    Returns:
        int32 [T, 3] triangles with (b - a) x (c - a) > 0. Each begins with its smallest index, and
        they are in ascending order. There are none if all points lie on a line. No point lies
        inside the circumcircle of a triangle unless a constraint separates them. The same input
        always gives the same triangles, even if four points lie on a circle.

    Raises:
        ValueError: Points coincide, or constraints cross or have a length of zero.
    """
    if len(np.unique(points, axis=0)) < len(points):
        raise ValueError("two points coincide")
    mesh = _Mesh(points)
    mesh.sweep([int(i) for i in np.lexsort(points.T[::-1])])
    if not mesh.apex:
        return np.zeros((0, 3), np.int32)
    for a, b in sorted(constraints.tolist()):
        mesh.force(a, b)
    found = sorted((a, b, c) for (a, b), c in mesh.apex.items() if a < min(b, c))
    return np.array(found, np.int32)


class _Mesh:
    """Triangulation stored by directed edges.

    Attributes:
        at: Coordinates of the points.
        apex: Third corner of the triangle that has the edge (a, b) in this direction.
        fan: For each vertex a the end b of one edge (a, b) in `apex`.
        fixed: Recovered constraints, in both directions.
    """

    def __init__(self, points: NDArray[np.int64]) -> None:
        self.at: list[list[int]] = points.tolist()
        self.apex: dict[Edge, int] = {}
        self.fan: dict[int, int] = {}
        self.fixed: set[Edge] = set()

    def turn(self, a: int, b: int, c: int) -> int:
        """Twice the signed area of a triangle, (b - a) x (c - a)."""
        (ax, ay), (bx, by), (cx, cy) = self.at[a], self.at[b], self.at[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    def encircled(self, a: int, b: int, c: int, d: int) -> bool:
        """Whether d lies strictly inside the circle through a, b and c."""
        at, (dx, dy) = self.at, self.at[d]
        ax, ay = at[a][0] - dx, at[a][1] - dy
        bx, by = at[b][0] - dx, at[b][1] - dy
        cx, cy = at[c][0] - dx, at[c][1] - dy
        return (
            (ax * ax + ay * ay) * (bx * cy - by * cx)
            + (bx * bx + by * by) * (cx * ay - cy * ax)
            + (cx * cx + cy * cy) * (ax * by - ay * bx)
        ) > 0

    def add(self, a: int, b: int, c: int) -> None:
        self.apex[a, b], self.apex[b, c], self.apex[c, a] = c, a, b
        self.fan[a], self.fan[b], self.fan[c] = b, c, a

    def flip(self, a: int, b: int) -> Edge:
        """Replaces the diagonal a-b of a strictly convex quadrilateral by the other one.

        Returns:
            The ends of the new diagonal.
        """
        c, d = self.apex.pop((a, b)), self.apex.pop((b, a))
        self.add(a, d, c)
        self.add(d, b, c)
        return c, d

    def settle(self, edges: list[Edge]) -> None:
        """Flips edges, and then the edges around them, until all are Delaunay or fixed."""
        apex = self.apex
        while edges:
            a, b = edge = edges.pop()
            c, d = apex.get(edge), apex.get((b, a))
            if c is None or d is None or edge in self.fixed or not self.encircled(a, b, c, d):
                continue
            self.flip(a, b)
            edges += [(a, d), (d, b), (b, c), (c, a)]

    def sweep(self, order: list[int]) -> None:
        """Adds all points in `order`, by ascending x, then y; so each sees the one before it."""
        start = 2
        while start < len(order) and not self.turn(order[0], order[1], order[start]):
            start += 1
        if start >= len(order):
            return
        line, tip = order[:start], order[start]
        if self.turn(order[0], order[1], tip) < 0:
            line.reverse()
        for a, b in pairwise(line):
            self.add(a, b, tip)
        hull = [*line, tip]
        after = dict(zip(hull, hull[1:] + hull[:1], strict=True))
        before = {b: a for a, b in after.items()}
        self.settle(list(self.apex))
        for last, new in pairwise(order[start:]):
            left, right, seen = last, last, []
            while self.turn(right, after[right], new) < 0:
                right = after[right]
                seen.append((before[right], right))
            while self.turn(before[left], left, new) < 0:
                left = before[left]
                seen.append((left, after[left]))
            for a, b in seen:
                self.add(b, a, new)
            after[left], after[new], before[new], before[right] = new, right, left, new
            self.settle(seen)  # the hull bulges between them, so new edges cannot be flipped yet

    def star(self, a: int) -> Iterator[Edge]:
        """Yields the opposite edge of each triangle around a vertex."""
        first = u = self.fan[a]
        while (w := self.apex.get((a, u))) is not None:
            yield u, w
            u = w
            if u == first:
                return
        w = first
        while (u := self.apex.get((w, a), -1)) >= 0:
            yield u, w
            w = u

    def crossed(self, a: int, b: int) -> tuple[list[Edge], int]:
        """Edges that the segment from a to b crosses up to the first vertex on it, and that one."""
        (ax, ay), (bx, by) = self.at[a], self.at[b]
        for u, w in self.star(a):
            right, left = self.turn(a, b, u), self.turn(a, b, w)
            for v, side in ((u, right), (w, left)):
                x, y = self.at[v]
                if side == 0 and (x - ax) * (bx - ax) + (y - ay) * (by - ay) > 0:
                    return [], v
            if right < 0 < left:
                break
        edges = [(u, w)]
        while side := self.turn(a, b, v := self.apex[w, u]):
            u, w = (v, w) if side < 0 else (u, v)
            edges.append((u, w))
        return edges, v

    def force(self, a: int, b: int) -> None:
        """Makes the segment from a to b an edge, or several edges if there are vertices on it.

        Raises:
            ValueError: The segment crosses another constraint, or a is b.
        """
        if a == b:
            raise ValueError(f"the constraint from point {a} to itself has no length")
        while a != b:
            edges, stop = self.crossed(a, b)
            if not self.fixed.isdisjoint(edges):
                raise ValueError(f"the constraint between points {a} and {b} crosses another")
            queue, made = deque(edges), list[Edge]()
            while queue:
                u, w = queue.popleft()
                c, d = self.apex[u, w], self.apex[w, u]
                if self.turn(d, w, c) <= 0 or self.turn(c, u, d) <= 0:
                    queue.append((u, w))
                    continue
                self.flip(u, w)
                crossing = self.turn(a, stop, c) * self.turn(a, stop, d) < 0
                (queue if crossing else made).append((c, d))
            self.fixed |= {(a, stop), (stop, a)}
            self.settle(made)
            a = stop
