"""Moves layers through the frames of a motion."""

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
"""Seconds that a loop has gone on for before its first frame."""

OVERLAP = 0.25
"""Share of a loop in which its end fades into its beginning."""


@dataclass(frozen=True, eq=False)
class Frames:
    """Where layers are in each frame.

    Attributes:
        displacements: By name of the layer, for those that move: float64 [F, N, 2], how far each
            node is from its place at rest, in pixels.
        fps: Frames a second.
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

    A motion that does not loop starts at rest. One that loops has already gone on for a while;
    what its end and its beginning still differ by is faded over.

    Args:
        bodies: The layers, with different names; those that the motion does not name stand still,
            but others can be attached to them or collide with them.
        motion: What moves.
        canvas: Width and height in pixels.
        progress: Is called with the number of simulated frames and of all frames to simulate,
            after each.

    Returns:
        The displacements; the same input gives the same ones.

    Raises:
        UsageError: The motion names a layer that is not there, a pin, handle, impulse or
            attachment catches no node, or a mesh that should move has no area.
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
    """The first `frames` of positions [frames + n, N, 2]: the last n fade into the first."""
    n = len(positions) - frames
    if n:
        t = (np.arange(n) / n)[:, None, None]
        fade = t * t * (3 - 2 * t)
        positions[:n] += (1 - fade) * (positions[frames:] - positions[:n])
    return positions[:frames]
