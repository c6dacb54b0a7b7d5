"""A layer as the simulation sees it: its mesh at rest, and choosing nodes of it."""

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
"""Share of the box of a layer that its top, bottom, left or right is."""

MIDDLE = 0.1
"""Radius of a layer's middle, relative to its diagonal."""


@dataclass(frozen=True, eq=False)
class Body:
    """A layer with its mesh at rest.

    Attributes:
        name: The layer's.
        nodes: float64 [N, 2] in canvas pixels.
        faces: int [F, 3].
    """

    name: str
    nodes: Real
    faces: NDArray[np.integer]

    @cached_property
    def diagonal(self) -> float:
        """Of the box round the nodes, in pixels."""
        return float(np.hypot(*np.ptp(self.nodes, axis=0)))

    @cached_property
    def areas(self) -> Real:
        """Signed areas of the faces [F] in square pixels."""
        (ax, ay), (bx, by), (cx, cy) = self.nodes[self.faces].transpose(1, 2, 0)
        return np.asarray((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2

    @cached_property
    def sides(self) -> tuple[Index, Index, Index]:
        """Edges [E, 2] with the smaller node first, the edge [3F] of each side, and its face."""
        sides = np.concatenate(
            [self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]]
        )
        edges, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        face = np.tile(np.arange(len(self.faces)), 3)
        return edges.astype(np.int64), number.reshape(-1), face

    @cached_property
    def rim(self) -> Index:
        """Edges [E, 2] that belong to one face."""
        edges, number, _ = self.sides
        return np.asarray(edges[np.bincount(number, minlength=len(edges)) == 1])

    @cached_property
    def loose(self) -> Mask:
        """Which nodes belong to no face [N]."""
        free = np.ones(len(self.nodes), bool)
        free[self.faces.ravel()] = False
        return free

    @cached_property
    def nearest(self) -> Index:
        """For each of the loose nodes the nearest node that belongs to a face."""
        firm = np.flatnonzero(~self.loose)
        away = self.nodes[self.loose][:, None] - self.nodes[firm]
        return np.asarray(firm[(away**2).sum(2).argmin(1)]) if len(firm) else firm

    def bends(self) -> tuple[Index, Index]:
        """Far corners [B, 2] of adjacent faces, and those faces [B, 2]."""
        _, number, face = self.sides
        far = self.faces[:, [2, 0, 1]].T.reshape(-1)
        order = np.argsort(number, kind="stable")
        first = np.flatnonzero(number[order][1:] == number[order][:-1])
        pairs = np.stack([order[first], order[first + 1]], axis=1)
        pairs = pairs[far[pairs[:, 0]] != far[pairs[:, 1]]]
        return far[pairs].astype(np.int64), face[pairs]

    def caught(self, spot: Spot, path: str) -> Mask:
        """Which nodes [N] a spot catches.

        Args:
            spot: A side, a disc or a rectangle.
            path: Where the motion says so, for the error.

        Raises:
            UsageError: It catches none.
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
        """Which nodes [N] lie in a disc.

        Raises:
            UsageError: None does.
        """
        away = np.hypot(*(self.nodes - at).T)
        if away.min() > radius:
            raise UsageError(
                f"{path}: no node of layer {self.name!r} lies within {radius:g} px of "
                f"{at[0]:g}, {at[1]:g}; the nearest is {away.min():.1f} px away"
            )
        return np.asarray(away <= radius)

    def distance(self, some: Mask) -> Real:
        """How far each node is from the nearest of `some` [N], in pixels [N]."""
        nearest = np.full(len(self.nodes), np.inf)
        for x, y in self.nodes[some].tolist():
            square = (self.nodes[:, 0] - x) ** 2 + (self.nodes[:, 1] - y) ** 2
            np.minimum(nearest, square, out=nearest)
        return np.asarray(np.sqrt(nearest))

    def holding(self, points: Real) -> tuple[Index, Real]:
        """For each of `points` [n, 2] the face's nodes [n, 3] and weights [n, 3] that make it.

        A point outside the mesh takes the face that it is least far outside of.
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
