"""Refused files: faults of meshes, poses and shared textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container.chunks import write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.geometry import deltas
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.pose import Pose, encode
from proxyimg_codec.model import Picture

from ..builders import (
    Numbers,
    bend,
    changed,
    ellipse,
    grid_mesh,
    layer,
    network,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..valid.meshes import UNIT
from .base import Base, Row, put, refused

(HEAD, BACK, DISC, COPY, DISC_MESH, COPY_MESH, POSE, NETW, BACK_TEXR, DISC_TEXR, COPY_TEXR,
 TAIL) = range(12)  # fmt: skip
"""Positions of the chunks in the base file."""


class Posed(Base):
    """Valid file: a back, a bent disc on a refined mesh, and a copy that shares its texture."""

    dim, channels = 4, 3

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        planes = [texture(n, dim=self.dim) for _ in range(2)]
        mesh = grid_mesh((1, 1), 2, 2, step=(320, 288), split=[[0, 3]])
        pose = Pose(nodes=bend(n, mesh, 20), opacity=60000)
        corners = polygon((3, 2), (9, 3), (6, 9))
        return picture(
            (12, 10),
            [
                layer("back", (0, 0, 12, 10), planes[0]),
                layer("disc", (2, 2, 8, 7), planes[1], ellipse((6, 5.5), (4, 3.5)), mesh=mesh,
                      pose=pose),
                layer("copy", (2, 2, 8, 7), planes[1], corners, mesh=mesh),
            ],
            network(n, dim=self.dim, channels=self.channels),
            opaque=self.channels == 3,
        )  # fmt: skip

    def sets(self, **values: dict[str, Any]) -> bytes:
        """File with changed values of several chunks, by the names of their positions."""
        chunks = list(self.chunks)
        for name, new in values.items():
            at = globals()[name]
            chunks[at] = changed(chunks[at], new)
        return write(chunks)

    def tiny(
        self, symbols: Sequence[int], points: Sequence[tuple[int, int]], far: Sequence[int] = ()
    ) -> bytes:
        """File in which the disc has another mesh, of given symbols and residuals of vertices."""
        stored = np.ones((1, len(symbols)), bool)
        classes, raw = deltas.encode(np.array(points, np.int64).T)
        mesh = {
            "vertices": len(points), "gates": len(symbols), "far": list(far), "classes": classes,
            "symbols": arrays.encode(np.array(symbols)[None, None], 4, stored), "deltas": raw,
            "levels": 0, "splits": b"",
        }  # fmt: skip
        return self.sets(DISC_MESH=mesh, POSE=_moved([(16, 16)] + [(0, 0)] * (len(points) - 1)))


class Odd(Posed):
    """Valid file with an odd number of features."""

    dim = 3


class Clear(Posed):
    """Valid file with alpha."""

    channels = 4


def _moved(residuals: Sequence[tuple[int, int]], kind: str = "node") -> dict[str, bytes]:
    """Fields of displacements with these residuals."""
    classes, raw = deltas.encode(np.array(residuals, np.int64).T)
    return {f"{kind}_classes": classes, f"{kind}_deltas": raw}


NONE: dict[str, Any] = {"node_classes": b"", "node_deltas": b""}
TRIANGLE = [(0, 0), (32, 0), (-32, 32)]
"""Residuals of three vertices."""
ALONE = [1, 1, 1, 0, 0, 0]
"""Connectivity symbols of one triangle."""


def _count(b: Posed) -> int:
    """Number of nodes of the disc."""
    return len(Mesh(b.fields(DISC_MESH)).refined.nodes)


def _flags(values: Sequence[int]) -> bytes:
    """Coded split flags of one refinement."""
    stored = np.ones((1, len(values)), bool)
    coded = arrays.encode(np.array(values)[None, None], 1, stored)
    return len(coded).to_bytes(4, "little") + coded


def _shared(b: Posed, at: int, texture: int) -> bytes:
    return b.payload(at, msgpack.packb([0, texture]))


def _chain(b: Posed) -> bytes:
    chunks = list(b.chunks)
    for at, number in ((DISC_TEXR, 0), (COPY_TEXR, 1)):
        chunks[at] = replace(chunks[at], payload=msgpack.packb([0, number]))
    return write(chunks)


MANY = grid_mesh((0, 0), 31, 17, step=(50, 75), cell=8)
"""Mesh of 1,054 triangles."""


def _fine(b: Posed) -> bytes:
    """File in which the fourth refinement of a mesh works on 64 times as many triangles."""
    flags = b"".join(_flags([1] * (1054 << 2 * k)) for k in range(3))
    fields = {**MANY.fields, "levels": 4, "splits": flags + _flags([1])}
    return b.set(DISC_MESH, **fields)


def _heaped(b: Posed) -> bytes:
    """File in which a mesh is bent so much that its faces lie over each other."""
    nodes = bend(Numbers("heaped"), MANY, 192)
    return b.sets(DISC_MESH=dict(MANY.fields), POSE=encode(Pose(nodes=nodes), MANY))


_AT = {"matrix": [UNIT, 0, 0, UNIT], "shift": [0, 0], "opacity": 65535, "hidden": 0, **NONE}

# fmt: off
_STRUCTURE: list[Row] = [
    ("invalid-mesh-order", "a pose before the meshes", "",
     lambda b: b.order(HEAD, BACK, DISC, COPY, POSE, DISC_MESH, COPY_MESH, *range(NETW, TAIL + 1))),
    ("invalid-pose-order", "a pose after the network", "",
     lambda b: b.order(*range(POSE), NETW, POSE, *range(BACK_TEXR, TAIL + 1))),
    ("invalid-mesh-twice", "two meshes of one layer", "",
     lambda b: b.set(COPY_MESH, layer=1)),
    ("invalid-mesh-descending", "the meshes not in the order of the layers", "",
     lambda b: b.order(*range(DISC_MESH), COPY_MESH, DISC_MESH, *range(POSE, TAIL + 1))),
    ("invalid-mesh-layer", "a mesh of a layer that does not exist", "",
     lambda b: b.set(COPY_MESH, layer=3)),
    ("invalid-pose-twice", "two poses of one layer", "",
     lambda b: b.order(*range(POSE + 1), POSE, *range(NETW, TAIL + 1))),
    ("invalid-pose-layer", "a pose of a layer that does not exist", "",
     lambda b: b.set(POSE, layer=3, **NONE)),
    ("invalid-shared-self", "a texture that is shared with itself", "SEC-1",
     lambda b: _shared(b, COPY_TEXR, 2)),
    ("invalid-shared-later", "a texture that is shared with a later layer", "",
     lambda b: _shared(b, BACK_TEXR, 1)),
    ("invalid-shared-chain", "a shared texture that is shared itself", "", _chain),
    ("invalid-shared-values", "a shared texture with the values of an implicit one", "",
     lambda b: b.set(DISC_TEXR, coder=0)),
    ("invalid-shared-sampling", "a texture that is shared with other features", "",
     lambda b: b.set(COPY, sampling=1)),
    ("invalid-sampling-mesh", "node sampling without a mesh", "",
     lambda b: b.set(BACK, sampling=2)),
    ("invalid-opaque-moved", "opaque with a back layer that was moved", "",
     lambda b: b.set(POSE, **_AT | {"layer": 0, "shift": [0, 1]})),
    ("invalid-opaque-turned", "opaque with a back layer that was turned", "",
     lambda b: b.set(POSE, **_AT | {"layer": 0, "matrix": [UNIT, 0, 1, UNIT]})),
    ("invalid-opaque-bent", "opaque with a back layer that is bent", "",
     lambda b: b.sets(DISC_MESH={"layer": 0}, POSE={"layer": 0, "opacity": 65535})),
    ("invalid-opaque-opacity", "opaque with a back layer of less than full opacity", "",
     lambda b: b.set(POSE, **_AT | {"layer": 0, "opacity": 65534})),
    ("invalid-opaque-hidden", "opaque with a hidden back layer", "",
     lambda b: b.set(POSE, **_AT | {"layer": 0, "hidden": 1})),
    ("unsupported-coder-values", "a texture coder of the future, with other values", "NUM-2",
     lambda b: b.payload(DISC_TEXR, msgpack.packb([200, "more"]))),
    ("unsupported-coder-keys", "a texture coder of the future in a map, with other keys",
     "NUM-2", lambda b: b.payload(DISC_TEXR, msgpack.packb({"coder": 77, "more": 1}))),
    ("limit-gates", "a mesh of a million gates", "SEC-9",
     lambda b: b.set(DISC_MESH, gates=1 << 20)),
    ("limit-faces", "a mesh of a quarter of a million faces", "SEC-9",
     _fine),
    ("limit-overlap", "a thousand faces, each nearly as large as the picture", "SEC-11",
     _heaped),
]

_MESHES: list[Row] = [
    ("invalid-mesh-turned", "a triangle of the base that is turned over", "",
     lambda b: b.tiny(ALONE, [(0, 0), (0, 32), (32, -32)])),
    ("invalid-mesh-flat", "a triangle of the base without area", "",
     lambda b: b.tiny(ALONE, [(0, 0), (16, 16), (16, 16)])),
    ("invalid-mesh-edge", "a directed edge of two triangles", "",
     lambda b: b.tiny([*ALONE, 15, 15, 1, 0, 0, 0], [*TRIANGLE, (-30, 30)], [0, 1])),
    ("invalid-mesh-start-none", "a part that begins with no vertex", "",
     lambda b: b.tiny([*ALONE, 0, 0, 0], TRIANGLE)),
    ("invalid-mesh-start-rank", "a part that begins with a ranked vertex", "",
     lambda b: b.tiny([*ALONE, 2, 2, 2], TRIANGLE)),
    ("invalid-mesh-rank", "a rank that no vertex has", "",
     lambda b: b.tiny([1, 1, 1, 2, 0, 0, 0, 0], TRIANGLE)),
    ("invalid-mesh-far", "a vertex that is not known yet", "",
     lambda b: b.tiny([1, 1, 1, 15, 0, 0, 0, 0], TRIANGLE, [3])),
    ("invalid-mesh-far-missing", "fewer far vertices than symbols", "MSH-3",
     lambda b: b.tiny([1, 1, 15, 0, 0, 0], TRIANGLE)),
    ("invalid-mesh-far-left", "a far vertex left over", "MSH-3",
     lambda b: b.tiny(ALONE, TRIANGLE, [0])),
    ("invalid-mesh-vertices-few", "fewer vertices than announced", "",
     lambda b: b.tiny(ALONE, [*TRIANGLE, (0, 0)])),
    ("invalid-mesh-vertices-many", "more vertices than announced", "",
     lambda b: b.tiny([1, 1, 1, 1, 0, 0, 0, 0], TRIANGLE)),
    ("invalid-mesh-gates-few", "a gate left open", "",
     lambda b: b.tiny(ALONE[:-1], TRIANGLE)),
    ("invalid-mesh-gates-many", "a part of two vertices", "",
     lambda b: b.tiny([*ALONE, 1, 1], [*TRIANGLE, (40, 40), (9, 9)])),
    ("invalid-mesh-symbols", "a bit of the symbols flipped", "MSH-3",
     lambda b: b.edit(DISC_MESH, "symbols", lambda v: put(v, -1, lambda x: x ^ 1))),
    ("invalid-mesh-deltas", "a byte of the residuals is missing", "MSH-4",
     lambda b: b.edit(DISC_MESH, "deltas", lambda v: v[:-1])),
    ("invalid-splits-none", "a refinement that splits nothing", "",
     lambda b: b.set(DISC_MESH, splits=_flags([0] * 8))),
    ("invalid-splits-cut", "the split flags end early", "",
     lambda b: b.edit(DISC_MESH, "splits", lambda v: v[:-1])),
    ("invalid-splits-long", "a byte after the split flags", "",
     lambda b: b.edit(DISC_MESH, "splits", lambda v: v + b"\0")),
    ("invalid-splits-levels", "a refinement without flags", "",
     lambda b: b.set(DISC_MESH, levels=2)),
    ("invalid-splits-more", "flags without a refinement", "",
     lambda b: b.set(DISC_MESH, levels=0)),
    ("invalid-levels", "five refinements", "", lambda b: b.set(DISC_MESH, levels=5)),
    ("invalid-step", "a step of zero", "", lambda b: b.set(DISC_MESH, step=[0, 288])),
]

_POSES: list[Row] = [
    ("invalid-pose-rest", "a pose that does nothing", "", lambda b: b.set(POSE, **_AT)),
    ("invalid-pose-singular", "a singular matrix", "",
     lambda b: b.set(POSE, matrix=[UNIT, 2 * UNIT, UNIT // 2, UNIT])),
    ("invalid-pose-matrix", "a matrix entry of 128", "",
     lambda b: b.set(POSE, matrix=[1 << 31, 0, 0, UNIT])),
    ("invalid-pose-shift", "a shift of 2^33", "", lambda b: b.set(POSE, shift=[1 << 33, 0])),
    ("invalid-pose-opacity", "an opacity of 65,536", "", lambda b: b.set(POSE, opacity=65536)),
    ("invalid-pose-hidden", "a layer that is hidden twice", "",
     lambda b: b.set(POSE, hidden=2)),
    ("invalid-pose-colour", "a colour matrix of eleven entries", "",
     lambda b: b.set(POSE, colour=[0] * 11)),
    ("invalid-pose-mesh", "displacements without a mesh", "",
     lambda b: b.order(*range(DISC_MESH), *range(COPY_MESH, TAIL + 1))),
    ("invalid-pose-zero", "displacements that are all zero", "",
     lambda b: b.set(POSE, **_moved([(0, 0)] * _count(b)))),
    ("invalid-pose-places-zero", "texture displacements that are all zero",
     "",
     lambda b: b.set(POSE, **_moved([(0, 0)] * _count(b), "place"))),
    ("invalid-pose-range", "a displacement of 2^24", "",
     lambda b: b.set(POSE, **_moved([(1 << 23, 0)] * 2 + [(0, 0)] * (_count(b) - 2)))),
    ("invalid-pose-raw", "raw bits of displacements without classes", "",
     lambda b: b.set(POSE, place_deltas=b"\0")),
    ("invalid-pose-few", "displacements of fewer nodes than there are", "MSH-18",
     lambda b: b.set(POSE, **_moved([(16, 0)] * (_count(b) - 1)))),
    ("invalid-pose-padding", "a padding bit of the displacements is set", "MSH-17",
     lambda b: b.edit(POSE, "node_deltas", lambda v: put(v, -1, lambda x: x | 1))),
]

_ODD: list[Row] = [
    ("invalid-sampling-odd", "node sampling of an odd number of features", "",
     lambda b: b.set(DISC, sampling=1)),
]

_CLEAR: list[Row] = [
    ("invalid-channels", "a network with more channels than HEAD", "",
     lambda b: b.set(HEAD, channels=3)),
    ("invalid-opaque-alpha", "opaque with a back layer that gives alpha", "",
     lambda b: b.set(HEAD, opaque=1)),
]
# fmt: on

CASES = {
    **refused((*_STRUCTURE, *_MESHES, *_POSES), Posed),
    **refused(_ODD, Odd),
    **refused(_CLEAR, Clear),
}
