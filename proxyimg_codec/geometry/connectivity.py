"""Coding of the connectivity of a mesh, triangle after triangle across *gates*.

A gate is an open edge: a directed edge of a coded triangle, beyond which nothing is coded yet.
Gates are taken in the order in which they opened. A symbol says what lies beyond a gate; a new
vertex also has a residual of its position. `_Encoder` and `_Decoder` take the same way over the
same `Border`: each step of one mirrors a step of the other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays
from ..errors import FormatError
from . import deltas

Ints = NDArray[np.int64]
Edge = tuple[int, int]
Point = tuple[int, int]
Triangle = tuple[int, int, int]

BORDER, NEW, RANKED, FAR = 0, 1, 2, 15
"""Symbols s of a gate: border of the mesh, new vertex, vertex of rank s - 2, any known vertex."""

RANKS = FAR - RANKED
"""Most vertices that have a symbol of their own at a gate."""

SYMBOL_BITS = 4
"""Bits per symbol."""


def encode(vertices: NDArray[np.uint8], triangles: NDArray[np.int32]) -> dict[str, Any]:
    """Encodes the vertices and triangles of a base.

    Args:
        vertices: uint8 [V, 2] x, y of the vertices on the lattice, in any order.
        triangles: int32 [T, 3] vertices of the triangles, in any order.

    Returns:
        The fields of MESH that hold them.

    Raises:
        ValueError: A triangle does not have positive area, a directed edge occurs twice, or a
            vertex belongs to no triangle.
    """
    return _Encoder(vertices, triangles).fields()


def decode(fields: Mapping[str, Any], where: str) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Decodes the vertices and triangles of a base.

    Args:
        fields: Fields of MESH.
        where: Name of the chunk in error messages.

    Returns:
        uint8 [V, 2] x, y of the vertices on the lattice, and int32 [T, 3] vertices of the
        triangles, in the order of the file.

    Raises:
        FormatError: The coded mesh is corrupt.
    """
    return _Decoder(fields, where).mesh()


class Border:
    """Growing mesh while it is coded, with its gates.

    Args:
        count: Number of vertices of the whole mesh, V.

    Attributes:
        open: int32 [V] number of gates that each vertex is an end of.
        waiting: For each gate its near vertex: the third corner of its triangle.
        used: Directed edges of all triangles.
        queue: Gates in the order in which they opened; closed ones are skipped.
    """

    def __init__(self, count: int) -> None:
        self.open = np.zeros(count, np.int32)
        self._x, self._y = np.zeros((2, count), np.int32)
        self._places: list[Point] = []
        self.waiting: dict[Edge, int] = {}
        self.used: set[Edge] = set()
        self.queue: deque[Edge] = deque()

    def add(self, x: int, y: int) -> int:
        """Adds a vertex at x, y on the lattice, and returns its number."""
        self._x[self.known], self._y[self.known] = x, y
        self._places.append((x, y))
        return self.known - 1

    @property
    def known(self) -> int:
        """Number of vertices so far."""
        return len(self._places)

    @property
    def vertices(self) -> NDArray[np.uint8]:
        """Positions of the vertices on the lattice, uint8 [known, 2]."""
        return np.array(self._places, np.uint8)

    def at(self, vertex: int) -> Point:
        """Position of a vertex on the lattice."""
        return self._places[vertex]

    def _open(self, edge: Edge, by: int) -> None:
        """Adds `by` to the number of gates of both ends of an edge."""
        for vertex in edge:
            self.open[vertex] += by

    def next_gate(self) -> tuple[Edge, int] | None:
        """Takes the next gate off the queue: the gate and its near vertex; None at the end."""
        while self.queue:
            edge = self.queue.popleft()
            if edge in self.waiting:
                near = self.waiting.pop(edge)
                self._open(edge, -1)
                return edge, near
        return None

    def predicted(self, edge: Edge, near: int) -> Point:
        """Predicted position beyond a gate: fourth corner of the parallelogram on its triangle."""
        (ax, ay), (bx, by), (x, y) = self.at(edge[0]), self.at(edge[1]), self.at(near)
        return ax + bx - x, ay + by - y

    def ranked(self, edge: Edge, near: int) -> Ints:
        """Ranks vertices that may be the third corner of the triangle beyond a gate.

        These are the ends of other gates, if they lie on the far side of this one.

        Returns:
            int64 [n] the n <= `RANKS` of them that are nearest to the predicted position, nearest
            first; at equal distance, the one that was added first.
        """
        at = np.flatnonzero(self.open[: self.known])
        x, y = self._x.take(at), self._y.take(at)
        (ax, ay), (bx, by) = self.at(edge[0]), self.at(edge[1])
        ahead = np.flatnonzero((ax - bx) * y - (ay - by) * x > (ax - bx) * by - (ay - by) * bx)
        ex, ey = self.predicted(edge, near)
        distance = (x.take(ahead) - ex) ** 2 + (y.take(ahead) - ey) ** 2
        if len(ahead) > RANKS:
            few = np.flatnonzero(distance <= np.partition(distance, RANKS - 1)[RANKS - 1])
            ahead, distance = ahead[few], distance[few]
        ranked: Ints = at[ahead[np.argsort(distance, kind="stable")[:RANKS]]]
        return ranked

    def place_triangle(self, a: int, b: int, c: int) -> bool:
        """Adds a triangle, and opens and closes gates.

        Returns:
            Whether it could be added: its area is positive, and none of its directed edges is used.
        """
        (ax, ay), (bx, by), (cx, cy) = self.at(a), self.at(b), self.at(c)
        edges = ((a, b), (b, c), (c, a))
        if (bx - ax) * (cy - ay) <= (by - ay) * (cx - ax) or not self.used.isdisjoint(edges):
            return False
        for (x, y), far in zip(edges, (c, a, b), strict=True):
            self.used.add((x, y))
            if (y, x) in self.waiting:
                del self.waiting[y, x]
                self._open((x, y), -1)
            elif (y, x) not in self.used:
                self.waiting[x, y] = far
                self._open((x, y), 1)
                self.queue.append((x, y))
        return True


