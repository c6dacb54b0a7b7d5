"""Outline that a mesh has to fill: simple polygons around the shape of a layer, with padding."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from . import coverage as cover
from .boundary import Boundary
from .polygons import apart, area, simplified, untangled, winding

CELLS = 255
"""Cells of the lattice across and down; lattice points have the coordinates 0..CELLS."""

PADDING = 2.5
"""Least distance of the shape from the rim of the mesh, in canvas pixels. So every pixel that the
shape touches has its centre at least 2 pixels inside."""

EDGE_RANGE = 0.01, 1.0
"""Range of the target edge length, relative to the diagonal of the shape."""

SHORTEST = 4.0
"""Shortest target edge length in canvas pixels; a finer mesh would only divide the padding."""

ROUNDS = 5
"""Number of attempts to get few enough triangles; each is twice as coarse as the one before."""

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Box = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class Outline:
    """Polygons that a mesh has to fill, on a lattice over a padded rectangle.

    Attributes:
        origin: x, y in whole canvas pixels of lattice point (0, 0).
        step: Lattice spacing across and down in 1/1024 canvas pixel, positive multiples of 4.
        covered: bool [CELLS, CELLS], True for the cells that hold a part of the shape.
        loops: Polygons, int64 [n, 2] corners each in lattice coordinates, at most about an edge
            length apart. They are simple, have no points in common, and lie at least `PADDING`
            from the shape. Outer polygons have positive area, holes negative.
        points: int64 [P, 2] lattice points inside, about an edge length from each other and at
            least half of that from the loops.
        length: Target edge length in canvas pixels.
    """

    origin: tuple[int, int]
    step: tuple[int, int]
    covered: Bools
    loops: tuple[Ints, ...]
    points: Ints
    length: float

    @property
    def scale(self) -> Floats:
        """Lattice spacing across and down in canvas pixels, float64 [2]."""
        return np.array(self.step) / 1024

    @property
    def triangles(self) -> int:
        """Most triangles that fill the loops with these points (Euler's formula)."""
        parts = sum(1 if area(p) > 0 else -1 for p in self.loops)
        return 2 * len(self.points) + sum(map(len, self.loops)) - 2 * parts


def triangles_max(edge: float) -> int:
    """Most triangles of an outline: eight times those that fill a square, but at least 32."""
    return max(32, int(4 / (0.43 * edge**2)))


def outline(boundary: Boundary | None, size: tuple[int, int], edge: float) -> Outline:
    """Makes the outline of a padded shape, simplified and divided into edges.

    If a mesh would have more than `triangles_max` triangles, padding and tolerance are doubled, in
    at most `ROUNDS` attempts. If that does not help, the outline is the padded rectangle.

    Args:
        boundary: Boundary that encloses the shape; None for the whole canvas.
        size: Width and height of the canvas in pixels; only used if `boundary` is None.
        edge: Target edge length relative to the diagonal of the box around the shape and its
            padding, 0.01..1; in pixels it is never less than `SHORTEST`.

    Raises:
        UsageError: `edge` is out of range.
    """
    if not EDGE_RANGE[0] <= edge <= EDGE_RANGE[1]:
        raise UsageError(f"edge length {edge} must be within {EDGE_RANGE[0]}..{EDGE_RANGE[1]}")
    box = (0, 0, *size) if boundary is None else boundary.bounds()
    width, height = box[2] - box[0] + 2 * PADDING, box[3] - box[1] + 2 * PADDING
    length = max(edge * math.hypot(width, height), SHORTEST)
    # Distance between a slanting line and the staircase of cells that stands for it.
    stairs = width * height / math.hypot(width, height) / CELLS
    tolerance, padding = max(1.5 * stairs, min(length / 8, SHORTEST)), PADDING
    for _ in range(ROUNDS):
        found = _outline(boundary, box, padding, tolerance, length)
        if found.triangles <= triangles_max(edge):
            return found
        padding, tolerance = 2 * padding, 2 * tolerance
    return _outline(None, box, PADDING, stairs, length)


def _outline(
    boundary: Boundary | None, box: Box, padding: float, tolerance: float, length: float
) -> Outline:
    """Makes an outline at the distance `padding` around a shape; None is the shape of the box."""
    reach = padding + tolerance
    pad_x, step_x, across = _frame(box[2] - box[0], reach)
    pad_y, step_y, down = _frame(box[3] - box[1], reach)
    origin, step = (box[0] - pad_x, box[1] - pad_y), (step_x, step_y)
    if boundary is None:
        corners = np.array(box)[[0, 1, 2, 1, 2, 3, 0, 3]].reshape(4, 2)
        boundary = Boundary(0, (np.repeat(corners, 3, axis=0),))
    covered = _covered(boundary, origin, step)
    scale = np.array(step) / 1024
    chains = _trace(_without_contacts(_dilated(covered, across, down)))
    # Small holes would need small triangles, and simplification could invert them.
    smallest = max(2 * tolerance, length / 4) ** 2 / scale.prod()
    filled = [c for c in chains if -smallest < area(c) < 0]
    chains = [c for c in chains if not -smallest < area(c) < 0]
    within = winding(np.array([c[0] for c in chains]), filled) != 0
    chains = [c for c, gone in zip(chains, within, strict=True) if not gone]
    picks = [simplified(c * scale, tolerance, length) for c in chains]
    loops = untangled(chains, picks, scale)
    return Outline(origin, step, covered, loops, _inside(loops, scale, length), length)


def _frame(extent: int, reach: float) -> tuple[int, int, int]:
    """Padding in pixels, lattice step, and number of cells for `reach` pixels, along one axis."""
    pad = math.ceil(reach)
    while True:
        step = 4 * -(-1024 * (extent + 2 * pad) // (4 * CELLS))
        cells = math.ceil(reach * 1024 / step)
        if cells * step <= 1024 * pad:
            return pad, step, cells
        pad += 1


def _covered(boundary: Boundary, origin: tuple[int, int], step: tuple[int, int]) -> Bools:
    """Cells bool [CELLS, CELLS] that hold a part of the shape or of its boundary."""
    paths = [
        np.stack(
            [cover.to_output(p[:, k], boundary.unit, origin[k], step[k], 1024) for k in (0, 1)],
            axis=1,
        )
        for p in boundary.paths
    ]
    covered = cover.coverage(paths, 0, 0, CELLS, CELLS) > 0
    # Parts that are thin, or wound in both directions, may have no area in their cells.
    for path in paths:
        start, end = cover.flatten(path)
        count = np.abs(end - start).max(1) // (cover.ONE // 2) + 1
        edge = np.repeat(np.arange(len(count)), count)
        part = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        at = start[edge] + (end - start)[edge] * part[:, None] // count[edge][:, None]
        x, y = np.clip(at // cover.ONE, 0, CELLS - 1).T
        covered[y, x] = True
    return covered


def _dilated(mask: Bools, across: int, down: int) -> Bools:
    """Mask dilated by a rectangle that reaches `across` and `down` cells to each side."""
    for axis, reach in ((1, across), (0, down)):
        total = np.cumsum(np.insert(mask, 0, False, axis=axis), axis=axis)
        at = np.arange(mask.shape[axis])
        high = total.take(np.minimum(at + reach + 1, len(at)), axis=axis)
        mask = high > total.take(np.maximum(at - reach, 0), axis=axis)
    return mask


def _without_contacts(mask: Bools) -> Bools:
    """Adds cells to a mask until no two cells touch only at a corner."""
    mask = mask.copy()
    while True:
        a, b, c, d = mask[:-1, :-1], mask[:-1, 1:], mask[1:, :-1], mask[1:, 1:]
        contact = (a == d) & (b == c) & (a != b)
        if not contact.any():
            return mask
        for part in (a, b, c, d):
            part |= contact


def _trace(mask: Bools) -> list[Ints]:
    """Traces the borders of a mask of cells: loops of all lattice points in order, [n, 2] each."""
    solid = np.pad(mask, 1)
    width = CELLS + 1
    follows: dict[int, int] = {}
    for shift, axis, tail, head in (
        (1, 0, 0, 1),
        (-1, 1, 1, width + 1),
        (-1, 0, width + 1, width),
        (1, 1, width, 0),
    ):
        y, x = np.nonzero(solid & ~np.roll(solid, shift, axis))
        corner = (y - 1) * width + x - 1
        follows.update(zip((corner + tail).tolist(), (corner + head).tolist(), strict=True))
    loops = []
    for start in sorted(follows):
        loop = []
        while start in follows:
            loop.append(start)
            start = follows.pop(start)
        if loop:
            at = np.array(loop)
            loops.append(np.stack([at % width, at // width], axis=1))
    return loops


def _inside(loops: Sequence[Ints], scale: Floats, length: float) -> Ints:
    """Points inside, on a nearly equilateral lattice, at least half of `length` from the loops.

    Spacings are whole lattice steps, so each point is exactly where the coding of a mesh predicts
    it.
    """
    half = max(round(length / scale[0] / 2), 1)
    down = max(round(length * math.sqrt(0.75) / scale[1]), 1)
    rows, columns = CELLS // (2 * down) + 1, CELLS // (4 * half) + 1
    row, column = np.mgrid[-rows : rows + 1, -columns : columns + 1]
    grid = np.stack([half * (2 * column + row % 2), down * row], axis=-1).reshape(-1, 2)
    points = grid + CELLS // 2
    points = points[((points > 0) & (points < CELLS)).all(1)]
    points = points[winding(points, loops) > 0]
    return points[apart(points, loops, scale, length / 2)]
