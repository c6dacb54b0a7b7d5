"""How the nodes of a layer move: a few shapes, each with a curve over time, in whole numbers.

A timeline is cut into equal intervals. A curve is a uniform cubic B-spline of them, so that it is
smooth, can be found at any time from four coefficients, and closes where the timeline loops
(de Boor 1978, "A Practical Guide to Splines"). A shape displaces every node; what nodes do is the
sum of shapes times curves, as few of each say nearly all (Alexa, Mueller 2000, "Representing
Animations by Principal Components").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, UsageError
from ..limits import Budget
from . import deltas
from .mesh import FRACTION_BITS, Refined
from .pose import POINT_MAX, residuals, restored

Ints = NDArray[np.int64]

PHASE_BITS = 10
"""An interval has 2**PHASE_BITS phases."""

MICROSECONDS = 1_000_000

CURVE_BITS = 8
"""Coefficients of curves are in 2**-CURVE_BITS."""

CURVE_MAX, SHAPE_MAX = 1 << 15, 1 << 20
"""Coefficients of curves, and displacements of shapes, are below these."""

MODES_MAX = 64

_VALUE_BITS = 16
"""Values of curves are in 2**-_VALUE_BITS."""

_ONE = 1 << PHASE_BITS
SUM = 6 << (3 * PHASE_BITS)
"""What the four weights of a phase add up to."""


@dataclass(frozen=True)
class Timeline:
    """When the layers of a picture move.

    Attributes:
        duration: Milliseconds, 1..3,600,000.
        fps: Frames a second that it was made for, 1..240.
        loop: Whether its end is its beginning.
        intervals: Number of equal intervals that it is cut into.
        unit: Shapes are multiples of 2**-unit canvas pixels.
        script: What it was made from, as JSON (`animate.motion`), or "".
    """

    duration: int
    fps: int
    loop: bool
    intervals: int
    unit: int
    script: str = ""

    @property
    def seconds(self) -> float:
        """The duration in seconds."""
        return self.duration / 1000

    @property
    def coefficients(self) -> int:
        """Coefficients of a curve: those of a loop go round."""
        return self.intervals if self.loop else self.intervals + 3

    @property
    def frames(self) -> int:
        """Frames at the rate that it was made for."""
        return max(round(self.duration * self.fps / 1000), 1)

    def taps(self, seconds: float) -> tuple[Ints, Ints]:
        """Coefficients [4] that count at a time, and their weights [4], which add up to `SUM`.

        Raises:
            UsageError: The time is not a number.
        """
        if not math.isfinite(seconds * MICROSECONDS):
            raise UsageError(f"t = {seconds} is not a time in seconds")
        end = self.duration * 1000
        at = round(seconds * MICROSECONDS)
        at = at % end if self.loop else min(max(at, 0), end)
        first, phase = divmod((at * self.intervals << PHASE_BITS) // end, _ONE)
        if first == self.intervals:  # the very end belongs to the last interval
            first, phase = first - 1, _ONE
        index = first + np.arange(4)
        return (index % self.intervals if self.loop else index), weights(phase)


def weights(phase: int) -> Ints:
    """The uniform cubic B-spline's weights [4] at a phase of 0..2**PHASE_BITS, times `SUM`."""
    f, g = phase, _ONE - phase
    one = _ONE**3
    return np.array(
        [
            g**3,
            3 * f**3 - 6 * f * f * _ONE + 4 * one,
            3 * g**3 - 6 * g * g * _ONE + 4 * one,
            f**3,
        ],
        np.int64,
    )


@dataclass(frozen=True, eq=False)
class Track:
    """How the nodes of a layer move over a timeline.

    Attributes:
        curves: int64 [M, K] coefficients of M curves, in 2**-CURVE_BITS.
        shapes: int64 [M, N, 2] displacements of all nodes in units of the timeline.
        body: Number of the body that the layer moves with; layers of one body move as one.
    """

    curves: Ints
    shapes: Ints
    body: int = 0

    def at(self, timeline: Timeline, seconds: float) -> Ints:
        """Displacements int64 [N, 2] in 1/1024 canvas pixel at a time; exact, half up, clamped.

        Raises:
            UsageError: The time is not a number.
        """
        index, weight = timeline.taps(seconds)
        total = self.curves[:, index] @ weight << (_VALUE_BITS - CURVE_BITS)
        values = (total + SUM // 2) // SUM
        moved = np.tensordot(values, self.shapes, 1) << (FRACTION_BITS - timeline.unit)
        rounded = (moved + (1 << (_VALUE_BITS - 1))) >> _VALUE_BITS
        return np.asarray(np.clip(rounded, -POINT_MAX, POINT_MAX))


Coded = tuple[bytes, bytes]
"""Classes and deltas of an array of signed integers."""


def check_size(budget: Budget, modes: int, coefficients: int, nodes: int = 0) -> None:
    """Checks what tracks cost: all coefficients of a mode, and all nodes of the layers that move.

    Raises:
        LimitError: That exceeds `budget`.
    """
    budget.spend("wavefronts", coefficients + 2 + nodes + 2 * modes)
    budget.spend("motion", modes * (coefficients + 2 * nodes))


def encode(tracks: list[tuple[Track, Refined]]) -> tuple[Coded, Coded]:
    """Curves [M, layers * K] less the coefficient before; shapes [2, M, nodes] as in POSE.

    Raises:
        LimitError: They are more than readers accept by default.
    """
    coefficients = sum(track.curves.shape[1] for track, _ in tracks)
    nodes = sum(len(refined.nodes) for _, refined in tracks)
    check_size(Budget(), len(tracks[0][0].curves), coefficients, nodes)
    curves, shapes = [], []
    for track, refined in tracks:
        curves.append(np.diff(track.curves, axis=1, prepend=0))
        modes, nodes, _ = track.shapes.shape
        flat = track.shapes.transpose(1, 0, 2).reshape(nodes, 2 * modes)
        shapes.append(residuals(flat, refined).reshape(nodes, modes, 2).transpose(2, 1, 0))
    return deltas.encode(np.concatenate(curves, 1)), deltas.encode(np.concatenate(shapes, 2))


def decode(
    curves: Coded, shapes: Coded, modes: int, timeline: Timeline, meshes: list[Refined], where: str,
    budget: Budget | None = None,
) -> list[Track]:  # fmt: skip
    """Inverse of `encode`.

    Raises:
        FormatError: Corrupt streams, or a number that is out of range.
        LimitError: They exceed `budget`.
    """
    coefficients = len(meshes) * timeline.coefficients
    nodes = [len(m.nodes) for m in meshes]
    check_size(budget or Budget(), modes, coefficients, sum(nodes))
    steps = deltas.decode(*curves, modes, coefficients, where)
    whole = deltas.decode(*shapes, 2, sum(nodes), where, modes).reshape(2, modes, -1)
    tracks = []
    for curve, part, refined in zip(
        np.split(steps, len(meshes), axis=1),
        np.split(whole, np.cumsum(nodes)[:-1], axis=2),
        meshes,
        strict=True,
    ):
        flat = part.transpose(2, 1, 0).reshape(len(refined.nodes), 2 * modes)
        shape = restored(flat, refined).reshape(-1, modes, 2).transpose(1, 0, 2)
        curve = np.cumsum(curve, axis=1)
        if np.abs(curve).max() >= CURVE_MAX or np.abs(shape).max() >= SHAPE_MAX:
            raise FormatError("a curve or shape is out of range", where, rule="MOT-5")
        tracks.append(Track(curve, shape))
    return tracks
