"""How the nodes of a layer move: cubic B-splines over time, in whole numbers.

A timeline is cut into equal intervals. The displacement of a node is a uniform cubic B-spline of
them, so that it is smooth, can be found at any time from four coefficients, and closes where the
timeline loops (de Boor 1978, "A Practical Guide to Splines").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, UsageError
from . import deltas
from .mesh import FRACTION_BITS, Refined
from .pose import residuals, restored

Ints = NDArray[np.int64]

PHASE_BITS = 10
"""An interval has 2**PHASE_BITS phases."""

MICROSECONDS = 1_000_000

COEFFICIENT_MAX = 1 << 20
"""Coefficients are below this; with a unit of 1/8 px that is 131,072 px."""

_ONE = 1 << PHASE_BITS
SUM = 6 << (3 * PHASE_BITS)
"""What the four weights of a phase add up to."""


@dataclass(frozen=True)
class Timeline:
    """When the layers of a picture move.

    Attributes:
        duration: Milliseconds, 1..600,000.
        fps: Frames a second that it was made for, 1..240.
        loop: Whether its end is its beginning.
        intervals: Number of equal intervals that it is cut into.
        unit: Coefficients are multiples of 2**-unit canvas pixels.
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
        """Coefficients of a node: those of a loop go round."""
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
        if not math.isfinite(seconds):
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
    """Displacements of all nodes of a layer over a timeline.

    Attributes:
        coefficients: int64 [K, N, 2] in units of the timeline.
    """

    coefficients: Ints

    def at(self, timeline: Timeline, seconds: float) -> Ints:
        """Displacements int64 [N, 2] in 1/1024 canvas pixel at a time; exact, half up.

        Raises:
            UsageError: The time is not a number.
        """
        index, weight = timeline.taps(seconds)
        total = (weight[:, None, None] * self.coefficients[index]).sum(0)
        scaled: Ints = ((total << (FRACTION_BITS - timeline.unit)) + SUM // 2) // SUM
        return scaled


def encode(tracks: list[tuple[Track, Refined]]) -> tuple[bytes, bytes]:
    """Classes and deltas of the coefficients of several layers: signed integers [2, K, nodes].

    Nodes are predicted from others at the same coefficient, as in POSE.
    """
    parts = []
    for track, refined in tracks:
        count, nodes, _ = track.coefficients.shape
        flat = track.coefficients.transpose(1, 0, 2).reshape(nodes, 2 * count)
        parts.append(residuals(flat, refined).reshape(nodes, count, 2).transpose(2, 1, 0))
    return deltas.encode(np.concatenate(parts, axis=2))


def decode(
    classes: bytes, raw: bytes, timeline: Timeline, meshes: list[Refined], where: str
) -> list[Track]:
    """Inverse of `encode`.

    Raises:
        FormatError: Corrupt streams, or a coefficient that is out of range.
    """
    count, nodes = timeline.coefficients, [len(m.nodes) for m in meshes]
    whole = deltas.decode(classes, raw, 2, sum(nodes), where, count).reshape(2, count, -1)
    tracks = []
    for part, refined in zip(np.split(whole, np.cumsum(nodes)[:-1], axis=2), meshes, strict=True):
        flat = part.transpose(2, 1, 0).reshape(len(refined.nodes), 2 * count)
        values = restored(flat, refined)
        if np.abs(values).max() >= COEFFICIENT_MAX:
            raise FormatError("a coefficient is out of range", where)
        tracks.append(Track(values.reshape(-1, count, 2).transpose(1, 0, 2)))
    return tracks
