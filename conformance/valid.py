"""The valid cases: hand-made pictures that need one thing each of a decoder."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from unittest import mock

import numpy as np

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container.chunks import Chunk, read, write
from proxyimg_codec.container.fields import pack
from proxyimg_codec.container.meta import BLOCKS, FIELDS
from proxyimg_codec.entropy import arrays, rans
from proxyimg_codec.model import Picture

from .builders import (
    Numbers,
    ellipse,
    layer,
    layered,
    network,
    picture,
    polygon,
    texture,
)  # fmt: skip
from .registry import WHOLE, Build, Valid, Valids

CASES = Valids()
_case = CASES.case


@_case("One opaque layer without boundary", "file", "entropy", "coverage: none",
       "texture: bilinear", "network", "render: whole", "MET-1")  # fmt: skip
def _one_layer(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 24, 20), texture(n, grid=(6, 5)))
    return picture((24, 20), [back], network(n, octaves=2, depth=2))


@_case("Three layers that overlap", "compositing: order", "boundary: coding", "coverage: edges",
       "coverage: curves")  # fmt: skip
def _layers(n: Numbers) -> Picture:
    return layered(n)


@_case("A ring: the inner path runs the other way", "coverage: hole", "coverage: nonzero")
def _hole(n: Numbers) -> Picture:
    outer = ellipse((16, 12), (13, 10.5))
    inner = ellipse((17.5, 12), (6.25, 5), reverse=True)
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("ring", (2, 1, 28, 22), texture(n), outer, inner)],
                   network(n))  # fmt: skip


@_case("Paths that overlap and run the same way, and one that runs the other way around nothing",
       "coverage: nonzero", "coverage: clamping")  # fmt: skip
def _winding(n: Numbers) -> Picture:
    paths = (
        polygon((2, 2), (20, 2), (20, 15), (2, 15)),
        polygon((10, 8), (28, 8), (28, 21), (10, 21)),
        polygon((24, 1), (30, 1), (30, 5.5), (24, 5.5), reverse=True),
    )
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("boxes", (0, 0, 32, 24), texture(n), *paths)],
                   network(n))  # fmt: skip


@_case("A layer of two components", "coverage: components")
def _components(n: Numbers) -> Picture:
    paths = ellipse((7, 8), (5, 6)), polygon((18, 3), (29, 9), (20, 21), (15, 13))
    back = layer("back", (0, 0, 32, 24), texture(n))
    return picture((32, 24), [back, layer("two", (1, 2, 29, 20), texture(n), *paths)], network(n))


@_case("Paths that lie on the border of the canvas, and one that leaves it on every side",
       "coverage: border", "coverage: outside the canvas")  # fmt: skip
def _border(n: Numbers) -> Picture:
    w, h = 28, 20
    frame = polygon((0, 0), (w, 0), (w, h), (0, h)), ellipse((14, 10), (9, 7), reverse=True)
    cross = ellipse((0, 3), (6, 8)), ellipse((30, 19.5), (9, 7)), polygon((9, -9), (12, 9), (8, 33))
    return picture(
        (w, h),
        [
            layer("back", (0, 0, w, h), texture(n)),
            layer("frame", (0, 0, w, h), texture(n), *frame),
            layer("cross", (-6, -9, 45, 42), texture(n, grid=(7, 7)), *cross),
        ],
        network(n),
    )


@_case("Deltas of 15 bits and more, in units of 1/64 pixel", "boundary: escape", "boundary: unit")
def _escape(n: Numbers) -> Picture:
    far = polygon((-900, 8), (2000.5, -700), (12, 14), (1500, 900.25), unit=6)
    back = layer("back", (0, 0, 32, 24), texture(n))
    shape = layer("far", (0, 0, 32, 24), texture(n), far, unit=6)
    return picture((32, 24), [back, shape], network(n))


@_case("A box smaller than the layer: beyond it the rim goes on", "texture: rim", "boundary: unit")
def _rim(n: Numbers) -> Picture:
    disc = layer("disc", (12, 9, 7, 5), texture(n), ellipse((15, 11), (14, 10), unit=0), unit=0)
    return picture((32, 24), [layer("back", (5, -4, 40, 20), texture(n)), disc], network(n))


@_case("Four outputs: layers with alpha that overlap", "alpha", "compositing: alpha",
       renders=[WHOLE, {"background": False}, {"width": 13}])  # fmt: skip
def _alpha(n: Numbers) -> Picture:
    return layered(n, channels=4)


@_case("Three outputs and no opaque back layer", "alpha: from coverage alone",
       renders=[WHOLE, {"background": False}])  # fmt: skip
def _no_back(n: Numbers) -> Picture:
    image = layered(n)
    return replace(image, opaque=False, layers=type(image.layers)(image.layers[1:]))


@_case("Few codes stored, the others filled; steps so large that the fill's rounding shows",
       "texture: mask", "texture: diffusion", "entropy: masks")  # fmt: skip
def _diffusion(n: Numbers) -> Picture:
    sparse = n.integers(0, 5, (9, 13)) == 0
    few, one = np.zeros((14, 18), bool), np.zeros((7, 6), bool)
    few[(4, 4, 5, 6, 9), (4, 5, 4, 5, 9)] = one[4, 1] = True
    planes = [texture(n, grid=s.shape[::-1], bits=2, stored=s, reach=2) for s in (sparse, few, one)]
    return picture(
        (32, 24),
        [
            layer("back", (0, 0, 32, 24), planes[0]),
            layer("few codes", (6, 5, 26, 19), planes[1], ellipse((20, 15), (11, 8))),
            layer("one code", (2, 2, 12, 9), planes[2], ellipse((8, 7), (5, 4))),
        ],
        network(n, octaves=4),
    )


def _bits(bits: int) -> Build:
    def build(n: Numbers) -> Picture:
        back = layer("back", (0, 0, 14, 12), texture(n, grid=(7, 5), bits=bits))
        return picture((14, 12), [back], network(n, bits=bits))

    return build


for _b in range(2, 9):
    CASES[f"bits-{_b}"] = Valid(
        f"Codes and weights of {_b} bits", (f"codes: {_b} bits", f"weights: {_b} bits"),
        _bits(_b), [WHOLE],
    )  # fmt: skip


@_case("A large plane of mostly equal codes", "entropy: halving of counts", "entropy: lanes")
def _adaptation(n: Numbers) -> Picture:
    plane = texture(n, grid=(48, 40), bits=2)
    rare = n.integers(0, 15, plane.codes.shape) == 0
    plane = replace(plane, codes=np.where(rare, plane.codes, np.int8(-1)))
    return picture((32, 24), [layer("back", (0, 0, 32, 24), plane)], network(n))


@_case("Streams of 32 lanes: groups with more and with fewer symbols", "entropy: lanes", "entropy")
def _lanes(n: Numbers) -> bytes:
    back = layer("back", (0, 0, 16, 12), texture(n, dim=24, grid=(4, 3)))
    made = picture((16, 12), [back], network(n, dim=24, octaves=0))
    with mock.patch.object(arrays, "Encoder", partial(rans.Encoder, 5)):
        return to_bytes(made)


@_case("Layers with networks of different sizes", "networks: several", "network: depth and width")
def _networks(n: Numbers) -> Picture:
    sizes = [
        {"dim": 3, "octaves": 1, "hidden": 6, "depth": 1},
        {"dim": 1, "octaves": 2, "hidden": 3, "depth": 8},
        {"dim": 5, "octaves": 0, "hidden": 1, "depth": 2},
    ]
    planes = [texture(n, dim=s["dim"], network=i) for i, s in enumerate(sizes)]
    return picture(
        (24, 20),
        [
            layer("back", (0, 0, 24, 20), planes[2]),
            layer("disc", (1, 2, 14, 14), planes[0], ellipse((8, 9), (6, 6))),
            layer("box", (10, 6, 12, 12), planes[1], polygon((11, 8), (21, 8), (21, 17), (11, 17))),
        ],
        *[network(n, bits=4, **s) for s in sizes],
    )


@_case("No frequency encoding", "network: octaves")
def _octaves_0(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 16, 12), texture(n, reach=1.5))
    return picture((16, 12), [back], network(n, octaves=0))


@_case("Seven octaves, and features far beyond one turn", "network: octaves")
def _octaves_7(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 16, 12), texture(n, dim=2, grid=(3, 2), reach=3.0))
    return picture((16, 12), [back], network(n, dim=2, octaves=7, hidden=8))


@_case("Unknown ancillary chunks in every place", "chunks: ancillary")
def _ancillary(n: Numbers) -> bytes:
    out = []
    for i, chunk in enumerate(read(to_bytes(layered(n)))):
        out += [Chunk(("teSt", "prIv", "zzZZ")[i % 3], bytes(range(i)))] if i else []
        out.append(chunk)
    return write(out)


@_case("ICC, EXIF, XMP and a note of the encoder", "chunks: metadata")
def _metadata(n: Numbers) -> bytes:
    image = picture((8, 8), [layer("back", (0, 0, 8, 8), texture(n))], network(n))
    info = {"encoder": "conformance", "settings": '{"a": 1}', "areas": [64]}
    chunks = read(to_bytes(replace(image, info=info)))
    blocks = {"icc": bytes(132), "exif": b"II*\0\x08\0\0\0\0\0\0\0", "xmp": b"<x:xmpmeta/>"}
    return write([*chunks[:-2], *(_block(k, v) for k, v in blocks.items()), *chunks[-2:]])


def _block(name: str, data: bytes) -> Chunk:
    """A metadata chunk whose zstd frame is one raw block, so that no library's version matters."""
    head = (len(data) << 3 | 1).to_bytes(3, "little")
    frame = b"\x28\xb5\x2f\xfd\x20" + bytes([len(data)]) + head + data
    return Chunk(BLOCKS[name], pack(FIELDS, {"size": len(data), "zstd": frame}))
