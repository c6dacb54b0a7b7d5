"""Refused files: faults of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import zstandard

from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.geometry import deltas, track
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.track import Track
from proxyimg_codec.model import Picture

from ..builders import Numbers, ellipse, grid_mesh, layer, network, picture, polygon, texture
from ..valid.motion import LOOP, moving
from ..valid.motion import track as random_track
from .base import Base, Row, put, refused

(HEAD, BACK, DISC, BAR, LAST, BACK_MESH, DISC_MESH, BAR_MESH, NETW, BACK_TEXR, DISC_TEXR, BAR_TEXR,
 LAST_TEXR, MOTION, TAIL) = range(15)  # fmt: skip
"""Positions of the chunks in the base file."""

LINE = replace(LOOP, script='{"version": 1, "preset": "jelly"}\n')


class Moving(Base):
    """Valid file: a back with a mesh, a disc and a bar that move, and a layer without mesh."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        shown = texture(n, grid=(4, 4))
        split = grid_mesh((1, 1), 2, 2, step=(320, 288), split=[[0, 3]])
        image = picture(
            (12, 10),
            [
                layer("back", (0, 0, 12, 10), shown, mesh=grid_mesh((0, 0), 3, 3)),
                layer("disc", (2, 2, 8, 7), shown, ellipse((6, 5.5), (4, 3.5)), mesh=split),
                layer("bar", (1, 6, 9, 3), shown, polygon((1, 6), (10, 7), (3, 9)),
                      mesh=grid_mesh((0, 4), 3, 2)),
                layer("last", (0, 0, 5, 5), shown, polygon((0, 0), (5, 1), (1, 5))),
            ],
            network(n),
        )  # fmt: skip
        tracks = {
            name: random_track(n, mesh, LINE)
            for name in ("disc", "bar")
            if (mesh := image.layers[name].mesh)
        }
        return moving(image, LINE, tracks)

    def moves(
        self, numbers: Sequence[int], curve: int = 256, shape: int = 9, **new: Any
    ) -> dict[str, Any]:
        """Values of mOTN for layers that have meshes.

        Args:
            numbers: Numbers of the layers.
            curve: Value of one coefficient.
            shape: Value of one coordinate of a shape.
            **new: Other values of mOTN.
        """
        tracks = []
        for number in numbers:
            mesh = Mesh({k: v for k, v in self.fields(BACK_MESH + number).items() if k != "layer"})
            curves = np.zeros((2, LINE.coefficients), np.int64)
            shapes = np.ones((2, *mesh.refined.nodes.shape), np.int64)
            curves[1, 2], shapes[0, 3, 1] = curve, shape
            tracks.append((Track(curves, shapes), mesh.refined))
        coded = zip(("curve", "shape"), track.encode(tracks), strict=True)
        streams = {
            f"{k}_{p}": v for k, c in coded for p, v in zip(("classes", "deltas"), c, strict=True)
        }
        return {"layers": list(numbers), "bodies": [0] * len(numbers), **streams, **new}


def _numbers(b: Moving, name: str, rows: int, columns: int, flat: bool = False) -> dict[str, bytes]:
    """Streams of an array of another size, all of whose values are 1."""
    values = np.ones((rows, columns) if name == "curve" else (2, rows, columns), np.int64)
    classes, raw = deltas.encode(values.reshape(2, -1) if flat else values)
    return {f"{name}_classes": classes, f"{name}_deltas": raw}


def _nodes(b: Moving) -> int:
    """Number of nodes of the layers that move."""
    fields = (b.fields(k) for k in (DISC_MESH, BAR_MESH))
    return sum(
        len(Mesh({k: v for k, v in f.items() if k != "layer"}).refined.nodes) for f in fields
    )


def _script(text: bytes, size: int | None = None) -> dict[str, Any]:
    frame = zstandard.ZstdCompressor(level=3).compress(text)
    return {"size": len(text) if size is None else size, "script": frame}


def _late(b: Moving) -> bytes:
    """File with the motion before the textures."""
    return b.order(*range(NETW + 1), MOTION, *range(BACK_TEXR, MOTION), TAIL)


def _twice(b: Moving) -> bytes:
    chunks: list[Chunk] = [*b.chunks[:TAIL], b.chunks[MOTION], b.chunks[TAIL]]
    return write(chunks)


K = LINE.coefficients


