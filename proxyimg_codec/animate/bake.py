"""Baking of simulated frames to tracks, as a file holds them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..geometry.track import CURVE_BITS, SHAPE_MAX, SUM, Timeline, Track

Floats = NDArray[np.float64]

UNIT = 2
"""Unit of shapes: displacements are multiples of 2**-UNIT canvas pixel."""

TOLERANCE = 0.25
"""Largest deviation of a frame, in canvas pixels: root mean square over the nodes of a layer."""

GROWTH = 1.25
"""Factor by which the number of intervals grows from one attempt to the next."""

MODES = 24
"""Most shapes of a layer that are used."""


def bake(
    frames: Sequence[Floats], *, fps: int, loop: bool, script: str = "",
    tolerance: float = TOLERANCE,
) -> tuple[Timeline, list[Track]]:  # fmt: skip
    """Finds tracks with few coefficients and shapes that are within a tolerance of frames.

    Args:
        frames: For each layer float64 [F, N, 2] displacements in canvas pixels; F is the same for
            all.
        fps: Frames per second; frame k is at k / fps seconds.
        loop: Whether frame 0 follows the last one.
        script: Motion that the frames were made from, as JSON.
        tolerance: Largest deviation of a frame in canvas pixels, as root mean square over the nodes
            of a layer. It may be exceeded if one interval per frame and `MODES` shapes do not
            suffice.

    Returns:
        The timeline, and the track of each layer.

    Raises:
        LimitError: Nodes are displaced farther than a file can hold.
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
    """Weight of each coefficient in each of `count` frames, float64 [F, K]."""
    out = np.zeros((count, timeline.coefficients))
    for k in range(count):
        index, weight = timeline.taps(k / timeline.fps)
        np.add.at(out[k], index, weight / SUM)
    return out


def _solved(basis: Floats, wanted: Floats) -> Floats:
    """Coefficients float64 [K, M] with the least squared error, and slightly smoothed.

    Args:
        basis: float64 [F, K] weights of coefficients.
        wanted: float64 [F, M] coordinates of frames.
    """
    bend = np.diff(np.eye(basis.shape[1]), 2, axis=0)
    normal = basis.T @ basis + 1e-6 * bend.T @ bend + 1e-9 * np.eye(basis.shape[1])
    return np.asarray(np.linalg.solve(normal, basis.T @ wanted))


def _components(coefficients: Floats) -> Floats:
    """Principal components float64 [MODES, K] of coefficients [K, 2 N], strongest first."""
    # From the K x K matrix of products, as there are far more nodes than coefficients.
    power, vectors = np.linalg.eigh(coefficients @ coefficients.T)
    curves = np.zeros((MODES, len(coefficients)))
    strongest = vectors.T[::-1][:MODES]
    curves[: len(strongest)] = strongest
    curves[: len(power)][power[::-1][:MODES] < 1e-9] = 0
    return curves


def _track(basis: Floats, components: Floats, wanted: Floats, modes: int) -> Track:
    """Makes the track whose curves are the first `modes` components [MODES, K].

    Args:
        basis: float64 [F, K] weights of coefficients.
        components: float64 [MODES, K] principal components.
        wanted: float64 [F, 2 N] coordinates of frames, which decide the shapes.
        modes: Number of curves and shapes.
    """
    curves = components[:modes]
    # The sign of a component is arbitrary. Dividing by its largest coefficient makes it the same on
    # every machine.
    peak = np.take_along_axis(curves, np.abs(curves).argmax(1)[:, None], 1)
    rounded = np.rint(curves / np.where(peak == 0, 1, peak) * (1 << CURVE_BITS))
    shown = basis @ rounded.T / (1 << CURVE_BITS)
    normal = shown.T @ shown + 1e-6 * np.eye(modes)
    shapes = np.rint(np.linalg.solve(normal, shown.T @ wanted) * (1 << UNIT))
    limit = SHAPE_MAX - 1
    shapes = np.clip(shapes, -limit, limit).astype(np.int64)
    return Track(rounded.astype(np.int64), shapes.reshape(modes, -1, 2))


def _shown(basis: Floats, track: Track) -> Floats:
    """Frames float64 [F, 2 N] of a track."""
    curves = basis @ track.curves.T / (1 << CURVE_BITS)
    return np.asarray(curves @ track.shapes.reshape(len(track.shapes), -1) / (1 << UNIT))


def _worst(shown: Floats, wanted: Floats) -> float:
    """Largest deviation of a frame: root mean square over the nodes, in canvas pixels."""
    return float(np.sqrt(2 * ((shown - wanted) ** 2).mean(1).max(initial=0)))
