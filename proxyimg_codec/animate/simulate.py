"""Simulation of a motion, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .body import Body
from .motion import Motion
from .system import System

__all__ = ["Body", "Frames", "simulate"]

Real = NDArray[np.float64]

WARM_UP = 3.0
"""Seconds of simulation before the first frame of a loop."""

OVERLAP = 0.25
"""Share of a loop, from its beginning on, that is faded in from the frames after its end."""


@dataclass(frozen=True, eq=False)
class Frames:
    """Displacements of bodies in each frame.

    Attributes:
        displacements: For each body that moves, by name, float64 [F, N, 2] displacements of its
            nodes from rest in canvas pixels.
        fps: Frames per second.
        loop: Whether frame 0 follows the last one.
    """

    displacements: dict[str, Real]
    fps: int
    loop: bool

    def __len__(self) -> int:
        return len(next(iter(self.displacements.values())))


def simulate(
    bodies: Sequence[Body],
    motion: Motion,
    *,
    canvas: tuple[int, int],
    progress: Callable[[int, int], None] | None = None,
) -> Frames:
    """Simulates a motion.

    A motion that does not loop starts at rest. A loop starts after `WARM_UP` seconds of simulation,
    and what its end and its beginning still differ by is faded over.

    Args:
        bodies: The bodies, with different names. Those that the motion does not name stand still,
            but others can be attached to them or collide with them.
        motion: The motion.
        canvas: Width and height of the canvas in pixels.
        progress: Called after each frame with the number of simulated frames, and the number of all
            frames to simulate.

    Returns:
        The displacements; the same input always gives the same ones.

    Raises:
        UsageError: The motion names a layer that does not exist, a pin, handle, impulse or
            attachment holds no node, or the mesh of a layer that should move has no area.
    """
    frames, before, after = motion.frames, 0, 0
    if motion.loop:
        before = round(WARM_UP * motion.fps)
        after = max(1, round(OVERLAP * frames))
    system = System(bodies, motion, canvas, count=-before * motion.steps)
    total = before + frames + after
    moving = [i for i, layer in enumerate(system.layers) if layer is not None]
    kept = [np.empty((frames + after, len(bodies[i].nodes), 2)) for i in moving]
    for frame in range(total):
        if frame >= before:
            now = system.displacements()
            for array, i in zip(kept, moving, strict=True):
                array[frame - before] = now[i]
        if progress is not None:
            progress(frame + 1, total)
        for _ in range(motion.steps if frame + 1 < total else 0):
            system.step()
    looped = {bodies[i].name: _closed(k, frames) for i, k in zip(moving, kept, strict=True)}
    return Frames(looped, motion.fps, motion.loop)


def _closed(positions: Real, frames: int) -> Real:
    """Closes a loop: fades the last n of positions [frames + n, N, 2] into the first n.

    Returns:
        float64 [frames, N, 2]; a part of `positions`, which is changed.
    """
    n = len(positions) - frames
    if n:
        t = (np.arange(n) / n)[:, None, None]
        fade = t * t * (3 - 2 * t)
        positions[:n] += (1 - fade) * (positions[frames:] - positions[:n])
    return positions[:frames]
