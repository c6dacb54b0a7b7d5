"""XPBD constraints on the particles of all layers, solved colour after colour.

A constraint C has a compliance a, the inverse of a stiffness, and the energy C**2 / 2a. In one step
of h seconds it moves its particles of inverse masses w by

    dx_i = -w_i grad_i C * C / (sum_j w_j |grad_j C|**2 + a / h**2)

(Macklin, Müller, Chentanez: XPBD, 2016, equations 17 and 18 with one iteration, whose multiplier
starts at 0; Macklin et al.: Small steps in physics simulation, 2019). Constraints of one colour
share no particle, so each colour is one vector operation. The colours follow one another as in the
method of Gauss and Seidel (Müller et al.: Position based dynamics, 2007, section 3.4).

Positions are float64 [2, P] in pixels: all x, then all y. A particle of inverse mass 0 never moves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Index = NDArray[np.int64]

RESOLVED = 4.0
"""Least ratio of a / h**2 to the sum of w |grad C|**2: one iteration corrects a fifth of C.

Stiffer constraints cannot be resolved in a step, so they are softened; with more steps they become
stiffer. A single iteration over stiffer ones would put less energy into them than C**2 / 2a.
"""

HELD = 0.1
"""Least ratio for attachments; it is smaller because gaps would be visible, and they are few."""

TINY = 1e-30
"""Number that keeps divisors from being 0."""


class Constraint(Protocol):
    """Constraint on particles."""

    def project(self, x: Real) -> None:
        """Moves the particles at `x`, float64 [2, P], by one iteration, in place."""

    def energy(self, x: Real) -> float:
        """Elastic energy at the positions `x`, float64 [2, P]."""


def colours(members: Index) -> Index:
    """Colours constraints greedily, so that no two of one colour share a particle.

    Args:
        members: int64 [C, k] particles of each constraint.

    Returns:
        int64 [C] colours, counted from 0.
    """
    taken = [0] * (int(members.max(initial=-1)) + 1)
    result = np.empty(len(members), np.int64)
    for number, particles in enumerate(members.tolist()):
        used = 0
        for p in particles:
            used |= taken[p]
        free = ~used & (used + 1)  # the lowest bit that is not set
        for p in particles:
            taken[p] |= free
        result[number] = free.bit_length() - 1
    return result


def _by_colour(members: Index, w: Real) -> Iterator[Index]:
    """Yields the numbers of the constraints of each colour that have a particle that can move."""
    live = np.flatnonzero((w[members] > 0).any(1))
    colour = colours(members[live])
    for c in range(int(colour.max(initial=-1)) + 1):
        yield live[colour == c]


def _compliance(stiffness: Real, weight: Real, step: float, least: float = RESOLVED) -> Real:
    """Compliances of constraints, at least `least` * h**2 * weight.

    Args:
        stiffness: float64 [C] inverses of the wanted compliances.
        weight: float64 [C] sums of w |grad C|**2.
        step: h in seconds.
        least: Least ratio, as for `RESOLVED`.

    Returns:
        float64 [C].
    """
    return np.maximum(1 / np.maximum(stiffness, TINY), least * step**2 * weight)


def _places(members: Index, count: int) -> Index:
    """Indices int64 [k, 2, n] of the coordinates of particles [n, k] in flattened positions."""
    return np.ascontiguousarray(np.stack([members.T, members.T + count], axis=1))


def _scratch(sizes: Sequence[int], *shapes: tuple[int, ...]) -> list[list[Real]]:
    """For each n of `sizes`, work arrays of `shapes` + (n,); those of all sizes share memory."""
    pools = [np.empty(math.prod(shape) * max(sizes, default=0)) for shape in shapes]
    return [
        [p[: math.prod(s) * n].reshape(*s, n) for p, s in zip(pools, shapes, strict=True)]
        for n in sizes
    ]


class Distances:
    """Constraints that keep the distance of pairs of particles: C = |x_i - x_j| - d.

    Along edges they resist stretching. Between the far corners of two triangles with a common edge
    they resist bending.

    Args:
        pairs: int64 [C, 2] particles of each pair.
        rest: float64 [C] distances d at rest in pixels.
        stiffness: float64 [C] inverses of the compliances.
        w: float64 [P] inverse masses.
        step: h in seconds.
    """

    def __init__(self, pairs: Index, rest: Real, stiffness: Real, w: Real, step: float) -> None:
        weight = w[pairs].sum(1)
        compliance = _compliance(stiffness, weight, step)
        self.groups = []
        for at in _by_colour(pairs, w):
            ends = w[pairs[at]].T / (weight[at] + compliance[at] / step**2)
            scale = np.stack([-ends[0], ends[1]])[:, None]
            self.groups.append((_places(pairs[at], len(w)), rest[at], scale, 1 / compliance[at]))
        self.scratch = _scratch([len(g[1]) for g in self.groups], (2, 2), (2, 2), (2,), (2,), ())

    def project(self, x: Real) -> None:
        """Moves the particles at `x`, float64 [2, P], by one iteration, in place."""
        flat = x.reshape(-1)
        for (places, rest, scale, _), work in zip(self.groups, self.scratch, strict=True):
            ends, change, apart, square, length = work
            flat.take(places, out=ends, mode="clip")
            np.subtract(ends[0], ends[1], apart)
            np.multiply(apart, apart, square)
            np.add(square[0], square[1], length)
            np.add(length, TINY, length)
            np.sqrt(length, length)
            np.divide(rest, length, length)
            np.subtract(1, length, length)
            np.multiply(apart, length, apart)
            np.multiply(scale, apart, change)
            np.add(ends, change, ends)
            flat[places] = ends

    def energy(self, x: Real) -> float:
        """Elastic energy at the positions `x`, float64 [2, P]."""
        total = 0.0
        for places, rest, _, stiffness in self.groups:
            (ax, ay), (bx, by) = x.reshape(-1)[places]
            total += float((stiffness * (np.hypot(ax - bx, ay - by) - rest) ** 2).sum()) / 2
        return total


class Areas:
    """Constraints that keep the signed area of triangles: C = (b - a) x (c - a) - 2A.

    The gradient at a corner is the opposite edge, turned by 90 degrees.

    Args:
        faces: int64 [C, 3] particles of each triangle.
        rest: float64 [C] twice the signed areas at rest, 2A, in square pixels.
        stiffness: float64 [C] inverses of the compliances.
        w: float64 [P] inverse masses.
        step: h in seconds.
        nodes: float64 [2, P] rest positions.
    """

    def __init__(
        self, faces: Index, rest: Real, stiffness: Real, w: Real, step: float, nodes: Real
    ) -> None:
        corners = nodes[:, faces]  # [2, C, 3]
        opposite = ((np.roll(corners, -1, 2) - np.roll(corners, 1, 2)) ** 2).sum(0)
        compliance = _compliance(stiffness, (w[faces] * opposite).sum(1), step)
        self.groups = []
        for at in _by_colour(faces, w):
            # Differences of the corners a, b, c, a, b are the edges opposite a, b and c.
            places = _places(faces[at][:, [0, 1, 2, 0, 1]], len(w))
            soft = compliance[at] / step**2 + TINY
            weight = np.ascontiguousarray(w[faces[at]].T)
            self.groups.append((places, rest[at], weight, soft, 1 / compliance[at]))
        sizes = [len(g[1]) for g in self.groups]
        self.scratch = _scratch(sizes, (5, 2), (3, 2), (3, 2), (3,), (), ())

    def project(self, x: Real) -> None:
        """Moves the particles at `x`, float64 [2, P], by one iteration, in place."""
        flat = x.reshape(-1)
        for (places, rest, weight, soft, _), work in zip(self.groups, self.scratch, strict=True):
            corners, edges, square, factor, area, sum_ = work
            flat.take(places, out=corners, mode="clip")
            np.subtract(corners[2:], corners[1:4], edges)
            np.multiply(edges[1], edges[2, ::-1], square[0])
            np.subtract(square[0, 0], square[0, 1], area)
            np.subtract(area, rest, area)
            np.multiply(edges, edges, square)
            np.add(square[:, 0], square[:, 1], factor)
            np.multiply(factor, weight, factor)
            np.add.reduce(factor, 0, out=sum_)
            np.add(sum_, soft, sum_)
            np.divide(area, sum_, area)
            np.multiply(weight, area, factor)
            np.multiply(edges, factor[:, None], edges)
            np.add(corners[:3, 0], edges[:, 1], corners[:3, 0])
            np.subtract(corners[:3, 1], edges[:, 0], corners[:3, 1])
            flat[places[:3]] = corners[:3]

    def energy(self, x: Real) -> float:
        """Elastic energy at the positions `x`, float64 [2, P]."""
        total = 0.0
        for places, rest, _, _, stiffness in self.groups:
            (ax, ay), (bx, by), (cx, cy) = x.reshape(-1)[places[:3]]
            error = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) - rest
            total += float((stiffness * error**2).sum()) / 2
        return total


class Attachments:
    """Constraints that keep particles at points of triangles: C = x_p - sum_k b_k x_k, in x and y.

    Args:
        members: int64 [C, 4] the particle p and the three corners of the triangle.
        weights: float64 [C, 3] barycentric weights b.
        stiffness: float64 [C] inverses of the compliances.
        w: float64 [P] inverse masses.
        step: h in seconds.
    """

    def __init__(
        self, members: Index, weights: Real, stiffness: Real, w: Real, step: float
    ) -> None:
        gradient = np.concatenate([np.ones((len(members), 1)), -weights], axis=1)
        weight = (w[members] * gradient**2).sum(1)
        compliance = _compliance(stiffness, weight, step, HELD)
        scale = w[members] * gradient / (weight + compliance / step**2 + TINY)[:, None]
        self.groups = [
            (_places(members[at], len(w)), gradient[at].T, scale[at].T, 1 / compliance[at])
            for at in _by_colour(members, w)
        ]

    def project(self, x: Real) -> None:
        """Moves the particles at `x`, float64 [2, P], by one iteration, in place."""
        flat = x.reshape(-1)
        for places, gradient, scale, _ in self.groups:
            points = flat[places]  # [4, 2, n]
            apart = (points * gradient[:, None]).sum(0)
            flat[places] = points - scale[:, None] * apart

    def energy(self, x: Real) -> float:
        """Elastic energy at the positions `x`, float64 [2, P]."""
        total = 0.0
        for places, gradient, _, stiffness in self.groups:
            apart = (x.reshape(-1)[places] * gradient[:, None]).sum(0)
            total += float((stiffness * (apart**2).sum(0)).sum()) / 2
        return total


class Shape:
    """Constraint that pulls the particles of a body to the best rigid fit of their rest positions.

    Each particle has a goal g in the fit (Müller et al.: Meshless deformations based on shape
    matching, 2005, equations 6 to 8; the rotation is exact in the plane): C = |x - g| with
    compliance w / k**2, where k is 2 pi times a frequency. It conserves momentum, and angular
    momentum too if the fit turns.

    Args:
        part: Particles of the body.
        nodes: float64 [2, P] rest positions.
        w: float64 [P] inverse masses.
        mass: float64 [P] masses that weight the fit, also those of pinned particles.
        frequency: Frequency in Hz with which particles return.
        upright: Whether the fit moves but does not turn.
        step: h in seconds.
    """

    FIXED = 1e3
    """Factor of the weight, in the fit, of particles with inverse mass 0: it turns about them."""

    def __init__(
        self,
        part: slice,
        nodes: Real,
        w: Real,
        mass: Real,
        frequency: float,
        upright: bool,
        step: float,
    ) -> None:
        self.part, self.upright = part, upright
        heavy = np.where(w[part] > 0, mass[part], self.FIXED * mass[part])
        self.share = heavy / heavy.sum()
        self.rest = nodes[:, part] - (nodes[:, part] @ self.share)[:, None]
        self.moment = self.rest * self.share
        self.stiffness = np.where(w[part] > 0, mass[part], 0) * (2 * np.pi * frequency) ** 2
        pull = (2 * np.pi * frequency * step) ** 2
        self.pull = np.where(w[part] > 0, pull / (1 + pull), 0)

    def goal(self, x: Real) -> Real:
        """Goals float64 [2, n] of the particles of the body, in the rigid fit to `x` [2, P]."""
        x = x[:, self.part]
        centre = np.einsum("ci,i->c", x, self.share)[:, None]
        if self.upright:
            return np.asarray(self.rest + centre)
        (xx, xy), (yx, yy) = np.einsum("ci,di->cd", self.moment, x).tolist()
        cosine, sine = xx + yy, xy - yx
        length = np.hypot(cosine, sine) or 1.0
        turn = np.array([[cosine, -sine], [sine, cosine]]) / length
        return np.asarray(turn @ self.rest + centre)

    def project(self, x: Real) -> None:
        """Moves the particles at `x`, float64 [2, P], by one iteration, in place."""
        change = self.goal(x)
        change -= x[:, self.part]
        change *= self.pull
        x[:, self.part] += change

    def energy(self, x: Real) -> float:
        """Elastic energy at the positions `x`, float64 [2, P]."""
        apart = ((x[:, self.part] - self.goal(x)) ** 2).sum(0)
        return float((self.stiffness * apart).sum()) / 2