# fmt: off
_ROWS: list[Row] = [
    ("invalid-motion-twice", "two chunks of motion", "", _twice),
    ("invalid-motion-order", "motion before the textures", "", _late),
    ("invalid-motion-none", "no layer moves", "", lambda b: b.set(MOTION, layers=[])),
    ("invalid-motion-descending", "layers that move in descending order", "",
     lambda b: b.set(MOTION, **b.moves([2, 1]))),
    ("invalid-motion-same", "a layer that moves twice", "",
     lambda b: b.set(MOTION, **b.moves([1, 1]))),
    ("invalid-motion-layer", "a layer moves that does not exist", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], layers=[1, 4]))),
    ("invalid-motion-mesh", "a layer moves that has no mesh", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], layers=[1, 3]))),
    ("invalid-motion-back", "the back layer of an opaque file moves", "",
     lambda b: b.set(MOTION, **b.moves([0, 1]))),
    ("invalid-motion-bodies-few", "a layer that moves without a number of its body", "",
     lambda b: b.set(MOTION, bodies=[0])),
    ("invalid-motion-bodies-many", "more numbers of bodies than layers that move", "",
     lambda b: b.set(MOTION, bodies=[0, 1, 2])),
    ("invalid-motion-script-unsaid", "a script without a size", "",
     lambda b: b.set(MOTION, size=0)),
    ("invalid-motion-script-missing", "the size of a script that is missing", "",
     lambda b: b.set(MOTION, script=b"")),
    ("invalid-motion-script-long", "a script that is longer than its size", "",
     lambda b: b.set(MOTION, **_script(b"{}" + b" " * 9, 3))),
    ("invalid-motion-script-short", "a script that is shorter than its size", "",
     lambda b: b.set(MOTION, **_script(b"{}", 3))),
    ("invalid-motion-script-plain", "a script that is not compressed", "",
     lambda b: b.set(MOTION, size=2, script=b"{}")),
    ("invalid-motion-script-latin", "a script that is not UTF-8", "",
     lambda b: b.set(MOTION, **_script(b'{"a": "\xe4"}'))),
    ("invalid-motion-curves-few", "a coefficient too few", "MOT-3",
     lambda b: b.set(MOTION, **_numbers(b, "curve", 2, 2 * K - 1))),
    ("invalid-motion-curves-many", "a coefficient too many", "MOT-3",
     lambda b: b.set(MOTION, **_numbers(b, "curve", 2, 2 * K + 1))),
    ("invalid-motion-loop", "coefficients of a loop on a timeline without", "MOT-2",
     lambda b: b.set(MOTION, loop=0)),
    ("invalid-motion-curve-raw", "a byte of the steps of curves is missing", "MOT-3",
     lambda b: b.edit(MOTION, "curve_deltas", lambda v: v[:-1])),
    ("invalid-motion-curve-padding", "a padding bit of the steps of curves is set", "MOT-3",
     lambda b: b.edit(MOTION, "curve_deltas", lambda v: put(v, -1, lambda x: x | 1))),
    ("invalid-motion-curve-bit", "a bit of the classes of curves flipped", "MOT-3",
     lambda b: b.edit(MOTION, "curve_classes", lambda v: put(v, -1, lambda x: x ^ 1))),
    ("invalid-motion-shapes-few", "a node too few", "MOT-4",
     lambda b: b.set(MOTION, **_numbers(b, "shape", 2, _nodes(b) - 1))),
    ("invalid-motion-shapes-many", "a node too many", "MOT-4",
     lambda b: b.set(MOTION, **_numbers(b, "shape", 2, _nodes(b) + 1))),
    ("invalid-motion-shape-row", "classes of shapes in a single row", "MOT-4",
     lambda b: b.set(MOTION, **_numbers(b, "shape", 2, _nodes(b), flat=True))),
    ("invalid-motion-shape-raw", "a byte too many of the residuals of shapes", "MOT-4",
     lambda b: b.edit(MOTION, "shape_deltas", lambda v: v + b"\0")),
    ("invalid-motion-modes", "fewer curves and shapes than there are", "MOT-3",
     lambda b: b.set(MOTION, modes=1)),
    ("invalid-motion-curve-high", "a coefficient of 2^15", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], curve=1 << 15))),
    ("invalid-motion-curve-low", "a coefficient of -2^15", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], curve=-1 << 15))),
    ("invalid-motion-shape-high", "a coordinate of a shape of 2^20", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], shape=1 << 20))),
    ("invalid-motion-shape-low", "a coordinate of a shape of -2^20", "",
     lambda b: b.set(MOTION, **b.moves([1, 2], shape=-1 << 20))),
    ("invalid-motion-duration", "a timeline of no length", "",
     lambda b: b.set(MOTION, duration=0)),
    ("invalid-motion-hours", "a timeline of more than an hour", "",
     lambda b: b.set(MOTION, duration=3_600_001)),
    ("invalid-motion-rate", "no frame a second", "", lambda b: b.set(MOTION, fps=0)),
    ("invalid-motion-looping", "a timeline that loops twice", "",
     lambda b: b.set(MOTION, loop=2)),
    ("invalid-motion-intervals", "a timeline of no interval", "",
     lambda b: b.set(MOTION, intervals=0)),
    ("invalid-motion-unit", "shapes in 1/128 pixel", "", lambda b: b.set(MOTION, unit=7)),
    ("invalid-motion-modes-none", "no curve", "", lambda b: b.set(MOTION, modes=0)),
    ("invalid-motion-modes-many", "65 curves", "", lambda b: b.set(MOTION, modes=65)),
    ("limit-motion", "two curves, one after the other, of 65,536 coefficients each", "",
     lambda b: b.set(MOTION, intervals=1 << 16)),
    ("limit-motion-script", "a script of 64 megabytes and a byte", "SEC-6",
     lambda b: b.set(MOTION, **_script(bytes((1 << 26) + 1)))),
]
# fmt: on

CASES = refused(_ROWS, Moving)