class _Encoder:
    """Encoder of a mesh, triangle by triangle."""

    def __init__(self, vertices: NDArray[np.uint8], triangles: NDArray[np.int32]) -> None:
        self._vertices, self._triangles = vertices, triangles.tolist()
        self._beyond = _beyond(self._triangles)
        self._border = Border(len(vertices))
        self._symbols: list[int] = []
        self._far: list[int] = []
        self._residuals: list[Point] = []
        # Number of each vertex in the file by its number in the mesh, and the other way round.
        self._new: dict[int, int] = {}
        self._old: list[int] = []

    def fields(self) -> dict[str, Any]:
        """Encodes the mesh as fields of MESH."""
        for corners in self._triangles:
            if not self._is_coded(corners):
                self._start(corners)
                while (gate := self._border.next_gate()) is not None:
                    self._cross(*gate)
        if len(self._new) < len(self._vertices):
            raise ValueError("a vertex of the mesh belongs to no triangle")
        classes, raw = deltas.encode(np.array(self._residuals, np.int64).T)
        count = len(self._symbols)
        symbols = np.array(self._symbols)[None, None]
        return {
            "vertices": len(self._residuals),
            "gates": count,
            "symbols": arrays.encode(symbols, SYMBOL_BITS, np.ones((1, count), bool)),
            "far": self._far,
            "classes": classes,
            "deltas": raw,
        }

    def _is_coded(self, corners: list[int]) -> bool:
        a, b, _ = corners
        return (self._new.get(a, -1), self._new.get(b, -1)) in self._border.used

    def _start(self, corners: list[int]) -> None:
        """Codes the first triangle of a component; each vertex is predicted by the one before."""
        last, placed = (0, 0), []
        for vertex in corners:
            placed.append(self._put(vertex, last, None))
            last = self._border.at(placed[-1])
        self._place(*placed)

    def _cross(self, gate: Edge, near: int) -> None:
        """Codes what lies beyond a gate: the border, or a triangle."""
        x, y = gate
        apex = self._beyond.get((self._old[y], self._old[x]))
        if apex is None:
            self._symbols.append(BORDER)
            return
        expected, ranked = self._border.predicted(gate, near), self._border.ranked(gate, near)
        self._place(y, x, self._put(apex, expected, ranked))

    def _put(self, vertex: int, expected: Point, ranked: Ints | None) -> int:
        """Codes a vertex of the mesh, and returns its number in the file.

        Args:
            vertex: Number of the vertex in the mesh.
            expected: Predicted position.
            ranked: Ranked vertices of the gate; None in the first triangle of a component.
        """
        if vertex not in self._new:
            return self._put_new(vertex, expected)
        number = self._new[vertex]
        rank = np.flatnonzero(ranked == number) if ranked is not None else np.zeros(0)
        if len(rank):
            self._symbols.append(RANKED + int(rank[0]))
        else:
            self._symbols.append(FAR)
            self._far.append(number)
        return number

    def _put_new(self, vertex: int, expected: Point) -> int:
        x, y = map(int, self._vertices[vertex])
        self._symbols.append(NEW)
        self._residuals.append((_wrapped(x - expected[0]), _wrapped(y - expected[1])))
        self._old.append(vertex)
        self._new[vertex] = self._border.add(x, y)
        return self._new[vertex]

    def _place(self, a: int, b: int, c: int) -> None:
        if not self._border.place_triangle(a, b, c):
            raise ValueError("a triangle of the mesh is not positive")


