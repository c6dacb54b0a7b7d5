"""Gives a picture a motion: meshes, simulation, tracks."""

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
"""Edges of meshes that are made for motion, relative to the diagonal of a layer."""


def movable(image: Pictured) -> list[Layer]:
    """The layers that can move: all that are drawn but the back layer of an opaque picture."""
    layers = list(image.picture.layers)
    return [v for v in layers[image.picture.opaque :] if not v.pose.hidden]


def boxes(image: Pictured, names: Sequence[str | int] | None = None) -> dict[str, Box]:
    """x0, y0, x1, y1 in canvas pixels, at rest, of layers by name.

    Args:
        image: The picture.
        names: Names or positions of the layers; None for all that can move.

    Raises:
        UsageError: There is no such layer, it cannot move, or no layer can.
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
    """A motion that suits a picture.

    Args:
        image: The picture.
        name: One of `motion.PRESETS`.
        names: Names or positions of the layers that move; None for all that can.
        together: Whether layers that touch move as one body.
        options: As of `motion.preset`: duration, fps, loop, seed, pins.

    Raises:
        UsageError: There is no such preset or layer, or an option makes no sense.
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
    made = motions.preset(name, wholes, **options)
    layers = {chosen[i].name: made.layers[chosen[g[0]].name] for g in groups for i in g}
    return replace(made, layers=layers, together=together)


def animate(
    picture: Picture, motion: Motion, progress: Callable[[int, int], None] | None = None
) -> Picture:
    """The picture with a motion instead of the one it may have.

    Args:
        picture: The picture.
        motion: What moves, and how.
        progress: Called with the number of simulated frames and of all frames to simulate.

    Raises:
        UsageError: The motion does not fit the picture.
        LimitError: Nodes are flung out of reach.
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
    """What takes part in a motion.

    Attributes:
        layers: All layers that can move, by name, with meshes.
        bodies: What is simulated: such layers, and wholes of layers that move as one.
        motion: What the bodies do; wholes have the names of their first layers.
    """

    def __init__(self, picture: Picture, motion: Motion) -> None:
        """Raises `UsageError` if the motion does not fit the picture."""
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
        """The first layer of the whole that a layer is part of; itself if it moves alone."""
        return self._first_of.get(name, name)

    def displacements(self, found: Mapping[str, Real]) -> dict[str, Real]:
        """Displacements [F, N, 2] of each layer that moves, from those of the bodies by name."""
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
    """Layers that move as one, at least two, by the name of their first."""
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
    """Mean displacement of the nodes that move, over the timeline, in canvas pixels."""
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
