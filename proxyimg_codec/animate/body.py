"""Body: a layer, or a union of layers, in the simulation; its mesh at rest, and choice of nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from .motion_types import Disc, Rectangle, Spot

Real = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

BAND = 0.06
"""Width of the band of nodes at the top, bottom, left or right, relative to the side of the box."""

MIDDLE = 0.1
"""Radius of the centre of a body, relative to its diagonal."""


@dataclass(frozen=True, eq=False)
class Body:
    """Body of the simulation, with its mesh at rest.

    Attributes:
        name: Name of the layer; of a union of layers, that of the first.
        nodes: float64 [N, 2] rest positions of the nodes in canvas pixels.
        faces: int [F, 3] nodes of the triangles.
    """

    name: str
    nodes: Real
    faces: NDArray[np.integer]

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the box around the nodes in canvas pixels."""
        return float(np.hypot(*np.ptp(self.nodes, axis=0)))

    @cached_property
    def areas(self) -> Real:
        """Signed areas of the faces, float64 [F], in square pixels."""
        (ax, ay), (bx, by), (cx, cy) = self.nodes[self.faces].transpose(1, 2, 0)
        return np.asarray((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2

    @cached_property
    def sides(self) -> tuple[Index, Index, Index]:
        """Edges and sides of faces.

        int64 [E, 2] edges, each with the smaller node first; then for each of the 3 F sides its
        edge, int64 [3F], and its face, int64 [3F].
        """
        sides = np.concatenate(
            [self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]]
        )
        edges, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        face = np.tile(np.arange(len(self.faces)), 3)
        return edges.astype(np.int64), number.reshape(-1), face

    @cached_property
    def rim(self) -> Index:
        """Edges that belong to a single face, int64 [E, 2]."""
        edges, number, _ = self.sides
        return np.asarray(edges[np.bincount(number, minlength=len(edges)) == 1])

    @cached_property
    def loose(self) -> Mask:
        """Mask of the nodes that belong to no face, bool [N]."""
        free = np.ones(len(self.nodes), bool)
        free[self.faces.ravel()] = False
        return free

    @cached_property
    def nearest(self) -> Index:
        """For each loose node, the nearest node that belongs to a face; int64 [loose nodes]."""
        firm = np.flatnonzero(~self.loose)
        away = self.nodes[self.loose][:, None] - self.nodes[firm]
        return np.asarray(firm[(away**2).sum(2).argmin(1)]) if len(firm) else firm

    def bends(self) -> tuple[Index, Index]:
        """Pairs of faces with a common edge.

        Returns:
            int64 [B, 2] corners of the two faces that are not on the edge, and int64 [B, 2] faces.
        """
        _, number, face = self.sides
        far = self.faces[:, [2, 0, 1]].T.reshape(-1)
        order = np.argsort(number, kind="stable")
        first = np.flatnonzero(number[order][1:] == number[order][:-1])
        pairs = np.stack([order[first], order[first + 1]], axis=1)
        pairs = pairs[far[pairs[:, 0]] != far[pairs[:, 1]]]
        return far[pairs].astype(np.int64), face[pairs]

    def caught(self, spot: Spot, path: str) -> Mask:
        """Finds the nodes in a spot.

        Args:
            spot: A side, the border, the centre, a disc or a rectangle.
            path: Place of the spot in the motion, for error messages.

        Returns:
            bool [N], True for nodes in the spot.

        Raises:
            UsageError: No node is in the disc or rectangle.
        """
        low, high = self.nodes.min(0), self.nodes.max(0)
        x, y = self.nodes.T
        band = BAND * (high - low)
        if isinstance(spot, Disc):
            return self.within(spot.at, spot.radius, path)
        if isinstance(spot, Rectangle):
            x0, y0, width, height = spot.box
            mask = (x >= x0) & (x <= x0 + width) & (y >= y0) & (y <= y0 + height)
            if not mask.any():
                raise UsageError(
                    f"{path}: no node of layer {self.name!r} lies in this box; its nodes lie in x "
                    f"{low[0]:.0f}..{high[0]:.0f}, y {low[1]:.0f}..{high[1]:.0f}"
                )
            return np.asarray(mask)
        if spot == "border":
            mask = np.zeros(len(x), bool)
            mask[self.rim.ravel()] = True
            return mask
        if spot == "centre":
            away = np.hypot(*((low + high) / 2 - self.nodes).T)
            return np.asarray(away <= max(MIDDLE * self.diagonal, away.min()))
        sides = {
            "top": y <= low[1] + band[1],
            "bottom": y >= high[1] - band[1],
            "left": x <= low[0] + band[0],
            "right": x >= high[0] - band[0],
        }
        return np.asarray(sides[spot])

    def within(self, at: tuple[float, float], radius: float, path: str) -> Mask:
        """Finds the nodes in a disc.

        Args:
            at: Centre in canvas pixels.
            radius: Radius in canvas pixels.
            path: Place of the disc in the motion, for error messages.

        Returns:
            bool [N], True for nodes in the disc.

        Raises:
            UsageError: No node is in the disc.
        """
        away = np.hypot(*(self.nodes - at).T)
        if away.min() > radius:
            raise UsageError(
                f"{path}: no node of layer {self.name!r} lies within {radius:g} px of "
                f"{at[0]:g}, {at[1]:g}; the nearest is {away.min():.1f} px away"
            )
        return np.asarray(away <= radius)

    def distance(self, some: Mask) -> Real:
        """Distance in pixels, float64 [N], of nodes from the nearest one of `some`, bool [N]."""
        nearest = np.full(len(self.nodes), np.inf)
        for x, y in self.nodes[some].tolist():
            square = (self.nodes[:, 0] - x) ** 2 + (self.nodes[:, 1] - y) ** 2
            np.minimum(nearest, square, out=nearest)
        return np.asarray(np.sqrt(nearest))

    def holding(self, points: Real) -> tuple[Index, Real]:
        """Finds the faces that hold points.

        A point outside the mesh takes the face with the largest least weight; some of its weights
        are negative.

        Args:
            points: float64 [n, 2] points in canvas pixels.

        Returns:
            int64 [n, 3] nodes of the face of each point, and float64 [n, 3] barycentric weights.
        """
        faces = self.faces[np.abs(self.areas) > 0]
        a, b, c = self.nodes[faces].transpose(1, 0, 2)  # [F, 2]
        cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        away = points[:, None] - a  # [n, F, 2]
        u = (away[..., 0] * (c - a)[:, 1] - away[..., 1] * (c - a)[:, 0]) / cross
        v = ((b - a)[:, 0] * away[..., 1] - (b - a)[:, 1] * away[..., 0]) / cross
        weights = np.stack([1 - u - v, u, v], axis=2)
        best = weights.min(2).argmax(1)
        return faces[best].astype(np.int64), weights[np.arange(len(points)), best]
