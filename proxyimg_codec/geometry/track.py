"""Motion of the nodes of a layer: a few shapes, each with a curve over time, in integers.

A timeline is divided into equal intervals. A curve is a uniform cubic B-spline over them (de Boor
1978, "A Practical Guide to Splines"). So it is smooth, its value at any time depends on four
coefficients, and it closes if the timeline loops. A shape is a displacement of every node. The
motion is the sum of shapes times curves; a few of them describe nearly all of it (Alexa, Mueller
2000, "Representing Animations by Principal Components").
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
"""Base-2 logarithm of the number of phases of an interval."""

MICROSECONDS = 1_000_000

CURVE_BITS = 8
"""Fractional bits of the coefficients of curves."""

CURVE_MAX, SHAPE_MAX = 1 << 15, 1 << 20
"""Bounds of the magnitude of coefficients of curves, and of displacements of shapes."""

_VALUE_BITS = 16
"""Fractional bits of the values of curves."""

_ONE = 1 << PHASE_BITS
SUM = 6 << (3 * PHASE_BITS)
"""Sum of the four weights of a phase."""


@dataclass(frozen=True)
class Timeline:
    """Time frame of the motion of a picture.

    Attributes:
        duration: Duration in milliseconds, 1..3,600,000.
        fps: Frames per second for which the motion was made, 1..240; a hint.
        loop: Whether the motion goes on at its beginning after its end.
        intervals: Number of equal intervals that the timeline is divided into.
        unit: Displacements of shapes are multiples of 2**-unit canvas pixels.
        script: Motion file that the motion was made from, as JSON (`animate.motion`), or "".
    """

    duration: int
    fps: int
    loop: bool
    intervals: int
    unit: int
    script: str = ""

    @property
    def seconds(self) -> float:
        """Duration in seconds."""
        return self.duration / 1000

    @property
    def coefficients(self) -> int:
        """Number of coefficients of a curve; those of a loop are used cyclically."""
        return self.intervals if self.loop else self.intervals + 3

    @property
    def frames(self) -> int:
        """Number of frames at the rate `fps`."""
        return max(round(self.duration * self.fps / 1000), 1)

    def taps(self, seconds: float) -> tuple[Ints, Ints]:
        """Finds the coefficients that decide the value of a curve at a time.

        Args:
            seconds: Time in seconds; it is wrapped if the timeline loops, clamped otherwise.

        Returns:
            Indices int64 [4] of the coefficients, and their weights int64 [4], which add up to
            `SUM`.

        Raises:
            UsageError: The time is not a finite number.
        """
        try:
            good = math.isfinite(seconds) and math.isfinite(seconds * MICROSECONDS)
        except (TypeError, OverflowError):
            good = False
        if not good:
            raise UsageError(f"t = {seconds!r} is not a time in seconds")
        end = self.duration * 1000
        at = round(seconds * MICROSECONDS)
        at = at % end if self.loop else min(max(at, 0), end)
        first, phase = divmod((at * self.intervals << PHASE_BITS) // end, _ONE)
        if first == self.intervals:  # the very end belongs to the last interval
            first, phase = first - 1, _ONE
        index = first + np.arange(4)
        return (index % self.intervals if self.loop else index), weights(phase)


def weights(phase: int) -> Ints:
    """Weights int64 [4] of a uniform cubic B-spline at a phase in 0..2**PHASE_BITS, times `SUM`."""
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
    """Motion of the nodes of one layer over a timeline.

    Attributes:
        curves: int64 [M, K] K coefficients of each of M curves, in 2**-CURVE_BITS.
        shapes: int64 [M, N, 2] displacements of all N nodes in each shape, in the unit of the
            timeline.
        body: Number of the body that the layer moves with; layers of one body move as one.
    """

    curves: Ints
    shapes: Ints
    body: int = 0

    def at(self, timeline: Timeline, seconds: float) -> Ints:
        """Displacements of all nodes at a time, in exact integer arithmetic.

        Args:
            timeline: The timeline of the picture.
            seconds: Time in seconds; it is wrapped if the timeline loops, clamped otherwise.

        Returns:
            int64 [N, 2] in 1/1024 canvas pixel, rounded half up, at most `POINT_MAX` in magnitude.

        Raises:
            UsageError: The time is not a finite number.
        """
        index, weight = timeline.taps(seconds)
        total = self.curves[:, index] @ weight << (_VALUE_BITS - CURVE_BITS)
        values = (total + SUM // 2) // SUM
        moved = np.tensordot(values, self.shapes, 1) << (FRACTION_BITS - timeline.unit)
        rounded = (moved + (1 << (_VALUE_BITS - 1))) >> _VALUE_BITS
        return np.asarray(np.clip(rounded, -POINT_MAX, POINT_MAX))


Coded = tuple[bytes, bytes]
"""Signed integers as `deltas.encode` codes them: classes and raw bits."""


def check_size(budget: Budget, modes: int, coefficients: int, nodes: int = 0) -> None:
    """Spends what decoding tracks costs.

    Args:
        budget: Running budget of the file.
        modes: Number of shapes and curves of each layer.
        coefficients: Coefficients of one curve, summed over the layers that move.
        nodes: Nodes, summed over these layers.

    Raises:
        LimitError: The cost exceeds `budget`.
    """
    budget.spend("wavefronts", coefficients + 2 + nodes + 2 * modes)
    budget.spend("motion", modes * (coefficients + 2 * nodes))


def encode(tracks: list[tuple[Track, Refined]]) -> tuple[Coded, Coded]:
    """Encodes the tracks of all layers that move.

    Args:
        tracks: Track and refined mesh of each layer; all tracks have the same number M of modes.

    Returns:
        The coded curves [M, layers * K], each coefficient less the one before it, and the coded
        shapes [2, M, nodes] as residuals like those of POSE.

    Raises:
        LimitError: The tracks are larger than readers accept by default.
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
    """Decodes the tracks of all layers that move.

    Args:
        curves: The coded curves.
        shapes: The coded shapes.
        modes: Number of shapes and curves of each layer.
        timeline: The timeline of the picture.
        meshes: Refined mesh of each of these layers.
        where: Name of the chunk in error messages.
        budget: Running budget of the file; by default a new one.

    Returns:
        A track for each layer, all of body 0.

    Raises:
        FormatError: A stream is corrupt, or a number is out of range.
        LimitError: The tracks exceed `budget`.
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
