"""Closed polygons: simplification without self-crossings, and tests for points inside and near."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


def area(loop: Ints) -> float:
    """Signed area of a polygon [n, 2], positive for the orientation of the triangles of meshes."""
    x, y = loop.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _off(points: Floats, a: Floats, b: Floats) -> Floats:
    """Squared distances [N] of points [N, 2] from the segment between a and b."""
    chord, to = b - a, points - a
    place = np.clip(to @ chord / max(float(chord @ chord), 1e-12), 0, 1)
    squares: Floats = ((to - place[:, None] * chord) ** 2).sum(1)
    return squares


def simplified(chain: Floats, tolerance: float, length: float) -> list[int]:
    """Simplifies a closed chain of points.

    No point of the chain is further than `tolerance` from the edge that replaces its part (Douglas
    and Peucker, "Algorithms for the reduction of the number of points", 1973). Straight parts are
    divided evenly into pieces of about `length`. A point further than the tolerance from the chain
    keeps its winding number.

    Args:
        chain: float64 [n, 2] points.
        tolerance: Largest distance, in the unit of the points.
        length: Length of edges, in the unit of the points.

    Returns:
        Ascending indices of the points to keep.
    """
    n = len(chain)
    first = int(np.argmax(((chain - chain.mean(0)) ** 2).sum(1)))
    second = int(np.argmax(((chain - chain[first]) ** 2).sum(1)))
    first, second = sorted((first, second))
    kept, todo = {first, second}, [(first, second), (second, first + n)]
    while todo:
        a, b = todo.pop()
        part = chain[np.arange(a, b + 1) % n]
        off, chord = _off(part, part[0], part[-1]), part[-1] - part[0]
        pieces = round(math.hypot(*chord) / length)
        if off.max() > tolerance**2:
            cuts = [int(np.argmax(off))]
        else:
            along = (part - part[0]) @ chord / max(float(chord @ chord), 1e-12)
            nearest = {int(np.argmin(np.abs(along - k / pieces))) for k in range(1, pieces)}
            cuts = sorted(nearest - {0, b - a})
        stops = [a, *(a + c for c in cuts), b]
        kept.update(s % n for s in stops)
        if cuts:
            todo += pairwise(stops)
    return sorted(kept)


def untangled(chains: Sequence[Ints], kept: list[list[int]], scale: Floats) -> tuple[Ints, ...]:
    """Makes polygons of the kept points, and adds points until no polygons touch or cross.

    The chains themselves do not touch, so this ends. Chains that shrank to a line are left out.

    Args:
        chains: Closed chains, int64 [n, 2] lattice points each.
        kept: For each chain the ascending indices of the points to keep.
        scale: Lattice spacing across and down in canvas pixels.

    Returns:
        The polygons, int64 [m, 2] each.
    """
    while True:
        pairs = [(c, k) for c, k in zip(chains, kept, strict=True) if len(k) > 2]
        loops = tuple(c[k] for c, k in pairs)
        bad = touching(loops)
        if not bad.any():
            return loops
        chains, kept = [c for c, _ in pairs], []
        for (chain, keep), marks in zip(pairs, np.split(bad, _ends(loops)), strict=True):
            more = set(keep)
            for i in np.flatnonzero(marks):
                a, b = keep[i], keep[i + 1] if i + 1 < len(keep) else keep[0] + len(chain)
                part = chain[np.arange(a, b + 1) % len(chain)] * scale
                off = _off(part, part[0], part[-1])
                if off.max() > 0:
                    more.add((a + int(np.argmax(off))) % len(chain))
            kept.append(sorted(more))


def _ends(loops: Sequence[Ints]) -> Ints:
    return np.cumsum([len(p) for p in loops])[:-1]


def touching(loops: Sequence[Ints]) -> Bools:
    """Tells which edges touch or cross other edges, except at the common end of two neighbours.

    Args:
        loops: Polygons, int64 [n, 2] each, of at least three different points.

    Returns:
        bool [N] for all edges of all polygons in order; edge i of a polygon starts at point i.
    """
    a = np.concatenate(loops)
    b = np.concatenate([np.roll(p, -1, 0) for p in loops])
    after = np.concatenate([np.roll(k, -1) for k in np.split(np.arange(len(a)), _ends(loops))])
    way, turn = b - a, b[after] - b
    bad: Bools = (way[:, 0] * turn[:, 1] == way[:, 1] * turn[:, 0]) & ((way * turn).sum(1) < 0)
    bad[after[bad]] = True
    low, high = np.minimum(a, b), np.maximum(a, b)
    for i in range(len(a)):
        near = ((low[i] <= high) & (low <= high[i])).all(1)
        near[[i, after[i]]] = False
        near[after == i] = False
        j = np.flatnonzero(near)
        apart = _side(a[i], b[i], a[j]) * _side(a[i], b[i], b[j]) > 0
        apart |= _side(a[j], b[j], a[i]) * _side(a[j], b[j], b[i]) > 0
        bad[i] |= not apart.all()
    return bad


def _side(a: Ints, b: Ints, p: NDArray[Any]) -> NDArray[Any]:
    """Sign of (b - a) x (p - a): the side of the line from a to b on which p lies."""
    u, v = b - a, p - a
    return np.sign(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def winding(points: NDArray[Any], loops: Sequence[Ints]) -> Ints:
    """Winding numbers int64 [N] of polygons [n, 2] around points [N, 2] that lie on none."""
    total = np.zeros(len(points), np.int64)
    for loop in loops:
        for a, b in zip(loop, np.roll(loop, -1, 0), strict=True):
            side = _side(a, b, points)
            up, down = points[:, 1] >= a[1], points[:, 1] >= b[1]
            total += (up & ~down & (side > 0)).astype(np.int64)
            total -= down & ~up & (side < 0)
    return total


def apart(points: Ints, loops: Sequence[Ints], scale: Floats, distance: float) -> Bools:
    """Tells which points are further than `distance` from all polygons.

    Args:
        points: int64 [N, 2] in lattice coordinates.
        loops: Polygons, int64 [n, 2] each, in lattice coordinates.
        scale: Lattice spacing across and down in canvas pixels.
        distance: Distance in canvas pixels.

    Returns:
        bool [N].
    """
    result = np.ones(len(points), np.bool_)
    for loop in loops:
        for a, b in zip(loop * scale, np.roll(loop, -1, 0) * scale, strict=True):
            result &= _off(points * scale, a, b) > distance**2
    return result
