"""Refused files: faults of planes behind views, and of references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container import plan
from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.model import Picture

from ..builders import SIZE, Numbers, ellipse, layer, picture, values
from ..valid.behind import references
from ..valid.pyramids import coded, view
from .base import Base, Row, refused
from .bombs import stream
from .pyramids import Views, different

HEAD, BACK, DISC, BACK_TEXR, DISC_TEXR, _, _, OWN, SOFT, TAIL = range(10)
"""Positions of the chunks in the base file."""

PART = 4, 3, 16, 12
"""Part of the disc."""


class Behind(Base):
    """Valid file with alpha: the disc has planes behind it, their alpha, and three offsets."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        source, alpha = coded(n, SIZE), coded(n, SIZE, components=1)
        own, soft = coded(n, PART[2:]), coded(n, PART[2:], components=1)
        copies = references(n, 1, size=PART[2:])
        mask = n.integers(0, 1, (6, 8)) > 0
        shown = view(source, alpha=alpha, part=PART, cell=1, mask=mask)
        shown = replace(shown, behind=own, behind_alpha=soft, copies=copies)
        return picture(
            SIZE,
            [
                layer("back", (0, 0, *SIZE), view(source, alpha=alpha)),
                layer("disc", PART, shown, ellipse((12, 9), (7, 5.5))),
            ],
            opaque=False,
        )


def _sources(value: Any, count: int = 1, bits: int = 2) -> bytes:
    """Coded array of the cells of the disc that have a value, but for the first, which is 0."""
    values = np.full((count, 6, 8), value)
    values[:, 0, 0] = 0
    return arrays.encode(values, bits, np.ones((6, 8), bool))


def _alone(b: Base) -> bytes:
    """File in which only the alpha of what is behind is there."""
    chunks = list(b.chunks)
    chunks[DISC_TEXR] = different(b, DISC_TEXR, behind=0, behind_alpha=3)
    return write(chunks[:OWN] + chunks[SOFT:])


def aged(
    version: tuple[int, int], count: int, textures: Sequence[int], own: int, **without: Any
) -> Callable[[Base], bytes]:
    """Builder of a file of a version, without planes that views of earlier ones cannot name.

    Args:
        version: Version of the file.
        count: Number of values that its textures have.
        textures: Positions of the TEXR chunks in the base file.
        own: Position of the first PLAN chunk that is left out; with those behind it.
        without: Values of textures that no longer name them.
    """

    def build(b: Base) -> bytes:
        chunks = list(b.chunks)
        for at in textures:
            kept = list(values(different(b, at, **without)).values())
            chunks[at] = replace(chunks[at], payload=msgpack.packb(kept[:count]))
        if version >= plan.TILED_FROM:
            return write([*chunks[:own], chunks[-1]], version)
        plans = [short(c) for c in chunks[:own] if c.type == plan.TYPE]
        views = [chunks[at] for at in textures]
        return write([*chunks[: textures[0]], *plans, *views, chunks[-1]], version)

    return build


def _versions(version: tuple[int, int], count: int) -> Callable[[Base], bytes]:
    return aged(version, count, (BACK_TEXR, DISC_TEXR), OWN, behind=0, behind_alpha=0)


def short(chunk: Chunk) -> Chunk:
    """PLAN as it was before 0.12."""
    *values, _, _, escapes, stream = msgpack.unpackb(chunk.payload)
    return replace(chunk, payload=msgpack.packb([*values, escapes, stream]))


def _many(b: Base) -> bytes:
    """File of five layers of 2^24 samples, which are copied and filled."""
    side = 1 << 12
    texture = {
        "part": [0, 0, side, side], "cell": 6, "mask": stream(), "grain": 6,
        "offsets": [1, 1], "sources": stream(),
    }  # fmt: skip
    return write([
        different(b, 0, layers=5, opaque=0),
        *(different(b, 2, name=name) for name in "abcde"),
        *[different(b, 4, **texture)] * 5,
        different(b, 5, size=[side, side], support=b""),
        b.chunks[6],
    ])  # fmt: skip


def _large(size: list[int]) -> Callable[[Base], bytes]:
    """Builder of a file with sources for each sample of a raster."""

    def build(b: Base) -> bytes:
        chunks = list(b.chunks)
        chunks[5] = different(b, 5, size=size, support=b"")
        texture = {"part": [0, 0, *size], "cell": 6, "offsets": [1, 1]}
        chunks[4] = different(b, 4, **texture, sources=stream())
        return write(chunks)

    return build


