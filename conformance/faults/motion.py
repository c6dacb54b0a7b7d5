"""Faults of motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from proxyimg_codec import api
from proxyimg_codec.codec import read
from proxyimg_codec.container import check, file
from proxyimg_codec.container.content import Container
from proxyimg_codec.geometry import deltas, track, warp
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Refined
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.geometry.track import SUM, Timeline, Track
from proxyimg_codec.model import Layers, Picture, Pictured
from proxyimg_codec.render import moment, neighbours, pixels

from .basics import Patch


def _linear(phase: int) -> Any:
    return np.array([0, 1024 - phase, phase, 0]) * (SUM // 1024)


def _interpolating(phase: int) -> Any:
    f, g = phase, 1024 - phase
    first, second = -f * g * g, 2 * 1024**3 - 5 * 1024 * f * f + 3 * f**3
    third, last = 2 * 1024**3 - 5 * 1024 * g * g + 3 * g**3, -f * f * g
    return np.array([first, second, third, last]) * 3


def _times(change: Callable[[Timeline, float], float]) -> list[Patch]:
    """Patches that replace the time by another one."""
    return [(Timeline, "taps", lambda self, t: taps_of(self, change(self, t)))]


def _taps(change: Callable[[Timeline, Any], Any]) -> list[Patch]:
    """Patches that replace the coefficients that count at a time."""

    def taps(self: Timeline, seconds: float) -> Any:
        index, weights = taps_of(self, seconds)
        return change(self, index), weights

    return [(Timeline, "taps", taps)]


def _tracks(change: Callable[[Track], Track]) -> list[Patch]:
    """Patches that change the tracks of a file."""
    return [(track, "decode", lambda *a: [change(t) for t in decode_of(*a)])]


def _last_before_first(line: Timeline, index: Any) -> Any:
    first = int(index[0])
    return np.minimum(first + np.arange(4), line.coefficients - 1)


def _cumulative_over_layers(
    curves: Any, shapes: Any, modes: int, line: Timeline, meshes: list[Refined], *rest: Any
) -> list[Track]:
    found = decode_of(curves, shapes, modes, line, meshes, *rest)
    offset: Any = 0
    out = []
    for each in found:
        out.append(replace(each, curves=each.curves + offset))
        offset = out[-1].curves[:, -1:]
    return out


def _one_row(coded: bytes, raw: bytes, channels: int, count: int, where: str, rows: int = 1) -> Any:
    return deltas_of(coded, raw, channels, count * rows, where)


def _present_after(self: Pose, refined: Refined) -> Any:
    if self.sway is None:
        return present_of(self, refined)
    return present_of(replace(self, sway=None), refined) + self.sway


def _riding_after(boundary: Any, posed: Pose, meshed: Any, size: Any) -> Any:
    if posed.sway is None or not posed.affine:
        return outline_of(boundary, posed, meshed, size)
    before = outline_of(boundary, replace(posed, sway=0 * posed.sway), meshed, size)
    still = replace(posed, matrix=REST.matrix, shift=(0, 0))
    moved = outline_of(boundary, replace(still, nodes=None), meshed, size)
    rest = outline_of(boundary, replace(still, nodes=None, sway=0 * posed.sway), meshed, size)
    paths = zip(before.paths, moved.paths, rest.paths, strict=True)  # type: ignore[union-attr]  # none is None
    return Boundary(10, tuple(a + b - c for a, b, c in paths))


def _started(image: Pictured, *, t: float | None = None, **options: Any) -> Any:
    return render_of(image, t=0 if t is None and image.picture.timeline else t, **options)


def _moments(at: Callable[[Picture, float], Picture]) -> list[Patch]:
    """Patches that replace the picture at a time."""
    return [(api, "at", at), (pixels, "at", at)]


def _posed(change: Callable[[int, Pose], dict[str, Any]]) -> list[Patch]:
    """Patches that change the poses at a time, by the number of the layer."""

    def at(picture: Picture, t: float) -> Picture:
        made = at_of(picture, t)
        layers = [
            replace(v, pose=replace(v.pose, **change(k, v.pose))) for k, v in enumerate(made.layers)
        ]
        return replace(made, layers=Layers(layers))

    return _moments(at)


def _still_where_nothing_moves(_: int, posed: Pose) -> dict[str, Any]:
    moves = posed.sway is not None and posed.sway.any()
    return {} if moves else {"sway": None, "body": None}


def _floored(self: Track, line: Timeline, seconds: float) -> Any:
    index, weight = line.taps(seconds)
    values = (self.curves[:, index] @ weight << 8) // SUM
    return np.tensordot(values, self.shapes, 1) << (10 - line.unit) >> 16


def _turned(self: Track, line: Timeline, seconds: float) -> Any:
    return path_of(self, line, seconds)[:, ::-1]


def _every_curve_the_first(made: Track) -> Track:
    return replace(made, curves=np.repeat(made.curves[:1], len(made.curves), 0))


def _by_vertex(values: Any, *_: Any) -> Any:
    return np.cumsum(values, axis=0)


def _first_meshes(*args: Any) -> Container:
    c = parse_of(*args)
    if c.motion is None:
        return c
    numbers = sorted(m["layer"] for m in c.meshes)[: len(c.motion["layers"])]
    return replace(c, motion={**c.motion, "layers": numbers})


taps_of, decode_of, path_of, at_of = Timeline.taps, track.decode, Track.at, moment.at
deltas_of, present_of, outline_of = deltas.decode, Pose.present, warp.outline
parse_of, render_of = file.parse_within, pixels.render

FAULTS: dict[str, list[Patch]] = {
    "ignores-motion": _moments(lambda picture, t: picture),
    "moves-without-a-time": [(pixels, "render", _started)],
    "linear-curves": [(track, "weights", _linear)],
    "curves-through-coefficients": [(track, "weights", _interpolating)],
    "stops-at-the-end": _times(lambda line, t: min(max(t, 0), line.seconds - 1e-6)
        if line.loop else t),
    "always-loops": _times(lambda line, t: t % line.seconds),
    "end-is-the-beginning": _times(lambda line, t: 0 if t == line.seconds else t),
    "mirrors-negative-times": _times(lambda line, t: abs(t)),
    "whole-frames": _times(lambda line, t: int(t * line.fps) / line.fps),
    "loops-do-not-wrap": _taps(_last_before_first),
    "interval-late": _taps(lambda line, index: (index + 1) % line.coefficients),
    "interval-early": _taps(lambda line, index: (index - 1) % line.coefficients),
    "curves-not-summed": _tracks(lambda t: replace(t, curves=np.diff(t.curves, prepend=0))),
    "curves-summed-over-layers": [(track, "decode", _cumulative_over_layers)],
    "one-curve-for-all": _tracks(_every_curve_the_first),
    "first-shape-only": _tracks(lambda t: Track(t.curves[:1], t.shapes[:1])),
    "shapes-in-one-row": [(deltas, "decode", _one_row)],
    "shapes-without-midpoints": [(track, "restored", _by_vertex)],
    "moves-the-first-meshes": [(read, "parse_within", _first_meshes)],
    "ignores-unit": [(Track, "at", lambda self, line, t: path_of(self, replace(line, unit=4), t))],
    "x-for-y": [(Track, "at", _turned)],
    "motion-floored": [(Track, "at", _floored)],
    "motion-unclamped": [(track, "POINT_MAX", 1 << 50)],
    "forgets-bends": [(Pose, "displacements", property(lambda self:
        self.nodes << 6 if self.sway is None else self.sway))],
    "moves-after-mapping": [(Pose, "present", _present_after),
        (neighbours, "outline", _riding_after)],
    "still-where-nothing-moves": _posed(_still_where_nothing_moves),
    "bodies-apart": _posed(lambda k, posed: {"body": k}),
    "one-body": _posed(lambda k, posed: {"body": None if posed.sway is None else 0}),
    "bodies-rest-on-all": _posed(lambda k, posed: {"body": 0}),
    "accepts-large-curves": [(track, "CURVE_MAX", 1 << 40)],
    "accepts-large-shapes": [(track, "SHAPE_MAX", 1 << 40)],
    "accepts-any-motion": [(check, "_check_motion", lambda *a: None)],
}  # fmt: skip
"""Patches of each decoder with a fault."""
