"""Closed paths of cubic Bézier segments: samples of a mask's outline, fit, test for crossings."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CHORDS = 16  # straight edges that one cubic is flattened to
_LONG = 6  # px; two straight runs of at least this length meet in a real corner, not in a staircase


@dataclass(frozen=True)
class Outline:
    """Samples along all loops around a mask, one loop after another; coordinates are in px.

    Attributes:
        points: float64 [n, 2] midpoints of the pixel edges along the loop, and the corners to keep.
        joints: float64 [n, 2] smoothed samples; a joint of two segments at a sample is put there.
        corner: bool [n], True for the corners to keep.
        turns: bool [n], False if a sample and its two neighbours lie on a line.
        base: int64 [n] index of the first sample of the same loop.
        size: int64 [n] number of samples of the same loop.
        positive: bool [loops], True for outer contours.
        extent: float64 [2] width and height of the canvas.
    """

    points: Floats
    joints: Floats
    corner: Bools
    turns: Bools
    base: Ints
    size: Ints
    positive: Bools
    extent: Floats

    def at(self, sample: Ints, offset: Ints | int) -> Ints:
        """Index of the sample `offset` places further along the same loop; arrays broadcast."""
        base = self.base[sample]
        return base + (sample - base + offset) % self.size[sample]

    def until(self, flag: Bools) -> Ints:
        """Number of places from each sample to the next flagged one of its loop, int64 [n].

        If no sample of the loop is flagged, it is the size of the loop. `flag` is bool [n].
        """
        every, marked = np.arange(len(flag)), np.append(np.flatnonzero(flag), len(flag))
        stop = self.base + self.size
        after = marked[np.searchsorted(marked[:-1], every, "right")]
        first = marked[np.searchsorted(marked[:-1], self.base)]
        again = np.where(first < stop, first, every) + self.size
        return np.where(after < stop, after, again) - every

    @classmethod
    def of(cls, loops: list[Floats], shape: tuple[int, ...]) -> "Outline":
        """Samples loops.

        Args:
            loops: Loops of `trace`, float64 [corners, 2] each.
            shape: Height and width of the canvas.
        """
        extent = np.array(shape[1::-1], np.float64)
        vertex, count = np.concatenate(loops), np.array([len(p) for p in loops])
        head = np.cumsum(count) - count
        after = np.arange(len(vertex)) + 1
        after[head + count - 1] = head
        leg = vertex[after] - vertex
        length, way = np.abs(leg).sum(1).astype(np.int64), np.sign(leg)
        corner = _corners(vertex, way, length, after, extent)
        # A straight run gives its first vertex, if that is a corner, and midpoints of pixel edges.
        index, place = spread(length + corner)
        place -= corner[index]
        points = vertex[index] + way[index] * np.maximum(place + 0.5, 0)[:, None]
        number = np.add.reduceat(length + corner, head)
        base, size = np.repeat(np.cumsum(number) - number, number), np.repeat(number, number)
        kept, flags = place < 0, np.array([area(p) > 0 for p in loops])
        self = cls(points, points, kept, kept, base, size, flags, extent)
        around = np.array([self.at(np.arange(len(points)), k) for k in range(-3, 4)])
        ring = points[around]
        turns = _cross(ring[3] - ring[2], ring[4] - ring[3]) != 0
        # Savitzky-Golay (quadratic, 7 points) evens staircases out without shrinking curves.
        smooth = np.einsum("k,knd->nd", np.array([-2, 3, 6, 7, 6, 3, -2]) / 21, ring)
        sharp = kept[around].any(0) | (size < 8) | ((points == 0) | (points == extent)).any(1)
        joints = np.where(sharp[:, None], points, smooth)
        return cls(points, joints, kept, turns, base, size, flags, extent)


def _corners(vertex: Floats, way: Floats, length: Ints, after: Ints, extent: Floats) -> Any:
    """Tells the vertices to keep from those of staircases, bool [vertices]."""
    before = np.argsort(after)
    turn = _cross(way[before], way)
    bulge = (turn == turn[before]) & (turn == turn[after])
    long = np.minimum(length, length[before]) >= _LONG
    border = ((vertex == vertex[after]) & ((vertex == 0) | (vertex == extent))).any(1)
    border &= length > 1
    _, twin, seen = np.unique(vertex, axis=0, return_inverse=True, return_counts=True)
    # A vertex that two loops share is not kept: cutting the corner off keeps the loops apart.
    return (bulge | long | border | border[before]) & (seen[twin.reshape(-1)] == 1)


def area(loop: Floats) -> float:
    """Signed shoelace area of a polygon [n, 2], positive for outer contours, in px²."""
    return float(_cross(loop, np.roll(loop, -1, 0)).sum() / 2)


def spread(length: Ints) -> tuple[Ints, Ints]:
    """Enumerates the members of pieces of given lengths.

    Returns:
        int64 [sum of lengths] number of the piece of each member, and its place in the piece.
    """
    piece = np.repeat(np.arange(len(length)), length)
    return piece, np.arange(len(piece)) - np.repeat(np.cumsum(length) - length, length)


def fit_cubics(
    points: Floats, start: Floats | None = None, end: Floats | None = None, *, rounds: int = 4
) -> tuple[Floats, Floats]:
    """Fits one cubic to each of many runs of points, all at once.

    The ends are kept. The inner control points are a least-squares solution. Between solutions, the
    parameters of the points are improved by Gauss-Newton steps (Schneider 1990, "An algorithm for
    automatically fitting digitized curves", Graphics Gems).

    Args:
        points: float64 [runs, n, 2] points, n >= 2; no run may have length zero.
        start: float64 [runs, 2] unit tangents at the first points, pointing along the run; None
            leaves the directions free.
        end: float64 [runs, 2] unit tangents at the last points, pointing back; given if and only
            if `start` is.
        rounds: Number of least-squares solutions per run, at least 1.

    Returns:
        float64 [runs, 4, 2] control points, and float64 [runs] the largest distance between a point
        of the run and the curve at its parameter, in the unit of `points`.
    """
    first, last = points[:, :1], points[:, -1:]
    u = np.zeros(points.shape[:2])
    np.cumsum(np.hypot(*np.moveaxis(np.diff(points, axis=1), 2, 0)), axis=1, out=u[:, 1:])
    u /= u[:, -1:]
    for k in range(rounds):
        v = 1 - u
        inner = np.stack([3 * v * v * u, 3 * v * u * u], 1)
        rest = points - first - (u * u * (3 - 2 * u))[..., None] * (last - first)
        handles = _handles(inner @ inner.transpose(0, 2, 1), inner @ rest, start, end)
        miss = inner.transpose(0, 2, 1) @ handles - rest
        if k + 1 < rounds:
            a, b = handles[:, :1], last - first + handles[:, 1:]
            slope = (v * v)[..., None] * a + (2 * u * v)[..., None] * (b - a)
            slope = 3 * (slope + (u * u)[..., None] * (last - first - b))
            speed = np.maximum(np.einsum("bnd,bnd->bn", slope, slope), 1e-9)
            # Going beyond the nearest point halves the number of rounds that are needed.
            u = np.clip(u - 1.5 * np.einsum("bnd,bnd->bn", miss, slope) / speed, 0, 1)
    control = np.concatenate([first, first + handles[:, :1], last + handles[:, 1:], last], 1)
    return control, np.sqrt(np.einsum("bnd,bnd->bn", miss, miss).max(1))


def _handles(gram: Floats, moment: Floats, start: Floats | None, end: Floats | None) -> Floats:
    """Solves the 2x2 normal equations; returns C1 - P0 and C2 - P1, float64 [runs, 2, 2]."""
    p, q, r = gram[:, 0, 0, None], gram[:, 0, 1, None], gram[:, 1, 1, None]
    one, two = moment[:, 0], moment[:, 1]
    if start is not None and end is not None:
        q = q * (start * end).sum(1, keepdims=True)
        one, two = (one * start).sum(1, keepdims=True), (two * end).sum(1, keepdims=True)
    scale = np.maximum(p * r - q * q, 1e-9)
    one, two = (r * one - q * two) / scale, (p * two - q * one) / scale
    if start is not None and end is not None:
        # Handles that point backwards would make cusps. Without them the error is large, so that
        # the caller rejects the fit.
        one, two = np.maximum(one, 0) * start, np.maximum(two, 0) * end
    return np.stack([one, two], 1)


def segments(path: Ints) -> Ints:
    """Segments [m, 4, 2] of a closed path [3m, 2]; each ends where the next one begins."""
    quads = path.reshape(-1, 3, 2)
    return np.concatenate([quads, np.roll(quads[:, :1], -1, 0)], 1)


def flatten(control: NDArray[Any]) -> Any:
    """Points of cubics [n, 4, 2] at t = k/16, k = 0..16, times 4096.

    Returns:
        [n, 17, 2] of the type of `control`; exact for integers below 2**17 in magnitude.
    """
    k = np.arange(CHORDS + 1)
    j = CHORDS - k
    return np.stack([j**3, 3 * j * j * k, 3 * j * k * k, k**3], 1) @ control


def distance(points: Floats, control: Floats) -> Any:
    """Distance float64 [n] of each point [n, 2] from its own flattened cubic [n, 4, 2]."""
    line = flatten(control) / CHORDS**3
    a, d = line[:, :-1], np.diff(line, axis=1)
    rel = points[:, None] - a
    t = np.clip((rel * d).sum(2) / np.maximum((d * d).sum(2), 1e-12), 0, 1)
    return np.hypot(*np.moveaxis(rel - t[..., None] * d, 2, 0)).min(1)


def faults(paths: list[Ints], positive: Bools) -> list[Bools]:
    """Finds the segments that make a boundary improper.

    Paths are tested as polygons of `CHORDS` edges per segment, with exact integers. A touch counts
    as a crossing.

    Args:
        paths: Closed paths, int64 [3m, 2] each, less than 2**17 in magnitude.
        positive: bool [paths], True for paths that should be outer contours, with positive area.

    Returns:
        For each path bool [m], True for segments that cross or touch another part of the boundary
        or fold back onto themselves, and for all segments of a path whose signed area is zero or
        has the wrong sign.
    """
    if not paths:
        return []
    stops = np.cumsum([len(p) // 3 for p in paths])
    head = np.append(0, stops[:-1]) * CHORDS
    points = flatten(np.concatenate([segments(p) for p in paths]))
    a, b = points[:, :-1].reshape(-1, 2), points[:, 1:].reshape(-1, 2)
    after = np.arange(len(a)) + 1
    after[stops * CHORDS - 1] = head
    step, onward = b - a, (b - a)[after]
    bad = (_cross(step, onward) == 0) & ((step * onward).sum(1) <= 0)
    i, j = _near(np.minimum(a, b), np.maximum(a, b))
    apart = (after[i] != j) & (after[j] != i)
    i, j = i[apart], j[apart]
    hit = _astride(a[i], b[i], a[j], b[j]) & _astride(a[j], b[j], a[i], b[i])
    bad[i[hit]] = bad[j[hit]] = True
    twice = np.add.reduceat(_cross(a.astype(np.float64), b.astype(np.float64)), head)
    wrong = np.where(positive, twice, -twice) <= 0
    whole = np.repeat(wrong, np.diff(stops, prepend=0))
    return np.split(bad.reshape(-1, CHORDS).any(1) | whole, stops[:-1])


def _cross(a: NDArray[Any], b: NDArray[Any]) -> Any:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _astride(a: Ints, b: Ints, c: Ints, d: Ints) -> Any:
    """Whether c and d lie on different sides of, or on, the line through a and b."""
    return np.sign(_cross(b - a, c - a)) * np.sign(_cross(b - a, d - a)) <= 0


def _near(low: Ints, high: Ints) -> tuple[Ints, Ints]:
    """Pairs of boxes that meet, found on a grid of about as many cells as boxes.

    Args:
        low: int64 [n, 2] least corners of the boxes.
        high: int64 [n, 2] greatest corners.

    Returns:
        Numbers i and j of the boxes of each pair, with i < j.
    """
    base = low.min(0)
    cell = max(1, int(np.sqrt(np.prod((high.max(0) - base) / np.sqrt(len(low))))))
    c0, c1 = (low - base) // cell, (high - base) // cell
    wide, tall = (c1 - c0 + 1).T
    box, k = spread(wide * tall)
    where = (c0[box, 1] + k // wide[box]) * (c1[:, 0].max() + 1) + c0[box, 0] + k % wide[box]
    order = np.argsort(where, kind="stable")
    where, box = where[order], box[order]
    pairs, left, shift = [np.zeros(0, np.int64)], np.arange(len(box)), 1
    while len(left := left[left + shift < len(box)]):
        left = left[where[left] == where[left + shift]]
        i, j = box[left], box[left + shift]
        meet = ((low[i] <= high[j]) & (low[j] <= high[i])).all(1)
        pairs.append(i[meet] * len(low) + j[meet])
        shift += 1
    return np.divmod(np.unique(np.concatenate(pairs)), len(low))
