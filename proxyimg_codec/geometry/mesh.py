"""Proxy nodes: a triangle mesh over a layer at rest, its refinement, and its coding.

Hierarchy 1 is a *base* of triangles whose vertices lie on a 256 x 256 lattice. Split flags divide
triangles into four, level by level. Then triangles beside divided ones are closed, so that the
*faces* conform. A file stores vertices, connectivity and flags; no decoder ever runs a mesher.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays
from ..errors import FormatError
from ..limits import Budget
from . import connectivity

Ints = NDArray[np.int64]

FRACTION_BITS = 10
"""Fractional bits of node positions and all posed geometry: they are in 1/1024 canvas pixel."""

LEVELS_MAX = 4
"""Most levels of refinement."""


@dataclass(frozen=True, eq=False)
class Base:
    """Base of a mesh: hierarchy 1, before refinement.

    Attributes:
        origin: x, y of lattice point (0, 0) in whole canvas pixels.
        step: Lattice spacing across and down in 1/1024 canvas pixel; a multiple of 2**levels keeps
            all midpoints exact.
        vertices: uint8 [V, 2] x, y of the vertices on the lattice.
        triangles: int32 [T, 3] vertices of the triangles, all with (b - a) x (c - a) > 0 (x right,
            y down). Every directed edge occurs at most once.
    """

    origin: tuple[int, int]
    step: tuple[int, int]
    vertices: NDArray[np.uint8]
    triangles: NDArray[np.int32]

    @property
    def positions(self) -> Ints:
        """Rest positions of the vertices, int64 [V, 2] in 1/1024 canvas pixel."""
        corner = np.array(self.origin, np.int64) << FRACTION_BITS
        return corner + self.vertices.astype(np.int64) * np.array(self.step, np.int64)


@dataclass(frozen=True, eq=False)
class Refined:
    """Refined mesh: all nodes, and faces that cover the layer once.

    Attributes:
        nodes: int64 [N, 2] rest positions in 1/1024 canvas pixel: the vertices of the base, then
            midpoints, level by level.
        parents: int32 [N, 2] two nodes that a midpoint lies between; for a vertex of the base, the
            vertex itself twice.
        faces: int32 [F, 3] conforming triangles, in the order of the base triangles.
    """

    nodes: Ints
    parents: NDArray[np.int32]
    faces: NDArray[np.int32]


class Mesh:
    """Mesh of a layer: coded fields, which are decoded when they are first needed.

    Args:
        fields: Fields of MESH, without the number of the layer.
        where: Name of the chunk in error messages.
        budget: Running budget of the file; by default a new one.

    Attributes:
        fields: Fields of MESH, without the number of the layer.
    """

    def __init__(
        self,
        fields: Mapping[str, Any],
        where: str = "chunk MESH",
        budget: Budget | None = None,
    ) -> None:
        self.fields = fields
        self._where = where
        self._budget = budget or Budget()

    @staticmethod
    def build(base: Base) -> Mesh:
        """Encodes a base as a mesh without refinement.

        Coding changes the order of vertices and triangles; see `base` for the new one.

        Raises:
            ValueError: A triangle does not have positive area, a directed edge occurs twice, or a
                vertex belongs to no triangle.
        """
        placed = {"origin": list(base.origin), "step": list(base.step)}
        coded = connectivity.encode(base.vertices, base.triangles)
        return Mesh({**placed, **coded, "levels": 0, "splits": b""})

    def split(self, flags: Sequence[NDArray[np.bool_]]) -> Mesh:
        """Returns the mesh with other split flags.

        Args:
            flags: For each level, True for triangles that become four: bool [T] for the triangles
                of `base`, then bool [4 n] for the children, in order, of the n that were split.
                Levels without any are left out.
        """
        kept = [f for f in flags if f.any()]
        data = b""
        for values in kept:
            coded = arrays.encode(
                values.astype(np.int64)[None, None], 1, np.ones((1, len(values)), bool)
            )
            data += len(coded).to_bytes(4, "little") + coded
        return Mesh({**self.fields, "levels": len(kept), "splits": data}, self._where)

    @cached_property
    def base(self) -> Base:
        """Base of the mesh, in the order of the file.

        Raises:
            FormatError: The coded mesh is corrupt.
        """
        vertices, triangles = connectivity.decode(self.fields, self._where)
        (x, y), (across, down) = self.fields["origin"], self.fields["step"]
        return Base((x, y), (across, down), vertices, triangles)

    @cached_property
    def splits(self) -> list[NDArray[np.bool_]]:
        """Split flags of each level, bool [triangles of the level], in the order of the file.

        Raises:
            FormatError: The coded mesh is corrupt.
            LimitError: The mesh has more faces than the budget allows.
        """
        data, at = self.fields["splits"], 0
        flags, count = [], len(self.base.triangles)
        for _ in range(self.fields["levels"]):
            end = at + 4 + int.from_bytes(data[at : at + 4], "little")
            if end > len(data) or count == 0:
                raise FormatError("split flags are truncated", self._where, rule="MSH-11")
            self._budget.spend("faces", 4 * count)
            values = arrays.decode(data[at + 4 : end], (1, 1, count), 1, np.ones((1, count), bool))
            flags.append(values[0, 0] > 0)
            count, at = 4 * int(flags[-1].sum()), end
        if at != len(data) or (flags and not flags[-1].any()):
            raise FormatError(
                "split flags do not end where they should", self._where, rule="MSH-11"
            )
        return flags

    @cached_property
    def refined(self) -> Refined:
        """Nodes and faces of the refined mesh.

        Raises:
            FormatError: The coded mesh is corrupt.
            LimitError: The mesh has more faces than the budget allows.
        """
        return refine(self.base, self.splits)


def refine(base: Base, splits: Sequence[NDArray[np.bool_]]) -> Refined:
    """Splits triangles into four by flags, then closes triangles that have a split edge.

    The children of the triangle (a, b, c) with midpoints d of ab, e of bc and f of ca are
    (a, d, f), (d, b, e), (f, e, c), (d, e, f). Midpoints of a level are numbered by ascending ends
    (smaller, larger). Faces are in the order of the base triangles that they lie in, so that whole
    parts of a bent mesh win where it overlaps. Within a base triangle, unsplit triangles come
    first, level by level, then the children of the last level, then closing triangles.

    Args:
        base: Base of the mesh.
        splits: Split flags of each level, as for `Mesh.split`.
    """
    nodes = base.positions
    parents = np.repeat(np.arange(len(nodes), dtype=np.int32)[:, None], 2, axis=1)
    triangles, done = base.triangles, []
    origin, origins = np.arange(len(triangles)), []
    for split in splits:
        done.append(triangles[~split])
        origins.append(origin[~split])
        parts = triangles[split]
        ends = np.unique(np.sort(_edges(parts).reshape(-1, 2), axis=1), axis=0)
        fresh = ends[_midpoints(parents, len(base.vertices), ends) < 0]
        nodes = np.concatenate([nodes, (nodes[fresh[:, 0]] + nodes[fresh[:, 1]]) >> 1])
        parents = np.concatenate([parents, fresh.astype(np.int32)])
        middle = _midpoints(parents, len(base.vertices), _edges(parts).reshape(-1, 2))
        (a, b, c), (d, e, f) = parts.T, middle.reshape(-1, 3).T
        four = np.stack([a, d, f, d, b, e, f, e, c, d, e, f], axis=1)
        triangles = four.reshape(-1, 3).astype(np.int32)
        origin = np.repeat(origin[split], 4)
    faces, origin = _close(
        np.concatenate([*done, triangles]),
        np.concatenate([*origins, origin]),
        parents,
        len(base.vertices),
    )
    return Refined(nodes, parents, faces[np.argsort(origin, kind="stable")])


def _edges(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Edges ab, bc and ca of triangles, int32 [T, 3, 2]."""
    return np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)


