"""Files that must be refused: faults of planes, of their streams, and of views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.model import Picture
from proxyimg_codec.texture import planes
from proxyimg_codec.texture.planes import Latents

from .builders import SIZE, Numbers, changed, ellipse, layer, picture
from .invalid import Base, Invalid, put, words
from .pyramids import coded, view

HEAD, BACK, DISC, PLAN, BACK_TEXR, DISC_TEXR, TAIL = range(7)
"""Positions of the chunks in the base file."""

COLOUR, ALPHA = 3, 4
CLEAR_TEXR = (5, 6)
"""Positions of planes and textures in the base file with alpha."""


class Views(Base):
    """A valid file: a back and a disc that show the same planes, which have a support."""

    def build(self, n: Numbers) -> Picture:
        """The picture."""
        cells = np.array([[1, 0, 1], [1, 1, 1], [0, 1, 1]], bool)
        source = coded(n, SIZE, cells=cells, large=(90, -300))
        mask = n.integers(0, 1, (6, 8)) > 0
        return picture(
            SIZE,
            [
                layer("back", (0, 0, *SIZE), view(source)),
                layer("disc", (4, 3, 16, 12), view(source, part=(4, 3, 16, 12), cell=1, mask=mask),
                      ellipse((12, 9), (7, 5.5))),
            ],
        )  # fmt: skip


class Clear(Base):
    """A valid file with alpha: two layers that show the same planes."""

    def build(self, n: Numbers) -> Picture:
        """The picture."""
        source, alpha = coded(n, (12, 10)), coded(n, (12, 10), components=1)
        box = 0, 0, 12, 10
        return picture(
            (12, 10),
            [
                layer("back", box, view(source, alpha=alpha)),
                layer("disc", box, view(source), ellipse((6, 5), (4, 4))),
            ],
            opaque=False,
        )


class Last(Base):
    """A valid file whose last latent, and no other, escapes."""

    def build(self, n: Numbers) -> Picture:
        """The picture."""
        level, lowest = np.zeros((9, 1, 1), np.int32), np.zeros((3, 1, 1), np.int32)
        level[8] = 65535
        # The shift sees to it that no model takes the latent for certain.
        source = planes.encoded(Latents((level,), lowest), (2, 2), 256, shifts=(0, 7))
        return picture((2, 2), [layer("back", (0, 0, 2, 2), view(source))])


def _bits(values: Any) -> bytes:
    """A coded array of 1 bit."""
    array = np.array(values)
    return arrays.encode(array[None], 1, np.ones(array.shape, bool))


def _full(rows: int, columns: int, value: int) -> bytes:
    return _bits(np.full((rows, columns), value))


def _data(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Planes with another stream."""
    return lambda b: b.edit(PLAN, "data", change)


