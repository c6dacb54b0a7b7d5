"""System of particles of all bodies, and a step of its simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from . import collide, elastic, forces
from .body import Body
from .constraints import Areas, Attachments, Constraint, Distances, Shape
from .motion import Motion
from .motion_types import LayerMotion

Real = NDArray[np.float64]
Index = NDArray[np.int64]

ATTACHED = 20.0
"""Frequency in Hz with which an attached particle returns to its place."""

SQUASH = 0.2
"""Largest displacement of particles below their rest positions above a floor, as a share of their
height above it."""


class System:
    """Particles of all bodies; bodies that the motion does not name stand still.

    Args:
        bodies: The bodies.
        motion: The motion.
        canvas: Width and height of the canvas in pixels.
        measured: Whether to compute `work`, which takes time.
        count: Number of the first step; in a loop it may be negative.

    Attributes:
        layers: Motion of each body, or None.
        parts: Particles of each body.
        rest: float64 [2, P] rest positions in pixels.
        x: float64 [2, P] positions in pixels.
        v: float64 [2, P] velocities in pixels per second.
        w: float64 [P] inverse masses; 0 for particles that are pinned, led by handles, or still.
        count: Number of the next step.
        work: Work done by wind, impulses, drag and handles so far; see `energy`.

    Raises:
        UsageError: The motion names a layer that does not exist, a part of it holds no node, or the
            mesh of a layer that should move has no area.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        motion: Motion,
        canvas: tuple[int, int],
        measured: bool = False,
        count: int = 0,
    ) -> None:
        self.bodies, self.motion, self.measured = bodies, motion, measured
        self.step_seconds = 1 / (motion.fps * motion.steps)
        self.layers = _chosen(bodies, motion)
        ends = np.cumsum([0, *(len(b.nodes) for b in bodies)]).tolist()
        self.parts = [slice(a, b) for a, b in pairwise(ends)]
        self.rest = np.ascontiguousarray(np.concatenate([b.nodes for b in bodies]).T, float)
        self.mass, self.w = np.ones(ends[-1]), np.zeros(ends[-1])
        self.curves: list[tuple[forces.Curve, Real, Index]] = []
        for body, layer, part in self._moving():
            self._add(body, layer, part)
        self.constraints = self._constraints()
        self._prepare_forces()
        self._prepare_collisions(canvas)
        self.x, self.v = self.rest.copy(), np.zeros_like(self.rest)
        self.before = np.empty_like(self.rest)
        self.count, self.work = count, 0.0
        self._lead(count * self.step_seconds)

    def _moving(self) -> Iterator[tuple[Body, LayerMotion, slice]]:
        for body, layer, part in zip(self.bodies, self.layers, self.parts, strict=True):
            if layer is not None:
                yield body, layer, part

    def _add(self, body: Body, layer: LayerMotion, part: slice) -> None:
        """Adds the masses, pins and handles of a body."""
        if not len(body.faces) or not np.abs(body.areas).sum() > 0:
            raise UsageError(f"layer {body.name!r}: its mesh has no area, so it cannot move")
        self.mass[part] = elastic.masses(body, layer)
        fixed = body.loose.copy()
        for i, spot in enumerate(layer.pins):
            fixed |= body.caught(spot, f"layers.{body.name}.pins[{i}]")
        for i, handle in enumerate(layer.handles):
            caught = body.within(handle.at, handle.radius, f"layers.{body.name}.handles[{i}]")
            at = np.flatnonzero(caught & ~fixed)
            fixed[at] = True
            curve = forces.Curve(handle, self.period)
            self.curves.append((curve, np.array(handle.at, float)[:, None], at + part.start))
        self.w[part] = np.where(fixed, 0, 1 / self.mass[part])

    @property
    def period(self) -> float | None:
        """Seconds after which the forces repeat; None if they do not."""
        return self.motion.period if self.motion.loop else None

    def _constraints(self) -> list[Constraint]:
        h, w = self.step_seconds, self.w
        springs, triangles, shapes = [], [], []
        for body, layer, part in self._moving():
            pairs, *more = elastic.springs(body, layer)
            springs.append((pairs + part.start, *more))
            faces, *more = elastic.triangles(body, layer)
            triangles.append((faces + part.start, *more))
            if (hertz := layer.material.shape) > 0:
                shapes.append(Shape(part, self.rest, w, self.mass, hertz, layer.upright, h))
        pairs, length, firm = (np.concatenate(v) for v in zip(*springs, strict=True))
        faces, area, firmer = (np.concatenate(v) for v in zip(*triangles, strict=True))
        distances = Distances(pairs, length, firm, w, h)
        areas = Areas(faces, area, firmer, w, h, self.rest)
        return [*shapes, *self._attachments(), distances, areas]

    def _attachments(self) -> list[Constraint]:
        names = [b.name for b in self.bodies]
        made: list[Constraint] = []
        for i, attachment in enumerate(self.motion.attachments):
            for name in attachment.layers:
                _known(name, self.bodies, f"attachments[{i}].layers")
            first, second = (names.index(n) for n in attachment.layers)
            body, onto = self.bodies[first], self.bodies[second]
            at = np.flatnonzero(
                body.within(attachment.at, attachment.radius, f"attachments[{i}]") & ~body.loose
            )
            corners, weights = onto.holding(body.nodes[at])
            at += self.parts[first].start
            members = np.concatenate([at[:, None], corners + self.parts[second].start], axis=1)
            stiffness = self.mass[at] * (2 * np.pi * ATTACHED) ** 2
            made.append(Attachments(members, weights, stiffness, self.w, self.step_seconds))
        return made

    def _prepare_forces(self) -> None:
        """Computes wind, drag and impulses of all particles."""
        motion, h = self.motion, self.step_seconds
        response, drag = np.zeros(len(self.w)), np.full(len(self.w), float(motion.drag))
        self.impulses: dict[int, list[Real]] = {}
        for body, layer, part in self._moving():
            response[part] = layer.material.wind * body.diagonal * _exposure(body, layer)
            drag[part] += layer.material.drag
            for i, impulse in enumerate(layer.impulses):
                take = np.zeros(len(self.w))
                take[part] = forces.falloff(body.nodes, impulse.at, impulse.radius)
                take[self.w == 0] = 0
                if not take.any():
                    raise UsageError(
                        f"layers.{body.name}.impulses[{i}]: no node of the layer that is free to "
                        "move lies within its radius"
                    )
                kick = np.array(impulse.velocity, float)[:, None] * take
                self.impulses.setdefault(int(impulse.time / h + 1e-6), []).append(kick)
        response[self.w == 0] = 0
        self.slowing = np.exp(-drag * h)
        self.fall = np.array(motion.gravity, float)[:, None] * (self.w > 0)
        self.wind = None
        if motion.wind is not None:
            self.wind = forces.Wind(motion.wind, self.rest, response, motion.seed, self.period)

    def _prepare_collisions(self, canvas: tuple[int, int]) -> None:
        low, high = np.full_like(self.rest, -np.inf), np.full_like(self.rest, np.inf)
        if self.motion.collide.canvas:
            # Particles that lie beyond the canvas at rest may stay there.
            low = np.minimum(self.rest, 0)
            high = np.maximum(self.rest, np.array(canvas, float)[:, None])
        for _, layer, part in self._moving():
            if layer.floor:
                y = self.rest[1, part]
                high[1, part] = np.minimum(high[1, part], y + SQUASH * (y.max() - y))
        bounded = np.isfinite(low).any() or np.isfinite(high).any()
        self.walls = collide.Walls(low, high) if bounded else None
        self.crowd = None
        if self.motion.collide.layers and len(self.bodies) > 1:
            outlines = [
                collide.Outline(part, body.rim + part.start, self.rest)
                for body, part in zip(self.bodies, self.parts, strict=True)
                if len(body.faces)
            ]
            self.crowd = collide.Layers(outlines, self.w)

    def _lead(self, time: float) -> None:
        """Moves the particles that handles lead to their positions at a time in seconds."""
        for curve, centre, at in self.curves:
            offset, matrix = curve.at(time)
            self.x[:, at] = centre + matrix @ (self.rest[:, at] - centre) + offset[:, None]

    def step(self) -> None:
        """Simulates one step, of 1 / (`Motion.fps` * `Motion.steps`) seconds."""
        h, cycle = self.step_seconds, self.motion.frames * self.motion.steps
        now = self.count % cycle if self.motion.loop else self.count
        if self.curves:
            stored = self.elastic_energy() if self.measured else 0.0
            self._lead((now + 1) * h)
            self.work += self.elastic_energy() - stored if self.measured else 0.0
        kinetic = self.kinetic_energy() if self.measured else 0.0
        x, v, before = self.x, self.v, self.before
        v *= self.slowing
        if self.wind is not None:
            v += self.wind.at(now * h) * h
        for kick in self.impulses.get(now, ()):
            v += kick
        self.work += self.kinetic_energy() - kinetic if self.measured else 0.0
        v += self.fall * h
        before[...] = x
        x += v * h
        for constraint in self.constraints:
            constraint.project(x)
        if self.crowd is not None:
            self.crowd.project(x)
        if self.walls is not None:
            self.walls.project(x, before)
        np.subtract(x, before, v)
        v /= h
        self.count += 1

    def kinetic_energy(self) -> float:
        """Kinetic energy of all particles."""
        return float((self.mass * (self.v**2).sum(0)).sum()) / 2

    def elastic_energy(self) -> float:
        """Elastic energy of all constraints."""
        return sum(c.energy(self.x) for c in self.constraints)

    def energy(self) -> float:
        """Sum of kinetic, elastic, and gravitational energy; the latter is 0 at rest.

        Over 10,000 steps of each preset it never exceeded its first value plus `work`: apart from
        that, a step only takes energy away.
        """
        fallen = float((self.mass * self.fall * (self.x - self.rest)).sum())
        return self.kinetic_energy() + self.elastic_energy() - fallen

    def displacements(self) -> list[Real]:
        """Displacements of the nodes of each body from rest, float64 [N, 2] in pixels.

        Nodes without a triangle follow the nearest node that has one.
        """
        away = (self.x - self.rest).T
        result = []
        for body, part in zip(self.bodies, self.parts, strict=True):
            moved = away[part].copy()
            moved[body.loose] = moved[body.nearest]
            result.append(moved)
        return result


def _known(name: str, bodies: Sequence[Body], path: str) -> None:
    if name not in (b.name for b in bodies):
        known = ", ".join(repr(b.name) for b in bodies) or "none"
        raise UsageError(f"{path}: there is no layer {name!r}; there are: {known}")


def _chosen(bodies: Sequence[Body], motion: Motion) -> list[LayerMotion | None]:
    """Motion of each body, or None; raises `UsageError` if the motion names another body."""
    if not bodies:
        raise UsageError("there is no layer to move")
    for name in motion.layers:
        if name != "*":
            _known(name, bodies, f"layers.{name}")
    rest = motion.layers.get("*")
    return [motion.layers.get(b.name, rest) for b in bodies]


def _exposure(body: Body, layer: LayerMotion) -> Real:
    """Share of the wind that reaches each node, float64 [N]: 0 at pins, 1 farthest from them.

    So a layer bends over its whole length, whatever is pinned, instead of folding beside its pins.
    """
    pins = [body.caught(spot, "") for spot in layer.pins]
    if not pins:
        return np.ones(len(body.nodes))
    away = body.distance(np.logical_or.reduce(pins))
    return np.asarray(away / (away.max() or 1.0))
