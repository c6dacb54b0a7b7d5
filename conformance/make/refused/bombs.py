"""Refused files: a few bytes that ask for as much as possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container.chunks import write
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Layer, Picture

from ..builders import Numbers, changed, ellipse, grid_mesh, layer, network, picture, texture
from .base import BACK, BACK_TEXR, DISC, DISC_TEXR, HEAD, NETW, Base, Refused
from .motion import MOTION, Moving
from .poses import COPY_MESH, DISC_MESH, Posed
from .pyramids import PLAN, Views


def stream(words: int = 0) -> bytes:
    """Coded array that is as long as is allowed; its symbols soon cost next to nothing."""
    return b"\0" + (1 << 16).to_bytes(4, "little") + words.to_bytes(4, "little") + bytes(2 * words)


class Fine(Base):
    """Valid file: a layer that is bent by a mesh of many faces, most of them beside it."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        split = [range(count) for count in (1054, 4216)]
        mesh = grid_mesh((0, 0), 31, 17, step=(64, 64), cell=8, split=split)
        nodes = np.zeros_like(mesh.refined.nodes)
        nodes[0] = 16, -16
        wide = layer("wide", (0, 0, 9, 9), texture(n), ellipse((100, 90), (98, 88)), mesh=mesh,
                     pose=Pose(nodes=nodes))  # fmt: skip
        return picture((9, 8), [layer("back", (0, 0, 9, 8), texture(n)), wide], network(n))


class FarPoints(Base):
    """Valid file: a hidden, bent layer whose boundary lies beside its mesh of many faces."""

    POSE = 4

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        split = [range(count) for count in (1054, 4216, 16_864)]
        mesh = grid_mesh((8, 0), 31, 17, step=(32, 32), cell=8, split=split)
        nodes = np.zeros_like(mesh.refined.nodes)
        nodes[0] = 16, -16
        there = np.arange(4)[:, None] * (87_380, 1)
        path = np.concatenate([there[:3], there[:0:-1]] * 12)
        far = layer("far", (0, 0, 9, 8), texture(n), path, mesh=mesh,
                    pose=Pose(nodes=nodes, hidden=True))  # fmt: skip
        return picture((9, 8), [layer("back", (0, 0, 9, 8), texture(n)), far], network(n))


class Many(Base):
    """Valid file: layers that share a texture."""

    count, dim, hidden, depth = 129, 1, 1, 1

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        shown = texture(n, dim=self.dim, grid=(2, 2))
        layers = [layer(str(k), (0, 0, 1, 1), shown) for k in range(self.count)]
        net = network(n, dim=self.dim, hidden=self.hidden, depth=self.depth, octaves=0)
        return picture((8, 8), [*layers[:-1], self.front(layers[-1])], net)

    def front(self, last: Layer) -> Layer:
        """Returns the layer in front of the others, made from `last`."""
        return last


class ManyWeights(Many):
    """Valid file: layers that share a texture, with a network of 1,083 weights and biases."""

    count, hidden, depth = 256, 30, 2


class ManyFaces(Many):
    """Valid file: layers that share a texture, and a bent layer in front."""

    count = 256

    def front(self, last: Layer) -> Layer:
        """Returns the layer bent by a mesh of two faces."""
        mesh = grid_mesh((0, 0), 1, 1, step=(1 << 19, 1 << 19))
        nodes = np.zeros_like(mesh.refined.nodes)
        nodes[0] = -16
        return replace(last, mesh=mesh, pose=Pose(nodes=nodes))


class ManyAnchors(Many):
    """Valid file: layers that share a texture; the front has a global feature of four anchors."""

    count, dim = 256, 4

    def front(self, last: Layer) -> Layer:
        """Returns the layer with the global feature."""
        return replace(last, sampling=3)


