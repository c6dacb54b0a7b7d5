"""From simulated frames to tracks that a file can hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..geometry.track import CURVE_BITS, SHAPE_MAX, SUM, Timeline, Track

Floats = NDArray[np.float64]

UNIT = 2
"""Shapes are multiples of 2**-UNIT px."""

TOLERANCE = 0.25
"""What tracks may deviate from the frames, in px: root mean square over nodes, in any frame."""

GROWTH = 1.25
"""Intervals are tried in such steps, from a few to one a frame."""

MODES = 24
"""Most shapes of a layer."""


def bake(
    frames: Sequence[Floats], *, fps: int, loop: bool, script: str = "",
    tolerance: float = TOLERANCE,
) -> tuple[Timeline, list[Track]]:  # fmt: skip
    """Tracks with as few coefficients and shapes as are within `tolerance` of the frames.

    Args:
        frames: For each layer float64 [F, N, 2] displacements in canvas pixels, F the same.
        fps: Frames a second; frame k stands at k / fps.
        loop: Whether frame F would be frame 0 again.
        script: What the frames were made from, JSON.
        tolerance: Root mean square over the nodes of a layer in px that no frame exceeds, where
            one interval a frame and `MODES` shapes allow that.

    Raises:
        LimitError: Nodes are displaced further than a file can hold.
    """
    wanted = [f.reshape(len(f), -1) for f in frames]
    if max(np.abs(w).max(initial=0) for w in wanted) * (1 << UNIT) >= SHAPE_MAX // 4:
        raise LimitError("nodes are flung out of reach; use a weaker force or a stiffer material")
    count = len(wanted[0])
    intervals = min(4, count)
    while True:
        timeline = Timeline(round(1000 * count / fps), fps, loop, intervals, UNIT, script)
        basis = _basis(timeline, count)
        found = [_solved(basis, w) for w in wanted]
        # Half of the tolerance is for shapes that are left out.
        near = all(
            _worst(basis @ c, w) <= tolerance / 2 for c, w in zip(found, wanted, strict=True)
        )
        if near or intervals == count:
            break
        intervals = min(int(np.ceil(intervals * GROWTH)), count)
    parts = [_components(coefficients) for coefficients in found]
    modes = 1
    while True:
        pairs = zip(parts, wanted, strict=True)
        tracks = [_track(basis, components, w, modes) for components, w in pairs]
        if modes == MODES or all(
            _worst(_shown(basis, t), w) <= tolerance for t, w in zip(tracks, wanted, strict=True)
        ):
            return timeline, tracks
        modes += 1


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


def _components(coefficients: Floats) -> Floats:
    """Principal components of coefficients [K, 2 N], strongest first: [`MODES`, K]."""
    # Of the K by K products, as there are far more nodes than coefficients.
    power, vectors = np.linalg.eigh(coefficients @ coefficients.T)
    curves = np.zeros((MODES, len(coefficients)))
    strongest = vectors.T[::-1][:MODES]
    curves[: len(strongest)] = strongest
    curves[: len(power)][power[::-1][:MODES] < 1e-9] = 0
    return curves


def _track(basis: Floats, components: Floats, wanted: Floats, modes: int) -> Track:
    """The track whose curves are the first of some components."""
    curves = components[:modes]
    # The sign of a component is arbitrary: the largest coefficient decides, on every machine.
    peak = np.take_along_axis(curves, np.abs(curves).argmax(1)[:, None], 1)
    rounded = np.rint(curves / np.where(peak == 0, 1, peak) * (1 << CURVE_BITS))
    shown = basis @ rounded.T / (1 << CURVE_BITS)
    normal = shown.T @ shown + 1e-6 * np.eye(modes)
    shapes = np.rint(np.linalg.solve(normal, shown.T @ wanted) * (1 << UNIT))
    limit = SHAPE_MAX - 1
    shapes = np.clip(shapes, -limit, limit).astype(np.int64)
    return Track(rounded.astype(np.int64), shapes.reshape(modes, -1, 2))


def _shown(basis: Floats, track: Track) -> Floats:
    """The frames [F, 2 N] of a track."""
    curves = basis @ track.curves.T / (1 << CURVE_BITS)
    return np.asarray(curves @ track.shapes.reshape(len(track.shapes), -1) / (1 << UNIT))


def _worst(shown: Floats, wanted: Floats) -> float:
    """Root mean square deviation over nodes of the worst frame."""
    return float(np.sqrt(2 * ((shown - wanted) ** 2).mean(1).max(initial=0)))
