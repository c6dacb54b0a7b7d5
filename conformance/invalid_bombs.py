"""Files that must be refused: a few bytes that ask for as much as can be asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container.chunks import write
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.image import Image

from .builders import Numbers, changed, ellipse, grid_mesh, layer, network, picture, texture
from .invalid import BACK, BACK_TEXR, DISC, DISC_TEXR, HEAD, NETW, Base, Invalid
from .invalid_motion import MOTION, Moving
from .invalid_posed import COPY_MESH, DISC_MESH, Posed
from .invalid_pyramids import PLAN, Views


def stream(words: int = 0) -> bytes:
    """A coded array that goes on for as long as it may: symbols soon cost next to nothing."""
    return b"\0" + (1 << 16).to_bytes(4, "little") + words.to_bytes(4, "little") + bytes(2 * words)


class Fine(Base):
    """A valid file: a layer that is bent by a mesh of many faces, most of them beside it."""

    def build(self, n: Numbers) -> Image:
        """The picture."""
        split = [range(count) for count in (1054, 4216)]
        mesh = grid_mesh((0, 0), 31, 17, step=(64, 64), cell=8, split=split)
        nodes = np.zeros_like(mesh.refined.nodes)
        nodes[0] = 16, -16
        wide = layer("wide", (0, 0, 9, 9), texture(n), ellipse((100, 90), (98, 88)), mesh=mesh,
                     pose=Pose(nodes=nodes))  # fmt: skip
        return picture((9, 8), [layer("back", (0, 0, 9, 8), texture(n)), wide], network(n))


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
    (Base, "limit-codes-together", "two planes of 20 million codes each", "SEC-5",
     lambda b: _several(b, *((at, {"grid": [2600, 2600]}) for at in (BACK_TEXR, DISC_TEXR)))),
    (Base, "limit-wavefronts", "a plane of a million rows", "SEC-5",
     lambda b: b.set(BACK_TEXR, grid=[2, 1 << 20])),
    (Base, "limit-segments-together", "two layers of 40,000 segments each", "SEC-5",
     lambda b: _several(b, (HEAD, {"opaque": 0}),
                        *((at, {"segments": [40_000]}) for at in (BACK, DISC)))),
    (Base, "limit-parameters-wide", "the widest and deepest network", "SEC-5",
     lambda b: b.set(NETW, dim=64, octaves=12, hidden=1024, depth=8)),
    (Posed, "limit-gates-together", "two meshes of 40,000 gates each", "SEC-5",
     lambda b: _several(b, *((at, {"gates": 40_000}) for at in (DISC_MESH, COPY_MESH)))),
    (Fine, "limit-beyond", "27,000 points that no face holds, and 17,000 faces", "SEC-11",
     lambda b: b.set(HEAD, size=[200, 180])),
    (Views, "limit-samples-levels", "a raster of one row, rounded up to 2^27 samples", "SEC-8",
     lambda b: b.set(PLAN, size=[1 << 19, 1], levels=8, shifts=[8] * 16, grey=0)),
    (Moving, "limit-motion-numbers", "64 curves of 65,520 coefficients each", "SEC-5",
     lambda b: b.set(MOTION, loop=1, intervals=32_760, modes=64)),
    (Moving, "limit-motion-size", "a script of two gigabytes announced", "SEC-6",
     lambda b: b.set(MOTION, size=(1 << 31) - 1, script=b"a")),
]

_STREAMS: list[_Row] = [
    (Base, "invalid-few-codes", "10 million codes in nine bytes", "SEC-7",
     lambda b: b.set(BACK_TEXR, grid=[1800, 1800], bits=4, codes=stream())),
    (Base, "invalid-few-stored", "a mask of 3 million codes in nine bytes", "SEC-7",
     lambda b: b.set(DISC_TEXR, grid=[1800, 1800], stored=stream())),
    (Base, "invalid-few-classes", "65,000 segments in nine bytes", "SEC-7",
     lambda b: b.set(DISC, segments=[65_000], classes=stream(), deltas=b"")),
    (Posed, "invalid-few-symbols", "60,000 gates in nine bytes", "SEC-7",
     lambda b: b.set(DISC_MESH, gates=60_000, symbols=stream())),
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
    name: Invalid(title[0].upper() + title[1:], tuple(tests.split()), build, base)
    for base, name, title, tests, build in (*_LIMITS, *_STREAMS, *_CIRCLES)
}
