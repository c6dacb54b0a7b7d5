"""Refused files: faults of views of planes, of their masks and cuts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container.chunks import write

from .base import Base, Row, refused
from .pyramids import (
    ALPHA,
    BACK,
    BACK_TEXR,
    DISC,
    DISC_TEXR,
    HEAD,
    PLAN,
    TAIL,
    Clear,
    Views,
    bits,
    different,
    full,
)


def _cuts(b: Base, cuts: list[int], **values: Any) -> bytes:
    """File in which the disc has cuts instead of a mask."""
    return b.set(DISC_TEXR, **{"cell": 0, "mask": b"", "cuts": cuts} | values)


def _back_cuts(b: Base, cuts: list[int]) -> bytes:
    """File in which the back has cuts."""
    return b.set(BACK_TEXR, cuts=cuts)


def _many(b: Base) -> bytes:
    """File of nine layers that each show a raster of 2^24 samples with a mask."""
    side = 1 << 12
    texture = {"part": [0, 0, side, side], "cell": 6, "mask": bits(np.eye(64, dtype=int))}
    return write([
        different(b, HEAD, layers=9, opaque=0),
        *(different(b, DISC, name=name) for name in "abcdefghi"),
        *[different(b, DISC_TEXR, **texture)] * 9,
        different(b, PLAN, size=[side, side], support=b""),
        b.chunks[TAIL],
    ])  # fmt: skip


def _carved(b: Base) -> bytes:
    """File with a layer of 2^24 samples that 129 other layers cut."""
    side, others = 1 << 12, range(1, 130)
    box, part = [0, 0, side, side], {"part": [0, 0, side, side], "cuts": list(others)}
    shared = replace(b.chunks[DISC_TEXR], payload=msgpack.packb([0, 0]))
    return write([
        different(b, HEAD, layers=130),
        different(b, BACK, box=box),
        *(different(b, DISC, name=str(k)) for k in others),
        different(b, BACK_TEXR, **part),
        *[shared for _ in others],
        different(b, PLAN, size=[side, side], support=b""),
        b.chunks[TAIL],
    ])  # fmt: skip


def _carving(b: Base) -> bytes:
    """File with a layer of 2^24 samples that cuts itself, in front of 128 others."""
    side, count = 1 << 12, 129
    shared = replace(b.chunks[DISC_TEXR], payload=msgpack.packb([0, 0]))
    own = {"part": [0, 0, side, side], "cell": 0, "mask": b"", "cuts": [count - 1]}
    return write([
        different(b, HEAD, layers=count),
        b.chunks[BACK],
        *(different(b, DISC, name=str(k), box=[0, 0, side, side]) for k in range(1, count)),
        b.chunks[BACK_TEXR],
        *[shared] * (count - 2),
        different(b, DISC_TEXR, **own),
        different(b, PLAN, size=[side, side], support=b""),
        b.chunks[TAIL],
    ])  # fmt: skip


def _large_mask(b: Base) -> bytes:
    size = [1 << 12, 2049]
    chunks = list(b.chunks)
    chunks[PLAN] = different(b, PLAN, size=size)
    chunks[DISC_TEXR] = different(b, DISC_TEXR, part=[0, 0, *size], cell=0)
    return write(chunks)


# fmt: off
_VIEWS: list[Row] = [
    ("invalid-view-planes", "planes that do not exist", "",
     lambda b: b.set(DISC_TEXR, planes=1)),
    ("invalid-view-alpha", "planes of alpha that do not exist", "",
     lambda b: b.set(DISC_TEXR, alpha=2)),
    ("invalid-view-colour", "planes of alpha in colour", "",
     lambda b: b.set(DISC_TEXR, alpha=1)),
    ("invalid-part-empty", "a part without columns", "",
     lambda b: b.set(DISC_TEXR, part=[4, 3, 0, 12])),
    ("invalid-part-wide", "a part that leaves the raster to the right", "",
     lambda b: b.set(DISC_TEXR, part=[9, 3, 16, 12])),
    ("invalid-part-low", "a part that leaves the raster below", "",
     lambda b: b.set(DISC_TEXR, part=[4, 7, 16, 12])),
    ("invalid-part-items", "a part of three numbers", "",
     lambda b: b.set(DISC_TEXR, part=[4, 7, 16])),
    ("invalid-view-cell", "cells without a mask", "",
     lambda b: b.set(BACK_TEXR, cell=1)),
    ("invalid-view-cell-size", "cells of 128 samples", "", lambda b: b.set(DISC_TEXR, cell=7)),
    ("invalid-view-full", "a mask of all samples", "",
     lambda b: b.set(DISC_TEXR, mask=full(6, 8, 1))),
    ("invalid-view-empty", "a mask of no sample", "",
     lambda b: b.set(DISC_TEXR, mask=full(6, 8, 0))),
    ("invalid-view-mask", "a mask of other cells", "PYR-39",
     lambda b: b.set(DISC_TEXR, cell=2)),
    ("invalid-view-mask-cut", "a mask that ends early", "PYR-39",
     lambda b: b.edit(DISC_TEXR, "mask", lambda v: v[:-1])),
    ("invalid-view-sampling", "a view at the nodes of a mesh", "",
     lambda b: b.set(DISC, sampling=3)),
    ("invalid-view-values", "a view with the coder of an implicit texture", "",
     lambda b: b.set(DISC_TEXR, coder=1)),
    ("invalid-cuts-size", "cuts of a part that is smaller than the box", "",
     lambda b: _cuts(b, [1], part=[4, 3, 15, 12])),
    ("invalid-cuts-behind", "cuts by a layer behind", "", lambda b: _cuts(b, [0])),
    ("invalid-cuts-missing", "cuts by a layer that does not exist", "",
     lambda b: _cuts(b, [1, 2])),
    ("invalid-cuts-twice", "cuts by a layer twice", "", lambda b: _cuts(b, [1, 1])),
    ("invalid-cuts-boundary", "cuts by a layer without boundary", "",
     lambda b: _back_cuts(b, [0, 1])),
]

_LIMITS: list[Row] = [
    ("limit-mask", "a mask of 2^23 cells and some", "",
     _large_mask),
    ("limit-filled", "nine layers of 2^24 samples that have to be filled", "", _many),
    ("limit-covered", "a layer of 2^24 samples that 129 others cut", "", _carved),
    ("limit-covered-behind", "a layer of 2^24 samples that cuts itself, and 128 behind it", "",
     _carving),
]

_CLEAR: list[Row] = [
    ("invalid-alpha-size", "planes of alpha of another size", "",
     lambda b: b.set(ALPHA, size=[12, 11])),
    ("invalid-alpha-channels", "planes of alpha in a picture of three channels", "",
     lambda b: b.set(HEAD, channels=3)),
    ("invalid-alpha-opaque", "opaque with a back layer whose view gives alpha", "",
     lambda b: b.set(HEAD, opaque=1)),
]
# fmt: on

CASES = {**refused((*_VIEWS, *_LIMITS), Views), **refused(_CLEAR, Clear)}