class Lines(Base):
    """Valid file: a layer whose boundary goes to and fro, thousands of pixels beyond the canvas."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        there = np.arange(4)[:, None] * (87_380, 1)
        path = np.concatenate([there[:3], there[:0:-1]] * 2050)
        back = layer("back", (0, 0, 8, 1), texture(n))
        lines = layer("lines", (0, 0, 8, 1), texture(n), path, unit=2)
        return picture((8, 1), [back, lines], network(n))


def _several(b: Base, *changes: tuple[int, dict[str, Any]]) -> bytes:
    chunks = list(b.chunks)
    for at, new in changes:
        chunks[at] = changed(chunks[at], new)
    return write(chunks)


_Row = tuple[type[Base], str, str, str, Callable[[Any], bytes]]

# fmt: off
_LIMITS: list[_Row] = [
    (Base, "limit-networks", "65,536 networks announced", "SEC-5",
     lambda b: b.set(HEAD, networks=1 << 16)),
    (Base, "limit-codes", "a plane of 50 million codes", "SEC-5",
     lambda b: b.set(BACK_TEXR, grid=[4096, 4096])),
    (Base, "limit-small-codes", "8.4 million codes in a file of few bytes", "SEC-5",
     lambda b: b.set(BACK_TEXR, grid=[2800, 1000])),
    (Base, "limit-codes-together", "two planes of five million codes each", "SEC-5",
     lambda b: _several(b, *((at, {"grid": [1300, 1300]}) for at in (BACK_TEXR, DISC_TEXR)))),
    (Base, "limit-wavefronts", "a plane of a million rows", "SEC-5",
     lambda b: b.set(BACK_TEXR, grid=[2, 1 << 20])),
    (Base, "limit-segments-together", "two layers of 40,000 segments each", "SEC-5",
     lambda b: _several(b, (HEAD, {"opaque": 0}),
                        *((at, {"segments": [40_000]}) for at in (BACK, DISC)))),
    (Base, "limit-parameters-wide", "the widest and deepest network", "SEC-5",
     lambda b: b.set(NETW, dim=64, octaves=12, hidden=1024, depth=8)),
    (Posed, "limit-small-gates", "32,769 gates in a file of few bytes", "SEC-5",
     lambda b: b.set(DISC_MESH, gates=(1 << 15) + 1)),
    (Posed, "limit-gates-together", "two meshes of 20,000 gates each", "SEC-5",
     lambda b: _several(b, *((at, {"gates": 20_000}) for at in (DISC_MESH, COPY_MESH)))),
    (Fine, "limit-beyond", "27,000 points that no face holds, and 17,000 faces", "SEC-11",
     lambda b: b.set(HEAD, size=[200, 180])),
    (Many, "limit-multiply-adds", "129 layers of 2^26 samples each", "SEC-11",
     lambda b: b.set(HEAD, size=[1 << 13, 1 << 13])),
    (ManyWeights, "limit-multiply-adds-network", "256 layers of nearly 2^25 samples, and a network",
     "SEC-11", lambda b: b.set(HEAD, size=[4559, 7360])),
    (ManyFaces, "limit-multiply-adds-faces", "256 layers of nearly 2^25 samples, and two faces",
     "SEC-11", lambda b: b.set(HEAD, size=[4096, 8191])),
    (ManyAnchors, "limit-multiply-adds-anchors",
     "256 layers of nearly 2^25 samples, and four anchors", "SEC-11",
     lambda b: b.set(HEAD, size=[4096, 8191])),
    (Lines, "limit-work", "4,100 lines that cross 65,536 samples each", "SEC-11",
     lambda b: b.set(HEAD, size=[1 << 16, 1])),
    (FarPoints, "limit-beyond-points", "4,600 control points that no face holds, and 67,000 faces",
     "SEC-11", lambda b: b.set(b.POSE, hidden=0)),
    (Views, "limit-small-samples", "a raster of 2^24 samples and some in a file of few bytes",
     "SEC-5", lambda b: b.set(PLAN, size=[1 << 12, (1 << 12) + 1])),
    (Views, "limit-samples-levels", "a raster of one row, rounded up to 2^24 samples and some",
     "SEC-8",
     lambda b: b.set(PLAN, size=[(1 << 16) + 1, 1], levels=8, shifts=[8] * 16, grey=0)),
    (Moving, "limit-motion-numbers", "64 curves of 65,520 coefficients each", "SEC-5",
     lambda b: b.set(MOTION, loop=1, intervals=32_760, modes=64)),
    (Moving, "limit-motion-nodes", "64 curves of 65,500 coefficients each, and shapes", "SEC-5",
     lambda b: b.set(MOTION, loop=1, intervals=32_750, modes=64)),
    (Moving, "limit-motion-wavefronts", "as many coefficients as may be, and nodes", "SEC-5",
     lambda b: b.set(MOTION, loop=1, intervals=65_526)),
    (Moving, "limit-motion-size", "a script of two gigabytes announced", "SEC-6",
     lambda b: b.set(MOTION, size=(1 << 31) - 1, script=b"a")),
]

_STREAMS: list[_Row] = [
    (Base, "invalid-few-codes", "7.7 million codes in nine bytes", "SEC-7",
     lambda b: b.set(BACK_TEXR, grid=[1600, 1600], bits=4, codes=stream())),
    (Base, "invalid-few-stored", "a mask of 2.6 million codes in nine bytes", "SEC-7",
     lambda b: b.set(DISC_TEXR, grid=[1600, 1600], stored=stream())),
    (Base, "invalid-few-classes", "65,000 segments in nine bytes", "SEC-7",
     lambda b: b.set(DISC, segments=[65_000], classes=stream(), deltas=b"")),
    (Posed, "invalid-few-symbols", "30,000 gates in nine bytes", "SEC-7",
     lambda b: b.set(DISC_MESH, gates=30_000, symbols=stream())),
    (Posed, "invalid-few-vertices", "65,536 vertices in nine bytes", "SEC-7",
     lambda b: b.set(DISC_MESH, vertices=1 << 16, classes=stream(), deltas=b"")),
    (Posed, "invalid-splits-huge", "split flags of four gigabytes", "SEC-1",
     lambda b: b.edit(DISC_MESH, "splits", lambda v: b"\xff" * 4 + v[4:])),
    (Views, "invalid-few-cells", "a support of two million cells in nine bytes", "SEC-7 SEC-8",
     lambda b: b.set(PLAN, size=[3000, 3000], cell=1, support=stream())),
    (Moving, "invalid-few-coefficients", "4 million coefficients in nine bytes", "SEC-7",
     lambda b: b.set(MOTION, loop=1, intervals=32_000, modes=64, curve_classes=stream(),
                     curve_deltas=b"")),
]

_CIRCLES: list[_Row] = [
    (Posed, "invalid-shared-circle", "two textures that share each other", "SEC-1",
     lambda b: write([replace(c, payload=msgpack.packb([0, {-3: 2, -2: 1}[k]])) if k in (-3, -2)
                      else c for k, c in enumerate(b.chunks, -len(b.chunks))])),
    (Posed, "invalid-shared-far", "a texture that is shared with one that does not exist", "",
     lambda b: b.payload(len(b.chunks) - 2, msgpack.packb([0, 1 << 16]))),
]
# fmt: on

CASES = {
    name: Refused(title[0].upper() + title[1:], tuple(tests.split()), build, base)
    for base, name, title, tests, build in (*_LIMITS, *_STREAMS, *_CIRCLES)
}
