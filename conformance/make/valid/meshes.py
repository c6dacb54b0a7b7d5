"""Valid cases of meshes and bent layers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxyimg_codec.entropy import arrays
from proxyimg_codec.geometry import deltas
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture

from ..builders import (
    SIZE,
    Numbers,
    bend,
    disc,
    ellipse,
    grid_mesh,
    layer,
    on_back,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Args, Build, Valid, Valids

CASES = Valids()
_case = CASES.case

UNIT = 1 << 24
TURN: dict[str, Any] = {"matrix": (UNIT * 3 // 5, UNIT * 4 // 5, -UNIT * 4 // 5, UNIT * 3 // 5),
        "shift": (12001, -6003)}  # fmt: skip
"""Rotation by an angle whose cosine is 3/5, and a shift."""

CLOSE: Args = {"region": [14, 5, 8, 6], "width": 32}
"""A part of the canvas, enlarged four times, so that 1/1024 pixel shows."""


@_case("A layer on an unrefined mesh is bent", "mesh: connectivity", "pose: displacements",
       "outline: riding", renders=[WHOLE, CLOSE])  # fmt: skip
def _bent(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh)))


@_case("Bent, then turned: displacements come before the affine map", "pose: order",
       renders=[WHOLE, CLOSE, {"region": [5, 3, 13, 11], "width": 27}, {"width": 9}])  # fmt: skip
def _bent_turned(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh), **TURN))


def _closing(split: Sequence[Sequence[int]], reach: int) -> Build:
    """Builder of a bent disc on a mesh with given splits."""

    def build(n: Numbers) -> Picture:
        mesh = grid_mesh((0, -1), 3, 3, step=(512, 448), split=split)
        return on_back(n, disc(n, mesh, nodes=bend(n, mesh, reach)))

    return build


# In file order, triangle 7 in the middle has the neighbours 4, 5 and 10.
for _name, _title, _split in (
    ("closing-1", "Faces next to one split triangle", [[4]]),
    ("closing-2", "A face between two split triangles and a whole one", [[4, 5]]),
    ("closing-3", "A face between three split triangles", [[4, 5, 10]]),
    ("closing-deep", "Faces next to triangles that are split up to four times",
     [[4, 5], [0, 3, 5], [1, 2, 6, 8], [0, 3, 9, 13]]),
):  # fmt: skip
    CASES[_name] = Valid(
        _title, ("mesh: closing", "mesh: refinement"),
        _closing(_split, 8 if len(_split) > 1 else 24), [WHOLE, CLOSE],
    )  # fmt: skip


@_case("A refined mesh whose midpoints are rounded down", "mesh: midpoints", renders=[CLOSE])
def _midpoints(n: Numbers) -> Picture:
    split = [range(18), [1, 2, 5, 9, 30, 31, 40], range(0, 28, 3)]
    mesh = grid_mesh((0, -1), 3, 3, step=(501, 477), split=split)
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh, 9)))


@_case("A mesh of parts that are apart, or touch in one vertex, with holes",
       "mesh: parts", "mesh: far vertices", "pose: beyond the mesh")  # fmt: skip
def _parts(n: Numbers) -> Picture:
    keep = [0, 1, 2, 4, 5, 9, 12, 13, 14, 17, 22, 23, 26, 27, 35, 38]
    mesh = grid_mesh((2, 1), 5, 4, keep=keep)
    assert len(mesh.fields["far"]) > 1
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh, 12)))


def recoded(mesh: Mesh, symbols: Sequence[int], far: Sequence[int], wrap: int = 0) -> Mesh:
    """Mesh with other symbols and far vertices, and with `wrap` added to its residuals."""
    kept = mesh.fields
    residuals = deltas.decode(kept["classes"], kept["deltas"], 2, kept["vertices"], "") + wrap
    classes, raw = deltas.encode(residuals)
    stored = np.ones((1, len(symbols)), bool)
    coded = arrays.encode(np.array(symbols)[None, None], 4, stored)
    new: dict[str, Any] = {"gates": len(symbols), "symbols": coded, "far": list(far)}
    return Mesh({**kept, **new, "classes": classes, "deltas": raw})


def symbols_of(mesh: Mesh) -> list[int]:
    """Connectivity symbols of a mesh."""
    count = mesh.fields["gates"]
    coded = arrays.decode(mesh.fields["symbols"], (1, 1, count), 4, np.ones((1, count), bool))
    return [int(v) for v in coded.ravel()]


@_case("A mesh that names vertices by number where it could by rank, and residuals beyond a byte",
       "mesh: far vertices", "mesh: residuals")  # fmt: skip
def _far(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    symbols, far, triangles = [1, 1, 1], [], 0
    # The vertex that a ranked symbol names is found from the triangle that it makes.
    for symbol in symbols_of(mesh)[3:]:
        triangles += symbol > 0
        if symbol > 1:
            far.append(int(mesh.base.triangles[triangles, 2]))
        symbols.append(min(symbol, 1) if symbol < 2 else 15)
    again = recoded(mesh, symbols, far, 256)
    assert again.base.triangles.tolist() == mesh.base.triangles.tolist()
    return on_back(n, disc(n, again, nodes=bend(n, again)))


@_case("A mesh of two parts that lie over each other: corners that wait for no triangle have no "
       "rank, however near they are", "mesh: connectivity", "mesh: overlap")  # fmt: skip
def _overlaid(n: Numbers) -> Picture:
    one = grid_mesh((2, 1), 3, 2).base
    x, y = one.vertices.astype(int).T
    # No two triangles are a parallelogram; otherwise each corner would be where it is predicted.
    other = np.stack([x + 2 + x * y // 40, y + 1 + x * x // 80], axis=1).astype(np.uint8)
    base = replace(
        one,
        vertices=np.concatenate([one.vertices, other]),
        triangles=np.concatenate([one.triangles, one.triangles + len(one.vertices)]),
    )
    mesh = Mesh.build(base)
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh)))


def _folded_mesh() -> tuple[Mesh, NDArray[np.int64]]:
    """Mesh, and displacements that push its middle over the part on its right.

    The faces that are turned over have the lowest numbers.
    """
    keep = [92, *(k for k in range(160) if k != 92)]
    mesh = grid_mesh((2, 1), 10, 8, step=(128, 128), keep=keep)
    x, y = (mesh.refined.nodes >> 6).T
    middle = (abs(x - 12 * 16) < 60) & (abs(y - 9 * 16) < 50)
    return mesh, np.stack([np.where(middle, 71, 0), np.where(middle, 13, 3)], axis=1)


@_case("A layer with folds: faces that are turned over lie behind the others",
       "mesh: folds", renders=[WHOLE, CLOSE])  # fmt: skip
def _folded(n: Numbers) -> Picture:
    mesh, nodes = _folded_mesh()
    return on_back(n, disc(n, mesh, nodes=nodes))


@_case("The same, mirrored: the same faces lie behind the others", "mesh: folds",
       renders=[WHOLE, {"region": [2, 5, 8, 6], "width": 32}])  # fmt: skip
def _folded_flipped(n: Numbers) -> Picture:
    mesh, nodes = _folded_mesh()
    flip = {"matrix": (-UNIT, 0, 0, UNIT), "shift": (24 * 1024 + 100, 0)}
    return on_back(n, disc(n, mesh, nodes=nodes, **flip))


@_case("The same, sheared so much that it only nearly is mirrored", "mesh: folds",
       renders=[{"region": [5, 3, 16, 12], "width": 32}])  # fmt: skip
def _folded_sheared(n: Numbers) -> Picture:
    mesh, nodes = _folded_mesh()
    shear = {"matrix": (UNIT, UNIT // 2, UNIT // 2, UNIT), "shift": (-4096, -5120)}
    return on_back(n, disc(n, mesh, nodes=nodes, **shear))


@_case("Two parts of a mesh that are pushed over each other: the first face shows",
       "mesh: overlap", renders=[WHOLE, CLOSE])  # fmt: skip
def _overlap(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4, keep=[k for k in range(40) if k % 10 not in (4, 5)])
    x = mesh.refined.nodes[:, 0] >> 10
    nodes = np.stack([np.where(x < 12, 67, -59), np.where(x < 12, 9, -7)], axis=1)
    return on_back(n, disc(n, mesh, nodes=nodes))


@_case("A layer that reaches far beyond its mesh on all sides", "pose: beyond the mesh",
       "outline: riding", renders=[WHOLE, CLOSE])  # fmt: skip
def _beyond(n: Numbers) -> Picture:
    mesh = grid_mesh((9, 7), 2, 2, step=(192, 160))
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh)))


@_case("A layer so large against its mesh that weights are clamped", "pose: beyond the mesh",
       "outline: weights")  # fmt: skip
def _beyond_far(n: Numbers) -> Picture:
    mesh = grid_mesh((11, 8), 1, 1, step=(20, 20))
    return on_back(n, disc(n, mesh, nodes=bend(n, mesh, 2)))


@_case("Faces that are pressed to a line or a point hold no samples", "mesh: faces without area")
def _pressed_faces(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    x, y = (mesh.refined.nodes >> 6).T
    nodes = np.stack([np.where(x > 200, 200 - x, 0), np.where(y > 140, 140 - y, 0)], axis=1)
    return on_back(n, disc(n, mesh, nodes=nodes))


@_case("A bent boundary of long segments, which are divided into up to 64 pieces",
       "outline: pieces", renders=[WHOLE, CLOSE])  # fmt: skip
def _pieces(n: Numbers) -> Picture:
    mesh = grid_mesh((0, -1), 6, 5)
    shape = ellipse((12, 9), (11.5, 8.5)), polygon((3, 3), (300, 8.5), (5, 14), reverse=True)
    pose = Pose(nodes=bend(n, mesh))
    plane = texture(n, grid=(9, 8))
    return on_back(n, layer("long", (0, 0, *SIZE), plane, *shape, mesh=mesh, pose=pose))


@_case("A mesh wider than 4,096 pixels, for which weights are computed from fewer bits, and "
       "displacements of 15 bits and more", "outline: weights", renders=[WHOLE, CLOSE])  # fmt: skip
def _wide(n: Numbers) -> Picture:
    # The triangles at the canvas are refined twice, so that faces are small compared to the mesh.
    plain = grid_mesh((-15001, -3003), 15, 3, step=(140001, 140003))
    corners = plain.base.positions[plain.base.triangles] >> 10
    near = np.flatnonzero((corners.min(1) < 12).all(1) & (corners.max(1) > 0).all(1))
    split = [near.tolist(), range(4 * len(near))]
    mesh = grid_mesh((-15001, -3003), 15, 3, step=(140001, 140003), split=split)
    # The displacements make the layer about twice as large, about the corner of the canvas.
    pose = Pose(nodes=(mesh.refined.nodes >> 6) * 3 // 4 + bend(n, mesh))
    shapes = ellipse((5, 6), (4, 5)), polygon((9, -3000), (13, -2800), (11, 3000))
    plane = texture(n, grid=(9, 8))
    return on_back(n, layer("wide", (0, 0, 15, 12), plane, *shapes, mesh=mesh, pose=pose))


@_case("A back layer without boundary is bent: its outline is the bent canvas",
       "outline: the whole canvas", renders=[WHOLE, CLOSE])  # fmt: skip
def _bent_back(n: Numbers) -> Picture:
    mesh = grid_mesh((-1, -1), 2, 2, step=(832, 640))
    image = on_back(n, disc(n))
    back = replace(image.layers[0], mesh=mesh, pose=Pose(nodes=bend(n, mesh, 60)))
    return replace(image, opaque=False, layers=type(image.layers)([back, image.layers[1]]))
