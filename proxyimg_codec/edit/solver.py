"""Direct solver for the linear systems of triangle meshes, in numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError

Real = NDArray[np.float64]
Index = NDArray[np.int64]

BLOCK, WIDEST = 40, 1000
"""Nodes in a block of the factorization: the number aimed at, and the most that are allowed."""


class BlockTridiagonal:
    """Direct solver for the symmetric definite matrix of a mesh, cut into rows of nodes.

    Nodes at equal distance (in edges) from one end of the mesh form a level. A triangle spans at
    most two adjacent levels, so that the matrix is block tridiagonal in that order. Memory grows
    with the square of the widths of the levels, and time with their cube. A width is about sqrt(N).

    Args:
        count: Number N of nodes.
        *elements: int64 [E, 3] nodes of the elements; the first array has the triangles, which
            connect all nodes.

    Raises:
        LimitError: A block would have more than `WIDEST` nodes.
    """

    def __init__(self, count: int, *elements: Index) -> None:
        triangles = elements[0]
        level = _levels(count, triangles, 0)
        level = _levels(count, triangles, int(level.argmax()))
        sizes = np.bincount(level)
        _, block = np.unique((np.cumsum(sizes) - sizes) // BLOCK, return_inverse=True)
        owner = block[level]
        self.order = np.argsort(owner, kind="stable")
        self.size = np.bincount(owner)
        if self.size.max() > WIDEST:
            raise LimitError(
                f"the mesh is too wide to deform: {self.size.max()} nodes are equally far from one "
                f"end, at most {WIDEST} may be; mesh the layer anew with fewer nodes"
            )
        self.ends = np.concatenate([[0], np.cumsum(self.size)])
        place = np.empty(count, np.int64)
        place[self.order] = np.arange(count) - np.repeat(self.ends[:-1], self.size)
        corners = np.concatenate(elements)
        row, column = np.repeat(corners, 3, 1).ravel(), np.tile(corners, 3).ravel()
        k = owner[row]
        self.diagonal, self.below = k == owner[column], k == owner[column] + 1
        self.areas = np.concatenate([[0], np.cumsum(self.size**2)])
        self.strips = np.concatenate([[0], np.cumsum(self.size[1:] * self.size[:-1])])
        at = place[row] * self.size[owner[column]] + place[column]
        self.diagonal_at = (self.areas[k] + at)[self.diagonal]
        self.below_at = (self.strips[k - 1] + at)[self.below]

    def factor(self, elements: Real) -> None:
        """Factors the sum of element matrices, float64 [E, 3, 3] in the order of construction."""
        values = elements.ravel()
        square = np.zeros(self.areas[-1])
        strip = np.zeros(self.strips[-1])
        np.add.at(square, self.diagonal_at, values[self.diagonal])
        np.add.at(strip, self.below_at, values[self.below])
        self.inverse: list[Real] = []
        self.carry: list[Real] = []
        for k, size in enumerate(self.size.tolist()):
            block = square[self.areas[k] : self.areas[k + 1]].reshape(size, size)
            if k:
                coupling = strip[self.strips[k - 1] : self.strips[k]].reshape(size, -1)
                self.carry.append(coupling @ self.inverse[-1])
                block -= self.carry[-1] @ coupling.T
            self.inverse.append(np.asarray(np.linalg.inv(block), np.float64))

    def solve(self, right: Real) -> Real:
        """Solves the system for each column of `right` float64 [N, K]; returns [N, K]."""
        ordered = right[self.order]
        parts = [ordered[a:b] for a, b in zip(self.ends[:-1], self.ends[1:], strict=True)]
        for k, carry in enumerate(self.carry):
            parts[k + 1] = parts[k + 1] - carry @ parts[k]
        parts[-1] = self.inverse[-1] @ parts[-1]
        for k in range(len(parts) - 2, -1, -1):
            parts[k] = self.inverse[k] @ parts[k] - self.carry[k].T @ parts[k + 1]
        out = np.empty_like(right)
        out[self.order] = np.concatenate(parts)
        return out


def _levels(count: int, triangles: Index, start: int) -> Index:
    """Distance in edges of every node of a connected mesh from the node `start`, int64 [N]."""
    level, k = np.full(count, -1), 0
    level[start] = 0
    while True:
        near = triangles[(level[triangles] == k).any(1)]
        new = near[level[near] < 0]
        if not len(new):
            return level
        k += 1
        level[new] = k
