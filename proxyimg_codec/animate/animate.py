"""Animation of a picture: makes meshes, simulates a motion, and bakes it to tracks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import UsageError
from ..geometry import mesher
from ..geometry.mesh import FRACTION_BITS
from ..model import Layer, Layers, Picture, Pictured
from . import motion as motions
from .bake import bake
from .body import Body, Real
from .coupling import ridden, touching, united
from .motion import LayerMotion, Motion
from .presets import Box
from .simulate import simulate

EDGE = 0.035
"""Edge length of meshes that are made for motion, relative to the diagonal of a layer."""


def movable(image: Pictured) -> list[Layer]:
    """Layers that can move: those not hidden, except the back layer of an opaque picture."""
    layers = list(image.picture.layers)
    return [v for v in layers[image.picture.opaque :] if not v.pose.hidden]


def boxes(image: Pictured, names: Sequence[str | int] | None = None) -> dict[str, Box]:
    """Bounds of layers at rest.

    Args:
        image: The picture.
        names: Names or positions of the layers; None for all that can move.

    Returns:
        x0, y0, x1, y1 in canvas pixels of each layer, by name.

    Raises:
        UsageError: There is no such layer, a layer cannot move, or no layer can.
    """
    picture = image.picture
    return {v.name: _box(v, picture.size) for v in _chosen(picture, names)}


def _chosen(picture: Picture, names: Sequence[str | int] | None) -> list[Layer]:
    able = movable(picture)
    chosen = able if names is None else [picture.layers[k] for k in names]
    for layer in chosen:
        if layer not in able:
            why = "hidden" if layer.pose.hidden else "the back of an opaque picture"
            raise UsageError(f"layer {layer.name!r} cannot move: it is {why}")
    if not chosen:
        raise UsageError(
            "the picture has no layer that can move; encode it with masks or more layers"
        )
    return chosen


def _box(layer: Layer, size: tuple[int, int]) -> Box:
    if layer.boundary is None:
        return (0.0, 0.0, float(size[0]), float(size[1]))
    left, top, right, bottom = layer.boundary.bounds()
    return (float(left), float(top), float(right), float(bottom))


def preset(
    image: Pictured,
    name: str,
    names: Sequence[str | int] | None = None,
    *,
    together: bool = True,
    **options: Any,
) -> Motion:
    """Makes the motion of a preset for a picture.

    Args:
        image: The picture.
        name: Name of the preset, one of `motion.PRESETS`.
        names: Names or positions of the layers that move; None for all that can.
        together: Whether layers that touch move as one body.
        options: Options of `motion.preset`: ``duration``, ``fps``, ``loop``, ``seed``, ``pins``.

    Raises:
        UsageError: There is no such preset or layer, or an option is invalid.
    """
    picture = image.picture
    chosen = _chosen(picture, names)
    groups = [[i] for i in range(len(chosen))]
    if together:
        groups = touching(chosen, picture.size)
    wholes = {}
    for group in groups:
        x0, y0, x1, y1 = zip(*(_box(chosen[i], picture.size) for i in group), strict=True)
        wholes[chosen[group[0]].name] = (min(x0), min(y0), max(x1), max(y1))
    made = motions.preset(name, wholes, canvas=picture.size, **options)
    layers = {chosen[i].name: made.layers[chosen[g[0]].name] for g in groups for i in g}
    return replace(made, layers=layers, together=together)


def animate(
    picture: Picture, motion: Motion, progress: Callable[[int, int], None] | None = None
) -> Picture:
    """Simulates a motion, and gives it to a picture; a motion that the picture had is replaced.

    Args:
        picture: The picture.
        motion: The motion.
        progress: Called with the number of simulated frames, and the number of all frames to
            simulate.

    Returns:
        The picture with a timeline and tracks. Layers that move and had no mesh get one.

    Raises:
        UsageError: The motion does not fit the picture.
        LimitError: Nodes move farther than a file can hold.
    """
    cast = _Cast(picture, motion)
    found = simulate(cast.bodies, cast.motion, canvas=picture.size, progress=progress)
    moved = cast.displacements(found.displacements)
    names = [name for name in cast.layers if name in moved]
    timeline, tracks = bake(
        [moved[n] for n in names], fps=found.fps, loop=found.loop, script=motion.to_json()
    )
    moving = {
        name: replace(cast.layers[name], track=replace(track, body=names.index(cast.first(name))))
        for name, track in zip(names, tracks, strict=True)
    }
    layers = [
        moving[v.name] if v.name in moving else replace(v, track=None) for v in picture.layers
    ]
    return replace(picture, layers=Layers(layers), timeline=timeline)


class _Cast:
    """Layers and bodies that take part in a motion.

    Args:
        picture: The picture.
        motion: The motion.

    Attributes:
        layers: All layers that can move, by name, with meshes.
        bodies: Bodies to simulate: single layers, and unions of layers that move as one.
        motion: Motion of the bodies; a union has the name of its first layer.
    """

    def __init__(self, picture: Picture, motion: Motion) -> None:
        """Raises `UsageError` if a layer that the motion names cannot move, or none can."""
        able, size = _chosen(picture, None), picture.size
        for name in motion.layers:
            if name != "*" and name in (v.name for v in picture.layers):
                _chosen(picture, [name])
        self.layers = {v.name: _meshed(v, size) for v in able}
        self._wholes = _wholes(able, motion, size) if motion.together else {}
        self._first_of = {name: first for first, group in self._wholes.items() for name in group}
        alone = [_body(v) for name, v in self.layers.items() if name not in self._first_of]
        self.bodies = alone + [
            united(first, [v for v in able if v.name in group], size, EDGE)
            for first, group in self._wholes.items()
        ]
        kept = {k: v for k, v in motion.layers.items() if self.first(k) == k}
        self.motion = replace(motion, layers=kept)

    def first(self, name: str) -> str:
        """Name of the body that a layer is part of: that of its first layer."""
        return self._first_of.get(name, name)

    def displacements(self, found: Mapping[str, Real]) -> dict[str, Real]:
        """Displacements of layers from those of their bodies, float64 [F, N, 2] each, by name."""
        moved = dict(found)
        bodies = {b.name: b for b in self.bodies}
        for first, group in self._wholes.items():
            if first in found:
                for name in group:
                    nodes = _body(self.layers[name]).nodes
                    moved[name] = ridden(bodies[first], found[first], nodes)
        return moved


def _meshed(layer: Layer, size: tuple[int, int]) -> Layer:
    if layer.mesh is not None:
        return layer
    return replace(layer, mesh=mesher.derived(layer.boundary, size, EDGE))


def _body(layer: Layer) -> Body:
    assert layer.mesh is not None, "what moves has a mesh"
    refined = layer.mesh.refined
    return Body(layer.name, refined.nodes / (1 << FRACTION_BITS), refined.faces)


def _wholes(layers: Sequence[Layer], motion: Motion, size: tuple[int, int]) -> dict[str, list[str]]:
    """Groups of at least two layers that move as one: names of their layers, by the first name."""
    rest = motion.layers.get("*")
    found: dict[str, list[str]] = {}
    kinds: list[LayerMotion] = []
    for layer in layers:
        own = motion.layers.get(layer.name, rest)
        if own is not None and own not in kinds:
            kinds.append(own)
    for kind in kinds:
        alike = [v for v in layers if motion.layers.get(v.name, rest) == kind]
        for group in touching(alike, size):
            if len(group) > 1:
                found[alike[group[0]].name] = [alike[i].name for i in group]
    return found


def amplitude(image: Pictured, frames: int = 24) -> float:
    """Mean displacement by the motion of a picture, in canvas pixels.

    Args:
        image: The picture; without a motion the result is 0.
        frames: Number of times, evenly over the timeline, that are averaged.
    """
    picture = image.picture
    if picture.timeline is None:
        return 0.0
    total, count = 0.0, 0
    for layer in picture.layers:
        if layer.track is None:
            continue
        for k in range(frames):
            at = layer.track.at(picture.timeline, picture.timeline.seconds * k / frames)
            total += float(np.hypot(*at.T).sum()) / (1 << FRACTION_BITS)
            count += len(at)
    return total / max(count, 1)
