"""From simulated frames to tracks that a file can hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..geometry.track import COEFFICIENT_MAX, SUM, Timeline, Track

Floats = NDArray[np.float64]

UNIT = 3
"""Coefficients are multiples of 2**-UNIT px: an eighth, so that the sum is within a sixteenth."""

TOLERANCE = 0.2
"""What tracks may deviate from the frames, in px: root mean square over nodes, in any frame."""

GROWTH = 1.25
"""Intervals are tried in such steps, from a few to one a frame."""


def bake(
    frames: Sequence[Floats], *, fps: int, loop: bool, script: str = "",
    tolerance: float = TOLERANCE,
) -> tuple[Timeline, list[Track]]:  # fmt: skip
    """Tracks with as few coefficients as are within `tolerance` of the frames.

    Args:
        frames: For each layer float64 [F, N, 2] displacements in canvas pixels, F the same.
        fps: Frames a second; frame k stands at k / fps.
        loop: Whether frame F would be frame 0 again.
        script: What the frames were made from, JSON.
        tolerance: Root mean square over all nodes in px that no frame exceeds, where one interval
            a frame allows that.

    Raises:
        LimitError: Nodes are displaced further than a file can hold.
    """
    wanted = np.concatenate([f.reshape(len(f), -1) for f in frames], axis=1)
    if np.abs(wanted).max(initial=0) * (1 << UNIT) >= COEFFICIENT_MAX // 2:
        raise LimitError("nodes are flung out of reach; use a weaker force or a stiffer material")
    count = len(wanted)
    intervals = min(4, count)
    while True:
        timeline = Timeline(round(1000 * count / fps), fps, loop, intervals, UNIT, script)
        basis = _basis(timeline, count)
        found = np.rint(_solved(basis, wanted) * (1 << UNIT))
        error = basis @ found / (1 << UNIT) - wanted
        worst = np.sqrt(2 * (error**2).mean(1).max(initial=0))
        if worst <= tolerance or intervals == count:
            break
        intervals = min(int(np.ceil(intervals * GROWTH)), count)
    ends = np.cumsum([f.shape[1] * 2 for f in frames])[:-1]
    return timeline, [
        Track(part.reshape(len(found), -1, 2))
        for part in np.split(found.astype(np.int64), ends, axis=1)
    ]


def _basis(timeline: Timeline, count: int) -> Floats:
    """The weight of each coefficient in each frame, [F, K]."""
    out = np.zeros((count, timeline.coefficients))
    for k in range(count):
        index, weight = timeline.taps(k / timeline.fps)
        np.add.at(out[k], index, weight / SUM)
    return out


def _solved(basis: Floats, wanted: Floats) -> Floats:
    """Coefficients [K, M] that come nearest to frames [F, M], least bent where frames are few."""
    bend = np.diff(np.eye(basis.shape[1]), 2, axis=0)
    normal = basis.T @ basis + 1e-6 * bend.T @ bend + 1e-9 * np.eye(basis.shape[1])
    return np.asarray(np.linalg.solve(normal, basis.T @ wanted))
