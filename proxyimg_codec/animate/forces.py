"""Forces: coherent wind, impulses, and curves of handles; all may repeat with a loop."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from . import motion_types

Real = NDArray[np.float64]

OCTAVES, WAVES = 3, 4
"""Octaves of the wind, and plane waves in each."""

TREMOR = 77
"""Second part of the seed of the wind, so that other uses of the seed draw other numbers."""


class Wind:
    """Wind with gusts that travel along it, as acceleration of particles at their rest positions.

    Gusts are coherent noise, a sum of plane waves in directions near that of the wind. Waves of
    octave o have a length of about scale / 2**o pixels and a frequency of about frequency * 2**o
    Hz, and are half as strong as those of the octave before. If the motion loops, all frequencies
    are multiples of 1 / period. Each component of a gust has a root mean square of 1.

    Args:
        wind: Wind of the motion.
        nodes: float64 [2, P] rest positions in pixels.
        response: float64 [P] acceleration by a wind of strength 1, in pixels per second squared.
        seed: Seed of the random numbers.
        period: Seconds after which the wind repeats; None if it does not.
    """

    def __init__(
        self, wind: motion_types.Wind, nodes: Real, response: Real, seed: int, period: float | None
    ) -> None:
        random = np.random.default_rng([seed, TREMOR])
        octave = np.repeat(np.arange(OCTAVES), WAVES)
        length, pace, turn, phase, lag = random.random((5, len(octave)))
        heading = math.atan2(wind.direction[1], wind.direction[0])
        angle = heading + 1.2 * (turn - 0.5)
        number = 2**octave * (0.8 + 0.4 * length) / wind.scale
        hertz = wind.frequency * 2**octave * (0.8 + 0.4 * pace)
        if period is not None:
            hertz = np.maximum(np.rint(hertz * period), 1) / period
        self.turn = 2 * np.pi * hertz
        self.lag = 2 * np.pi * lag
        wave = 2 * np.pi * number * np.stack([np.cos(angle), np.sin(angle)])
        place = wave.T @ nodes + 2 * np.pi * phase[:, None]
        power = wind.strength * response
        self.basis = np.concatenate([np.cos(place), np.sin(place), np.ones_like(place[:1])]) * power
        strength = 0.5**octave
        strength *= wind.gust * math.sqrt(2 / (strength**2).sum())
        self.along = strength * math.sqrt(1 - wind.across)
        self.aside = strength * math.sqrt(wind.across)
        self.axes = np.array([[math.cos(heading), -math.sin(heading)],
                              [math.sin(heading), math.cos(heading)]])  # fmt: skip
        self.steady = 1 - wind.gust

    def at(self, time: float) -> Real:
        """Acceleration at a time in seconds, float64 [2, P] in pixels per second squared."""
        swing, late = self.turn * time, self.turn * time + self.lag
        along = [*(self.along * np.cos(swing)), *(self.along * np.sin(swing)), self.steady]
        aside = [*(self.aside * np.cos(late)), *(self.aside * np.sin(late)), 0.0]
        return np.asarray(self.axes @ np.array([along, aside]) @ self.basis)


def falloff(nodes: Real, at: tuple[float, float] | None, radius: float | None) -> Real:
    """Share of an impulse that each node takes: 1 at the centre, 0 from the radius on.

    Args:
        nodes: float64 [N, 2] rest positions.
        at: Centre of the impulse; None for the same impulse everywhere.
        radius: Radius of the impulse; None for the same impulse everywhere.

    Returns:
        float64 [N] in 0..1.
    """
    if at is None or radius is None:
        return np.ones(len(nodes))
    square = ((nodes - at) ** 2).sum(1) / radius**2
    return np.asarray(np.maximum(1 - square, 0) ** 2)


class Curve:
    """Curve of a handle: its offset, scale and angle over time.

    Args:
        handle: Handle of the motion.
        period: Seconds after which the curve repeats; None if it does not.
    """

    def __init__(self, handle: motion_types.Handle, period: float | None) -> None:
        self.times = [k.time for k in handle.keys]
        self.values = np.array([(*k.offset, k.scale, k.turn) for k in handle.keys])
        self.smooth = handle.ease == "smooth"
        self.period = period
        if period is not None:
            self.times.append(self.times[0] + period)
            self.values = np.concatenate([self.values, self.values[:1]])

    def at(self, time: float) -> tuple[Real, Real]:
        """Offset float64 [2] in pixels, and matrix float64 [2, 2], at a time in seconds."""
        if self.period is not None:
            time = self.times[0] + (time - self.times[0]) % self.period
        after = int(np.searchsorted(self.times, time, side="right"))
        if after in (0, len(self.times)):
            value = self.values[min(after, len(self.times) - 1)]
        else:
            start, end = self.times[after - 1 : after + 1]
            t = (time - start) / (end - start)
            t = t * t * (3 - 2 * t) if self.smooth else t
            value = self.values[after - 1] + t * (self.values[after] - self.values[after - 1])
        scale, turn = float(value[2]), math.radians(value[3])
        c, s = scale * math.cos(turn), scale * math.sin(turn)
        return value[:2], np.array([[c, -s], [s, c]])