def _words(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Planes with other words in their stream."""
    return _data(lambda v: words(v, change))


def _escapes(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    return lambda b: b.edit(PLAN, "escapes", change)


def _cuts(b: Base, cuts: list[int], **values: Any) -> bytes:
    """The disc with cuts instead of a mask."""
    return b.set(DISC_TEXR, **{"cell": 0, "mask": b"", "cuts": cuts} | values)


def _back_cuts(b: Base, cuts: list[int]) -> bytes:
    return b.set(BACK_TEXR, cuts=cuts)


def _unused(b: Base) -> bytes:
    return b.order(HEAD, BACK, DISC, PLAN, PLAN, BACK_TEXR, DISC_TEXR, TAIL)


def _swapped(b: Base) -> bytes:
    """The planes in the other order, which is not that of their first use."""
    back, disc = CLEAR_TEXR
    return write([
        *b.chunks[:COLOUR], b.chunks[ALPHA], b.chunks[COLOUR],
        _changed(b, back, planes=1, alpha=1), _changed(b, disc, planes=1), b.chunks[-1],
    ])  # fmt: skip


def _many(b: Base) -> bytes:
    """Nine layers that each show a raster of 2^24 samples with a mask."""
    side = 1 << 12
    texture = {"part": [0, 0, side, side], "cell": 6, "mask": _bits(np.eye(64, dtype=int))}
    return write([
        _changed(b, HEAD, layers=9, opaque=0),
        *(_changed(b, DISC, name=name) for name in "abcdefghi"),
        _changed(b, PLAN, size=[side, side], support=b""),
        *[_changed(b, DISC_TEXR, **texture)] * 9,
        b.chunks[TAIL],
    ])  # fmt: skip


def _carved(b: Base) -> bytes:
    """A layer of 2^24 samples that 129 others cut."""
    side, others = 1 << 12, range(1, 130)
    box, part = [0, 0, side, side], {"part": [0, 0, side, side], "cuts": list(others)}
    shared = replace(b.chunks[DISC_TEXR], payload=msgpack.packb([0, 0]))
    return write([
        _changed(b, HEAD, layers=130),
        _changed(b, BACK, box=box),
        *(_changed(b, DISC, name=str(k)) for k in others),
        _changed(b, PLAN, size=[side, side], support=b""),
        _changed(b, BACK_TEXR, **part),
        *[shared for _ in others],
        b.chunks[TAIL],
    ])  # fmt: skip


def _carving(b: Base) -> bytes:
    """A layer of 2^24 samples that cuts itself, in front of 128 others."""
    side, count = 1 << 12, 129
    shared = replace(b.chunks[DISC_TEXR], payload=msgpack.packb([0, 0]))
    own = {"part": [0, 0, side, side], "cell": 0, "mask": b"", "cuts": [count - 1]}
    return write([
        _changed(b, HEAD, layers=count),
        b.chunks[BACK],
        *(_changed(b, DISC, name=str(k), box=[0, 0, side, side]) for k in range(1, count)),
        _changed(b, PLAN, size=[side, side], support=b""),
        b.chunks[BACK_TEXR],
        *[shared] * (count - 2),
        _changed(b, DISC_TEXR, **own),
        b.chunks[TAIL],
    ])  # fmt: skip


def _large_mask(b: Base) -> bytes:
    size = [1 << 12, 2049]
    chunks = list(b.chunks)
    chunks[PLAN] = _changed(b, PLAN, size=size)
    chunks[DISC_TEXR] = _changed(b, DISC_TEXR, part=[0, 0, *size], cell=0)
    return write(chunks)


def _changed(b: Base, at: int, **values: Any) -> Chunk:
    """Chunk `at` with other values."""
    return changed(b.chunks[at], values)


_Row = tuple[str, str, str, Callable[[Base], bytes]]

# fmt: off
_PLANES: list[_Row] = [
    ("invalid-plan-order", "planes after the textures", "",
     lambda b: b.order(HEAD, BACK, DISC, BACK_TEXR, DISC_TEXR, PLAN, TAIL)),
    ("invalid-plan-early", "planes before the layers", "",
     lambda b: b.order(HEAD, PLAN, BACK, DISC, BACK_TEXR, DISC_TEXR, TAIL)),
    ("invalid-plan-missing", "textures of planes that do not exist", "",
     lambda b: b.order(HEAD, BACK, DISC, BACK_TEXR, DISC_TEXR, TAIL)),
    ("invalid-plan-unused", "planes that no texture shows", "", _unused),
    ("invalid-plan-components", "two components", "",
     lambda b: b.set(PLAN, components=2, lowest=[30, 30])),
    ("invalid-plan-lowest", "a scale of the lowest planes too few", "",
     lambda b: b.set(PLAN, lowest=[30, 30])),
    ("invalid-plan-shifts", "a shift too many", "",
     lambda b: b.set(PLAN, shifts=[8] * 5)),
    ("invalid-plan-grey", "more levels without chroma than levels", "",
     lambda b: b.set(PLAN, grey=3)),
    ("invalid-plan-chroma", "one component, and levels with chroma", "",
     lambda b: b.set(PLAN, components=1, lowest=[30])),
    ("invalid-plan-size", "a raster without rows", "", lambda b: b.set(PLAN, size=[24, 0])),
    ("invalid-plan-levels", "no levels", "", lambda b: b.set(PLAN, levels=0, shifts=[])),
    ("invalid-plan-step", "a step of 2^10 and a bit", "", lambda b: b.set(PLAN, step=641)),
    ("invalid-plan-scale", "a scale of 64", "", lambda b: b.set(PLAN, lowest=[64, 30, 30])),
    ("invalid-plan-shift", "a shift of 8", "", lambda b: b.set(PLAN, shifts=[8, 8, 8, 16])),
    ("invalid-plan-cell", "cells of one sample", "", lambda b: b.set(PLAN, cell=0)),
    ("unsupported-model", "a model of the future", "NUM-2", lambda b: b.set(PLAN, model=77)),
    ("unsupported-model-0", "model 0", "NUM-2", lambda b: b.set(PLAN, model=0)),
    ("invalid-support-full", "a support that is everywhere", "",
     lambda b: b.set(PLAN, support=_full(3, 3, 1))),
    ("invalid-support-empty", "a support that is nowhere", "",
     lambda b: b.set(PLAN, support=_full(3, 3, 0))),
    ("invalid-support-cut", "a support of fewer cells", "PYR-5",
     lambda b: b.set(PLAN, support=_bits([[0, 1, 1]]))),
    ("invalid-support-long", "a byte after the support", "PYR-5",
     lambda b: b.edit(PLAN, "support", lambda v: v + b"\0")),
    ("invalid-support-other", "the support of other latents", "PYR-6",
     lambda b: b.set(PLAN, support=_bits([[1, 1, 1], [1, 1, 1], [1, 1, 0]]))),
    ("limit-samples", "a raster of 2^27 samples", "SEC-8",
     lambda b: b.set(PLAN, size=[1 << 14, 1 << 13])),
    ("limit-raster", "a raster of 44,000 rows", "SEC-8",
     lambda b: b.set(PLAN, size=[1, 44_000])),
    ("limit-mask", "a mask of 2^23 cells and some", "",
     _large_mask),
    ("limit-filled", "nine layers of 2^24 samples that have to be filled", "", _many),
    ("limit-covered", "a layer of 2^24 samples that 129 others cut", "", _carved),
    ("limit-covered-behind", "a layer of 2^24 samples that cuts itself, and 128 behind it", "",
     _carving),
]

_STREAMS: list[_Row] = [
    ("invalid-latents-empty", "no bytes of latents", "",
     lambda b: b.set(PLAN, data=b"")),
    ("invalid-latents-lanes", "2,048 lanes", "SEC-7", _data(lambda v: b"\x0b" + v[1:])),
    ("invalid-latents-cut-head", "latents end in the states", "",
     _data(lambda v: v[:4])),
    ("invalid-latents-cut", "latents end in the words", "SEC-7",
     _data(lambda v: v[:len(v) // 2])),
    ("invalid-latents-short-lowest", "the words end in the lowest planes", "",
     _words(lambda w: w[:20])),
    ("invalid-latents-short-middle", "the words end in the first level", "",
     _words(lambda w: w[:len(w) // 4 * 2])),
    ("invalid-latents-short", "a word too few", "", _words(lambda w: w[:-2])),
    ("invalid-latents-long", "a word left over", "", _words(lambda w: w + b"\0\0")),
    ("invalid-latents-end", "a byte after the latents", "",
     _data(lambda v: v + b"\0")),
    ("invalid-latents-state", "a bit of a state flipped", "",
     _data(lambda v: put(v, 2, lambda x: x ^ 16))),
    ("invalid-latents-low-state", "a state that is too low", "PYR-8",
     _data(lambda v: v[:3] + b"\0\0" + v[5:])),
    ("invalid-latents-word", "a bit of the last word flipped", "PYR-8",
     _words(lambda w: put(w, -1, lambda x: x ^ 1))),
    ("invalid-latents-step", "latents of another step", "PYR-21",
     lambda b: b.set(PLAN, step=0)),
    ("invalid-escapes-none", "no escapes", "", lambda b: b.set(PLAN, escapes=b"")),
    ("invalid-escapes-cut", "the escapes end early", "",
     _escapes(lambda v: v[:-1])),
    ("invalid-escapes-long", "an escape left over", "",
     _escapes(lambda v: v + b"\x01")),
    ("invalid-escapes-open", "the last escape goes on", "",
     _escapes(lambda v: put(v, -1, lambda x: x | 128))),
    ("invalid-escapes-five", "an escape of five bytes", "",
     _escapes(lambda v: b"\x80\x80\x80\x80\x00" + v)),
    ("invalid-latent-huge", "a latent of nearly 2^27", "",
     _escapes(lambda v: b"\xfe\xff\xff\x7f" * len(v))),
    ("invalid-latent-low", "a latent of -2^26", "",
     _escapes(lambda v: b"\xff\xff\xff\x3f" * len(v))),
]

_VIEWS: list[_Row] = [
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
     lambda b: b.set(DISC_TEXR, mask=_full(6, 8, 1))),
    ("invalid-view-empty", "a mask of no sample", "",
     lambda b: b.set(DISC_TEXR, mask=_full(6, 8, 0))),
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

_CLEAR: list[_Row] = [
    ("invalid-plan-use", "planes not in the order of their first use", "", _swapped),
    ("invalid-alpha-size", "planes of alpha of another size", "",
     lambda b: b.set(ALPHA, size=[12, 11])),
    ("invalid-alpha-channels", "planes of alpha in a picture of three channels", "",
     lambda b: b.set(HEAD, channels=3)),
    ("invalid-alpha-opaque", "opaque with a back layer whose view gives alpha", "",
     lambda b: b.set(HEAD, opaque=1)),
]
_LAST: list[_Row] = [
    ("invalid-latent-high", "a latent above 2^16, after which nothing comes", "",
     lambda b: b.set(2, escapes=b"\xc0\x80\x08")),
]
# fmt: on

CASES = {
    name: Invalid(title[0].upper() + title[1:], tuple(tests.split()), build, base)
    for base, rows in ((Views, (*_PLANES, *_STREAMS, *_VIEWS)), (Clear, _CLEAR), (Last, _LAST))
    for name, title, tests, build in rows
}