# fmt: off
_BEHIND: list[Row] = [
    ("invalid-behind", "planes behind that do not exist", "",
     lambda b: b.set(DISC_TEXR, behind=5)),
    ("invalid-behind-soft", "planes of alpha behind that do not exist", "",
     lambda b: b.set(DISC_TEXR, behind_alpha=5)),
    ("invalid-behind-unused", "planes behind that no view names", "",
     lambda b: b.set(DISC_TEXR, behind=0, behind_alpha=0)),
    ("invalid-behind-wide", "planes behind that are wider than the part", "",
     lambda b: b.set(OWN, size=[17, 12])),
    ("invalid-behind-high", "planes behind that are higher than the part", "",
     lambda b: b.set(OWN, size=[16, 13])),
    ("invalid-behind-grey", "grey planes behind colour", "",
     lambda b: b.set(OWN, components=1, grey=b.fields(OWN)["levels"], lowest=[30])),
    ("invalid-behind-soft-size", "planes of alpha behind with the size of the raster", "",
     lambda b: b.set(SOFT, size=list(SIZE))),
    ("invalid-behind-soft-colour", "planes of alpha behind in colour", "",
     lambda b: b.set(SOFT, components=3, lowest=[30] * 3)),
    ("invalid-behind-soft-alone", "alpha of planes behind that are not there", "", _alone),
    ("invalid-behind-soft-opaque", "alpha of planes behind in a view without alpha", "",
     lambda b: b.set(DISC_TEXR, alpha=0)),
    ("invalid-copies-sources", "offsets without sources", "",
     lambda b: b.set(DISC_TEXR, sources=b"")),
    ("invalid-copies-offsets", "sources without offsets", "",
     lambda b: b.set(DISC_TEXR, offsets=[])),
    ("invalid-copies-grain", "cells of two samples, without sources", "",
     lambda b: b.set(DISC_TEXR, offsets=[], sources=b"")),
    ("invalid-copies-odd", "offsets of which one is half a pair", "",
     lambda b: b.set(DISC_TEXR, offsets=[1, 2, 3, 4, 5])),
    ("invalid-copies-many", "256 offsets", "",
     lambda b: b.set(DISC_TEXR, offsets=[1] * 512, sources=_sources(1, 2, 4))),
    ("invalid-copies-high", "a source above the number of offsets", "",
     lambda b: b.set(DISC_TEXR, offsets=[1, 2, 3, 4], sources=_sources(3))),
    ("invalid-copies-zero", "sources that are all 0", "",
     lambda b: b.set(DISC_TEXR, sources=_sources(0))),
    ("invalid-copies-cells", "sources of other cells", "PYR-48",
     lambda b: b.set(DISC_TEXR, grain=2)),
    ("invalid-copies-cut", "sources that end early", "PYR-48",
     lambda b: b.edit(DISC_TEXR, "sources", lambda v: v[:-1])),
    ("invalid-copies-bits", "sources of eight bits in one channel", "PYR-48",
     lambda b: b.set(DISC_TEXR, offsets=[3, 2] * 100, sources=_sources(100, 1, 8))),
    ("invalid-copies-unseen", "sources that are all 0 in a view that shows all its samples", "",
     lambda b: b.set(DISC_TEXR, cell=0, mask=b"", sources=_sources(0))),
    ("invalid-few-sources", "sources of a stream that is too low", "PYR-48",
     lambda b: b.set(DISC_TEXR, sources=bytes(9))),
    ("invalid-seven-values", "textures as of version 0.10", "CON-19", _versions((0, 12), 7)),
    ("invalid-twelve-values", "textures as of version 0.11 in a file of version 0.10", "CON-19",
     _versions((0, 10), 12)),
]

_LIMITS: list[Row] = [
    ("invalid-copies-grid", "sources of 2^16 cells and some", "PYR-48", _large([1 << 8, 257])),
    ("limit-filled-copies", "five layers of 2^24 samples that have to be copied and filled", "",
     _many),
]
# fmt: on

CASES = {**refused(_BEHIND, Behind), **refused(_LIMITS, Views)}
