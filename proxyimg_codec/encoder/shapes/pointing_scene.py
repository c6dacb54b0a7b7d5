"""Small pieces of a picture, and how likely each belongs to the same object as a point."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .hierarchy import borders
from .maps import Maps

Floats = NDArray[np.float64]
Labels = NDArray[np.intp]

SIDE = 400
"""Longer side, in pixels, of the copy of the picture in which objects are sought."""

BLUR = 1.5
"""Smoothing of the boundary map, in pixels, before it is cut into basins."""

LIGHTNESS = 0.6
"""Weight of lightness in differences of colour; light and shade change it most."""

NEAR = 0.15
"""Length of paths, in boundary strength, within which colours are those of the object."""

PATH_COST = 0.02
"""Cost of a step between two basins beside the boundary strength."""

WALKS = (6.0, 12.0)
"""How much boundaries hinder the random walks that measure nearness."""

STOP = 0.01
"""How likely a random walk ends in a basin of mean size."""

LINE = 48
"""Places at which the boundary is looked at along a line."""

WEIGHTS = {
    "bias": 5.379, "path": 0.434, "highest": -5.166, "colour": -0.816, "figure difference": -1.401,
    "figure": 0.319, "figure there": -0.095, "line": 0.33, "line top": -2.903, "away": -1.334,
    "away down": -0.703, "away across": -1.62, "frame": 0.143, "walk": 0.189, "shy walk": 0.393,
}  # fmt: skip
"""Logistic regression of "belongs to the object that holds the point" on the measures of
`Scene.likeness`: `training/pointing.py` fits it."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Basins of the boundary map of a picture, N of them, in a reduced copy.

    Attributes:
        labels: int [h, w] basin of each pixel.
        area: float64 [N] pixels.
        shared: float64 [N, N] length of the border that two basins share.
        strength: float64 [N, N] mean boundary along it; infinite where there is none.
        colour: float64 [N, 3] mean Lab, with less lightness, divided by 50.
        figure: float64 [N] mean of the figure map.
        centre: float64 [N, 2] mean row and column.
        frame: float64 [N] 1 for basins at the frame of the picture, else 0.
        boundary: float32 [h, w] boundary map.
    """

    labels: Labels
    area: Floats
    shared: Floats
    strength: Floats
    colour: Floats
    figure: Floats
    centre: Floats
    frame: Floats
    boundary: NDArray[np.float32]

    def likeness(self, row: int, column: int) -> Floats:
        """Probability, float64 [N], that basins belong to the object at a pixel of the copy."""
        measures = self.measures(row, column)
        score = sum(WEIGHTS[name] * values for name, values in measures.items())
        return np.asarray(1 / (1 + np.exp(-np.clip(score + WEIGHTS["bias"], -8, 8))))

    def middle(self, basin: int) -> tuple[int, int]:
        """Row and column of the pixel of a basin that is nearest to its centre."""
        rows, columns = np.nonzero(self.labels == basin)
        nearest = int(np.hypot(*(np.stack([rows, columns], 1) - self.centre[basin]).T).argmin())
        return int(rows[nearest]), int(columns[nearest])

    def measures(self, row: int, column: int) -> dict[str, Floats]:
        """Measures float64 [N] that tell whether basins belong to the object at a pixel."""
        start = int(self.labels[row, column])
        path, highest = self._paths(start)
        near = np.exp(-path / NEAR) * self.area
        near /= near.sum()
        colour, figure = near @ self.colour, float(near @ self.figure)
        away = np.abs(self.centre - (row, column)) / np.hypot(*self.labels.shape)
        length, top = self._lines(row, column)
        walks = [np.log(walk[:, start] / walk[start, start] + 1e-4) for walk in self._walks]
        return {
            "path": np.sqrt(path),
            "highest": highest,
            "colour": np.linalg.norm(self.colour - colour, axis=1),
            "figure difference": np.abs(self.figure - figure),
            "figure": self.figure,
            "figure there": np.full(len(self.area), figure),
            "line": length,
            "line top": top,
            "away": np.linalg.norm(away, axis=1),
            "away down": away[:, 0],
            "away across": away[:, 1],
            "frame": self.frame,
            "walk": walks[0],
            "shy walk": walks[1],
        }

    def _paths(self, start: int) -> tuple[Floats, Floats]:
        """Costs of the cheapest paths from a basin, and the highest boundary on the lowest ones."""
        return (
            _cheapest(self._neighbours, self.strength + PATH_COST, start, np.add),
            _cheapest(self._neighbours, self.strength, start, np.maximum),
        )

    @cached_property
    def _neighbours(self) -> list[Labels]:
        return [np.flatnonzero(row) for row in self.shared]

    @cached_property
    def _walks(self) -> list[Floats]:
        """For each of `WALKS` how often a walk from one basin visits another (Grady, 2006)."""
        end = STOP * self.area / self.area.mean()
        return [np.asarray(np.linalg.inv(self.laplacian(v) + np.diag(end))) for v in WALKS]

    def laplacian(self, shyness: float) -> Floats:
        """Laplacian float64 [N, N] of basins that long and weak borders join.

        Args:
            shyness: How much boundaries part basins.
        """
        bond = self.shared * np.exp(-shyness * np.where(self.shared > 0, self.strength, 0))
        bond /= np.sqrt(self.area.mean())
        return np.asarray(np.diag(bond.sum(1)) - bond)

    def _lines(self, row: int, column: int) -> tuple[Floats, Floats]:
        """Boundary on straight lines from a pixel to all basins: sum / 20, and top sixth."""
        steps = np.linspace(0, 1, LINE)
        y, x = (
            (start + (end[:, None] - start) * steps).astype(np.float32)
            for start, end in zip((row, column), self.centre.T, strict=True)
        )
        values = cv2.remap(self._soft, x, y, cv2.INTER_LINEAR).astype(np.float64)
        distance = np.hypot(*(self.centre - (row, column)).T)
        return values.mean(1) * distance / 20, np.sort(values, 1)[:, -LINE // 6 :].mean(1)

    @cached_property
    def _soft(self) -> NDArray[np.float32]:
        return np.asarray(cv2.GaussianBlur(self.boundary, (0, 0), 1))


def scene_of(rgb: NDArray[np.uint8], maps: Maps) -> Scene:
    """Cuts a picture into basins.

    Args:
        rgb: uint8 [H, W, 3] picture in sRGB.
        maps: Its maps.
    """
    height, width = rgb.shape[:2]
    scale = min(1.0, SIDE / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))

    def small(plane: NDArray[Any]) -> NDArray[np.float32]:
        return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)

    boundary, figure = small(maps.boundary), small(maps.figure)
    lab = cv2.cvtColor(small(rgb) / 255, cv2.COLOR_RGB2LAB) * (LIGHTNESS / 50, 1 / 50, 1 / 50)
    labels = _basins(boundary)
    count = int(labels.max()) + 1
    area = np.bincount(labels.ravel()).astype(np.float64)

    def mean(plane: NDArray[Any]) -> Floats:
        return np.asarray(np.bincount(labels.ravel(), plane.ravel(), count) / area)

    places: NDArray[Any] = np.indices(labels.shape)
    shared, strength = _borders(labels, boundary)
    frame = np.zeros(count)
    frame[np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])] = 1
    return Scene(
        labels, area, shared, strength, np.stack([mean(lab[..., c]) for c in range(3)], 1),
        mean(figure), np.stack([mean(places[0]), mean(places[1])], 1), frame, boundary,
    )  # fmt: skip


def _basins(boundary: NDArray[np.float32]) -> Labels:
    """Basin of each pixel, int [h, w]: where a drop of rain on the boundary map ends."""
    level = cv2.GaussianBlur(boundary, (0, 0), BLUR).astype(np.float64)
    height, width = level.shape
    # Where the map is flat a drop runs to the middle of a square of 40 pixels.
    y, x = np.indices(level.shape)
    level += 1e-6 * (np.hypot(y % 40 - 20, x % 40 - 20) + 1e-3 * y + 1e-4 * x)
    around = np.pad(level, 1, constant_values=np.inf)
    here = np.arange(level.size).reshape(level.shape)
    lowest, target = level.copy(), here.copy()
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            other = around[1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
            lower = other < lowest
            lowest[lower], target[lower] = other[lower], (here + dy * width + dx)[lower]
    flow = target.ravel()
    while (flow[flow] != flow).any():
        flow = flow[flow]
    return np.unique(flow, return_inverse=True)[1].reshape(level.shape)


def _borders(labels: Labels, boundary: NDArray[np.float32]) -> tuple[Floats, Floats]:
    """Length of the border of two basins, and the mean boundary along it, float64 [N, N]."""
    count = int(labels.max()) + 1
    length, total = np.zeros((2, count, count))
    pairs, lengths, sums = borders(labels, boundary)
    for one, other in (pairs.T, pairs.T[::-1]):
        length[one, other], total[one, other] = lengths, sums
    return length, np.divide(total, length, out=np.full_like(total, np.inf), where=length > 0)


def _cheapest(neighbours: list[Labels], costs: Floats, start: int, join: np.ufunc) -> Floats:
    """Costs float64 [N] of the best paths from a node of a graph (Dijkstra).

    Args:
        neighbours: For each node those that it is joined to.
        costs: float64 [N, N] cost of each step.
        start: The node.
        join: Cost of a path and one more step: their sum, or the greater one.
    """
    best = np.full(len(costs), np.inf)
    best[start] = 0
    queue, done = [(0.0, start)], np.zeros(len(costs), np.bool_)
    while queue:
        _, node = heapq.heappop(queue)
        if done[node]:
            continue
        done[node] = True
        near = neighbours[node]
        cost = join(best[node], costs[node, near])
        better = cost < best[near]
        best[near[better]] = cost[better]
        for value, other in zip(cost[better].tolist(), near[better].tolist(), strict=True):
            heapq.heappush(queue, (value, other))
    return best
