"""Gives a picture a motion: meshes, simulation, tracks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..edit.geometry import meshed
from ..errors import UsageError
from ..geometry.mesh import FRACTION_BITS
from ..image import Image, Layer, Layers
from .bake import bake
from .body import Body
from .motion import Motion
from .presets import Box
from .simulate import simulate

EDGE = 0.035
"""Edges of meshes that are made for motion, relative to the diagonal of a layer."""


def movable(image: Image) -> list[Layer]:
    """The layers that can move: all that are drawn but the back layer of an opaque picture."""
    return [v for i, v in enumerate(image.layers) if not v.pose.hidden and (i or not image.opaque)]


def boxes(image: Image, names: Sequence[str | int] | None = None) -> dict[str, Box]:
    """x0, y0, x1, y1 in canvas pixels, at rest, of layers by name.

    Args:
        image: The picture.
        names: Names or positions of the layers; None for all that can move.

    Raises:
        UsageError: There is no such layer, it cannot move, or no layer can.
    """
    able = movable(image)
    chosen = able if names is None else [image.layers[k] for k in names]
    for layer in chosen:
        if layer not in able:
            why = "hidden" if layer.pose.hidden else "the back of an opaque picture"
            raise UsageError(f"layer {layer.name!r} cannot move: it is {why}")
    if not chosen:
        raise UsageError(
            "the picture has no layer that can move; encode it with masks or more layers"
        )
    return {v.name: _box(v, image) for v in chosen}


def _box(layer: Layer, image: Image) -> Box:
    if layer.boundary is None:
        return (0.0, 0.0, float(image.width), float(image.height))
    left, top, right, bottom = layer.boundary.bounds()
    return (float(left), float(top), float(right), float(bottom))


def animate(
    image: Image, motion: Motion, progress: Callable[[int, int], None] | None = None
) -> Image:
    """The picture with a motion instead of the one it may have.

    Args:
        image: The picture.
        motion: What moves, and how.
        progress: Called with the number of simulated frames and of all frames to simulate.

    Raises:
        UsageError: The motion does not fit the picture.
        LimitError: Nodes are flung out of reach.
    """
    still = [v.name for v in image.layers if v not in movable(image)]
    for name in motion.layers:
        if name in still:
            boxes(image, [name])
    layers = [v if v.name in still else meshed(v, EDGE) for v in image.layers]
    bodies = [
        Body(v.name, v.mesh.refined.nodes / (1 << FRACTION_BITS), v.mesh.refined.faces)
        for v in layers
        if v.name not in still and v.mesh is not None
    ]
    if not bodies:
        boxes(image)
    found = simulate(bodies, motion, canvas=(image.width, image.height), progress=progress)
    names = list(found.displacements)
    timeline, tracks = bake(
        list(found.displacements.values()), fps=found.fps, loop=found.loop, script=motion.to_json()
    )
    track = dict(zip(names, tracks, strict=True))
    moved = [
        replace(v, track=track[v.name]) if v.name in track else replace(old, track=None)
        for v, old in zip(layers, image.layers, strict=True)
    ]
    return replace(image, layers=Layers(moved), timeline=timeline)


def amplitude(image: Image, frames: int = 24) -> float:
    """Mean displacement of the nodes that move, over the timeline, in canvas pixels."""
    if image.timeline is None:
        return 0.0
    total, count = 0.0, 0
    for layer in image.layers:
        if layer.track is None:
            continue
        for k in range(frames):
            at = layer.track.at(image.timeline, image.timeline.seconds * k / frames)
            total += float(np.hypot(*at.T).sum()) / (1 << FRACTION_BITS)
            count += len(at)
    return total / max(count, 1)