def _midpoints(parents: NDArray[np.int32], vertices: int, ends: NDArray[np.int32]) -> Ints:
    """Finds the midpoints of edges.

    Args:
        parents: int32 [N, 2] parents of all nodes so far.
        vertices: Number of vertices of the base.
        ends: int32 [M, 2] nodes at the ends of the edges.

    Returns:
        int64 [M] midpoint of each edge; -1 if it has none.
    """
    count = len(parents)
    if count == vertices or not len(ends):
        return np.full(len(ends), -1, np.int64)
    keys = parents[vertices:, 0].astype(np.int64) * count + parents[vertices:, 1]
    order = np.argsort(keys)
    low, high = ends.min(1).astype(np.int64), ends.max(1)
    wanted = low * count + high
    at = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
    return np.where(keys[order[at]] == wanted, vertices + order[at], -1)


def _close(
    triangles: NDArray[np.int32], origin: Ints, parents: NDArray[np.int32], vertices: int
) -> tuple[NDArray[np.int32], Ints]:
    """Divides triangles at midpoints on their edges, until no node lies inside an edge.

    Args:
        triangles: int32 [T, 3] triangles.
        origin: int64 [T] base triangle that each lies in.
        parents: int32 [N, 2] parents of all nodes.
        vertices: Number of vertices of the base.

    Returns:
        int32 [F, 3] faces, and int64 [F] the base triangle that each lies in.
    """
    done, origins = [], []
    while True:
        middle = _midpoints(parents, vertices, _edges(triangles).reshape(-1, 2)).reshape(-1, 3)
        split = (middle >= 0).sum(1)
        done.append(triangles[split == 0])
        origins.append(origin[split == 0])
        if not split.any():
            return np.concatenate(done), np.concatenate(origins)
        # Turn each triangle so that an unsplit edge is last, and a lone split edge first.
        turn = np.where(split == 1, np.argmax(middle >= 0, 1), (np.argmin(middle, 1) + 1) % 3)
        turn[split == 3] = 0
        at = (turn[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(triangles, at, 1)
        middle = np.take_along_axis(middle, at, 1).astype(np.int32)
        (a, b, c), (d, e, f) = corner.T, middle.T
        patterns = {
            1: (a, d, c, d, b, c),
            2: (d, b, e, a, d, c, d, e, c),
            3: (a, d, f, d, b, e, f, e, c, d, e, f),
        }
        parts = [np.stack(p, axis=1)[split == n].reshape(-1, 3) for n, p in patterns.items()]
        triangles = np.concatenate(parts)
        origin = np.concatenate([np.repeat(origin[split == n], n + 1) for n in patterns])
