"""Faults of meshes, poses and other parts that are new in version 0.2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from proxyimg_codec.codec import read
from proxyimg_codec.container import check, chunks, file, undo
from proxyimg_codec.container.content import Container
from proxyimg_codec.geometry import connectivity, mesh, pose, raster, warp
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.model import Layers, Picture
from proxyimg_codec.render import compose, neighbours, pixels

from .basics import Anything, Patch


def _posed(**change: Any) -> list[Patch]:
    """Patches that change the poses of a file."""
    return [(pose, "decode", lambda *a: replace(pose_of(*a), **change))]


def _bent_after(self: Pose, refined: mesh.Refined) -> Any:
    moved = 0 if self.nodes is None else self.nodes << 6
    return self.apply(refined.nodes) + moved


def _riding_after(boundary: Any, posed: Pose, meshed: Any, size: Any) -> Any:
    if posed.nodes is None or not posed.affine:
        return outline_of(boundary, posed, meshed, size)
    still = replace(posed, matrix=REST.matrix, shift=(0, 0))
    bent = outline_of(boundary, still, meshed, size)
    whole = outline_of(boundary, replace(still, nodes=0 * posed.nodes), meshed, size)
    assert bent is not None
    assert whole is not None
    pairs = zip(bent.paths, whole.paths, strict=True)
    return Boundary(10, tuple(posed.apply(rest) + moved - rest for moved, rest in pairs))


def _staying(boundary: Any, posed: Pose, meshed: Any, size: Any) -> Any:
    return outline_of(boundary, replace(posed, nodes=None), meshed, size)


def _rides_floored(self: Any, nodes: Any) -> Any:
    return (self.weights[..., None] * nodes[self.nodes]).sum(1) >> 16


def _never_a_rectangle(boundary: Any, *rest: Any) -> Any:
    return None if boundary is None else outline_of(boundary, *rest)


def _floored_map(self: Pose, points: Any) -> Any:
    a, b, c, d = self.matrix
    x, y = points.T
    e, f = self.shift
    return np.stack([(a * x + c * y >> 24) + e, (b * x + d * y >> 24) + f], axis=1)


def _centre_first(base: mesh.Base, splits: Sequence[Any]) -> mesh.Refined:
    later = [flags.reshape(-1, 4)[:, [1, 2, 3, 0]].ravel() for flags in splits[1:]]
    return refine_of(base, [*splits[:1], *later])


def _by_number(self: Any, edge: connectivity.Edge, near: int) -> Any:
    return np.sort(ranked_of(self, edge, near))


def _last_face(corners: Any, *rest: Any) -> Any:
    found = rasterize_of(corners[::-1], *rest)
    return np.where(found < 0, found, len(corners) - 1 - found)


def _both_sides(corners: Any, *rest: Any) -> Any:
    a, b, c = np.moveaxis(corners, 1, 0)
    turned = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    return rasterize_of(np.where(turned[:, None, None], corners[:, ::-1], corners), *rest)


def _unbent_beyond(self: warp.Warp, x: Any, y: Any, face: Any = None) -> warp.Located:
    shown = locate_of(self, x, y, face)
    if face is None:
        return shown
    return shown._replace(x=np.where(face < 0, x, shown.x), y=np.where(face < 0, y, shown.y))


def _stopped_at_the_edge(self: warp.Warp, x: Any, y: Any, face: Any = None) -> warp.Located:
    self._weighing = True
    shown = locate_of(self, x, y, face)
    if face is None or shown.face is None or shown.weights is None:
        return shown
    weights = np.clip(shown.weights, 0, 1)
    weights /= weights.sum(1, keepdims=True)
    assert self._mesh is not None
    refined = self._mesh.refined
    at = (weights[..., None] * (refined.nodes / 1024)[refined.faces[shown.face]]).sum(1)
    return warp.Located(at[:, 0], at[:, 1], shown.face, weights)


def _unclamped(self: Any, colour: Any) -> Any:
    shown = self._layer.pose
    if not shown.colour:
        return posed_of(self, colour)
    mixed = colour @ (np.reshape(shown.colour, (3, 4)) / 4096).T
    return np.column_stack([mixed, colour[:, 3]]) * (shown.opacity / 65535)


def _first_texture(*args: Any) -> Container:
    c = parse_of(*args)
    found = [{**t, "texture": 0} if t["coder"] == 0 else t for t in c.textures]
    return replace(c, textures=tuple(found))


def _box_of_texture(*args: Any) -> Container:
    c = parse_of(*args)
    layers = [
        {**v, "box": c.layers[t.get("texture", i)]["box"]}
        for i, (v, t) in enumerate(zip(c.layers, c.textures, strict=True))
    ]
    return replace(c, layers=tuple(layers))


def _all_direct(*args: Any) -> Container:
    c = parse_of(*args)
    layers = [{**v, "sampling": v["sampling"] & 1} for v in c.layers]
    return replace(c, layers=tuple(layers))


def _following_parents(*args: Any, **options: Any) -> Picture:
    made = from_bytes_of(*args, **options)
    above = {v.name: v for v in made.layers}
    moved = [
        replace(v, pose=replace(v.pose, shift=above[v.parent].pose.shift))
        if v.parent in above else v
        for v in made.layers
    ]  # fmt: skip
    return replace(made, layers=Layers(moved))


def _values_of_neighbours(residuals: Any, *_: Any) -> Any:
    return np.cumsum(residuals, axis=0)


outline_of, locate_of, rasterize_of = warp.outline, warp.Warp.locate, raster.rasterize
pose_of, refine_of, ranked_of = pose.decode, mesh.refine, connectivity.Border.ranked
premultiplied_of, posed_of = compose.premultiplied, compose._Painter.posed
parse_of, from_bytes_of, selected_of = file.parse_within, read.from_bytes, pixels.selected

FAULTS: dict[str, list[Patch]] = {
    "ignores-poses": [(pose, "decode", lambda *a: REST)],
    "ignores-displacements": _posed(nodes=None),
    "ignores-texture-displacements": _posed(places=None),
    "ignores-opacity": _posed(opacity=65535),
    "ignores-colour": _posed(colour=()),
    "bends-after-mapping": [(Pose, "present", _bent_after), (neighbours, "outline", _riding_after)],
    "boundary-stays": [(neighbours, "outline", _staying)],
    "rides-floored": [(warp._Riders, "displacement", _rides_floored)],
    "boundary-undivided": [(warp, "divide", lambda path: path)],
    "back-always-covers": [(neighbours, "outline", _never_a_rectangle)],
    "maps-floored": [(Pose, "apply", _floored_map)],
    "maps-unclamped": [(pose, "POINT_MAX", 1 << 40)],
    "no-closing": [(mesh, "_close", lambda triangles, origin, *_: (triangles, origin))],
    "children-turned": [(mesh, "refine", _centre_first)],
    "ranks-by-number": [(connectivity.Border, "ranked", _by_number)],
    "midpoints-not-predicted": [(pose, "restored", _values_of_neighbours)],
    "last-face-wins": [(warp, "rasterize", _last_face)],
    "turned-faces-win": [(warp, "rasterize", _both_sides)],
    "mirrored-faces-swap": [(Pose, "mirrored", False)],
    "first-face-beyond": [(warp, "nearest", lambda p, _: np.zeros(len(p), np.int64))],
    "rest-beyond": [(warp.Warp, "locate", _unbent_beyond)],
    "stops-beyond": [(warp.Warp, "locate", _stopped_at_the_edge)],
    "fine-weights": [(warp, "GRID_BITS", 23)],
    "matrix-before-clamping": [(compose, "premultiplied", lambda out:
        np.column_stack([out[:, :3], premultiplied_of(out)[:, 3]]))],
    "matrix-not-clamped": [(compose._Painter, "posed", _unclamped)],
    "draws-hidden": _posed(hidden=False),
    "never-draws-hidden": [(pixels, "selected", lambda image, layers, background:
        [v for v in selected_of(image, layers, background) if not v.pose.hidden])],
    "shared-texture-of-the-back": [(read, "parse_within", _first_texture)],
    "shared-box": [(read, "parse_within", _box_of_texture)],
    "local-is-direct": [(read, "parse_within", _all_direct)],
    "follows-parents": [(read, "from_bytes", _following_parents)],
    "believes-histories": [(undo, "digest", lambda *_: Anything())],
    "accepts-contradictions": [(check, "check", lambda *a: None)],
    "reads-only-0.12": [(chunks, "READABLE", (chunks.VERSION,))],
    "reads-the-future": [(chunks, "READABLE", tuple((0, k) for k in range(1, 20)))],
    "accepts-idle-poses": [(Pose, "at_rest", False)],
}  # fmt: skip
"""Patches of each decoder with a fault."""