class _Decoder:
    """Decoder of a mesh, triangle by triangle; raises `FormatError` if the fields are corrupt."""

    def __init__(self, fields: Mapping[str, Any], where: str) -> None:
        self._where, self._count, gates = where, fields["vertices"], fields["gates"]
        every = np.ones((1, gates), bool)
        symbols = arrays.decode(fields["symbols"], (1, 1, gates), SYMBOL_BITS, every)
        residuals = deltas.decode(fields["classes"], fields["deltas"], 2, self._count, where)
        self._symbols = iter(symbols.ravel().tolist())
        self._far = iter(fields["far"])
        self._residuals = iter(residuals.T.tolist())
        self._border = Border(self._count)
        self._triangles: list[Triangle] = []

    def mesh(self) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Decodes vertices uint8 [V, 2] and triangles int32 [T, 3]."""
        try:
            for symbol in self._symbols:
                self._start(symbol)
                while (gate := self._border.next_gate()) is not None:
                    self._cross(*gate)
        except StopIteration:
            raise self._corrupt("MSH-9") from None
        if self._border.known != self._count or next(self._far, None) is not None:
            raise FormatError(
                "the connectivity of the mesh does not use all its vertices", self._where,
                rule="MSH-9",
            )  # fmt: skip
        return self._border.vertices, np.array(self._triangles, np.int32)

    def _start(self, symbol: int) -> None:
        """Decodes the first triangle of a component; each vertex is predicted by the one before."""
        last, placed = (0, 0), []
        for k in range(3):
            placed.append(self._get(next(self._symbols) if k else symbol, last, None))
            last = self._border.at(placed[-1])
        self._place(*placed)

    def _cross(self, gate: Edge, near: int) -> None:
        """Decodes what lies beyond a gate: the border, or a triangle."""
        x, y = gate
        symbol = next(self._symbols)
        if symbol == BORDER:
            return
        expected = self._border.predicted(gate, near)
        ranked = self._border.ranked(gate, near) if symbol > NEW else None
        self._place(y, x, self._get(symbol, expected, ranked))

    def _get(self, symbol: int, expected: Point, ranked: Ints | None) -> int:
        """Decodes a vertex, and returns its number.

        Args:
            symbol: The symbol that stands for it.
            expected: Predicted position.
            ranked: Ranked vertices of the gate; None if the symbol needs none, or in the first
                triangle of a component.
        """
        if symbol == NEW:
            return self._get_new(expected)
        if symbol == FAR:
            number = int(next(self._far))
        elif ranked is not None and 0 <= symbol - RANKED < len(ranked):
            number = int(ranked[symbol - RANKED])
        else:
            raise self._corrupt("MSH-5" if ranked is None else "MSH-8")
        if number >= self._border.known:
            raise self._corrupt("MSH-3")
        return number

    def _get_new(self, expected: Point) -> int:
        dx, dy = next(self._residuals)
        return self._border.add((expected[0] + dx) % 256, (expected[1] + dy) % 256)

    def _place(self, a: int, b: int, c: int) -> None:
        if not self._border.place_triangle(a, b, c):
            raise FormatError(
                "a triangle of the mesh is not positive, or overlaps", self._where, rule="MSH-2"
            )
        self._triangles.append((a, b, c))

    def _corrupt(self, rule: str) -> FormatError:
        return FormatError("the connectivity of the mesh is corrupt", self._where, rule=rule)


def _beyond(triangles: list[list[int]]) -> dict[Edge, int]:
    """Third corner of the triangle of each directed edge; `ValueError` if an edge occurs twice."""
    found: dict[Edge, int] = {}
    for a, b, c in triangles:
        found |= {(a, b): c, (b, c): a, (c, a): b}
    if len(found) < 3 * len(triangles):
        raise ValueError("a directed edge of the mesh occurs twice")
    return found


def _wrapped(difference: int) -> int:
    """Difference modulo 256, in -128..127."""
    return (difference + 128) % 256 - 128
