"""Refused files: faults of planes, of their streams, and of views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.model import Picture
from proxyimg_codec.texture import decoding, planes
from proxyimg_codec.texture.latents import Latents

from ..builders import SIZE, Numbers, changed, ellipse, layer, picture
from ..valid.pyramids import coded, view
from .base import Base, Row, put, refused, words

HEAD, BACK, DISC, BACK_TEXR, DISC_TEXR, PLAN, TAIL = range(7)
"""Positions of the chunks in the base file."""

CLEAR_TEXR = (3, 4)
COLOUR, ALPHA = 5, 6
TILED_PLAN = 3
"""Positions of planes and textures in the base file with alpha."""


class Views(Base):
    """Valid file: a back and a disc that show the same planes, which have a support."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
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
    """Valid file with alpha: two layers that show the same planes."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
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


class Tiled(Base):
    """Valid file of one layer whose finest level has two tiles."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        source = coded(n, (138, 6), levels=1, tile=6)
        return picture((138, 6), [layer("back", (0, 0, 138, 6), view(source))])


def _last(data: bytes) -> int:
    """Bytes of the last of the tiles of `Tiled`."""
    _, last = decoding.split(data, decoding.length(data, 0, False), False)
    return 1 + sum(map(len, last))


class Last(Base):
    """Valid file in which only the last latent escapes."""

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        level, lowest = np.zeros((9, 1, 1), np.int32), np.zeros((3, 1, 1), np.int32)
        level[8] = 65535
        # The shift ensures that no model takes the latent as certain.
        source = planes.encoded(Latents((level,), lowest), (2, 2), 256, shifts=(0, 7))
        return picture((2, 2), [layer("back", (0, 0, 2, 2), view(source))])


def bits(values: Any) -> bytes:
    """Coded array of 1-bit values [rows, columns]."""
    array = np.array(values)
    return arrays.encode(array[None], 1, np.ones(array.shape, bool))


def full(rows: int, columns: int, value: int) -> bytes:
    """Coded array of 1-bit values that are all equal."""
    return bits(np.full((rows, columns), value))


def _data(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Builder of a file with a changed stream of the planes."""
    return lambda b: b.edit(TILED_PLAN if isinstance(b, Tiled) else PLAN, "data", change)


def _words(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Builder of a file with changed words in the stream of the planes."""
    return _data(lambda v: words(v, change))


def _escapes(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Builder of a file with changed escapes of the planes."""
    return lambda b: b.edit(PLAN, "escapes", change)


def _unused(b: Base) -> bytes:
    return b.order(HEAD, BACK, DISC, BACK_TEXR, DISC_TEXR, PLAN, PLAN, TAIL)


def different(b: Base, at: int, **values: Any) -> Chunk:
    """Chunk `at` with other values."""
    return changed(b.chunks[at], values)


def _between(b: Base) -> bytes:
    """File with planes between others that no texture names."""
    back, disc = CLEAR_TEXR
    return write([
        *b.chunks[:back], different(b, back, alpha=3), b.chunks[disc],
        b.chunks[COLOUR], b.chunks[COLOUR], b.chunks[ALPHA], b.chunks[-1],
    ])  # fmt: skip


# fmt: off
_PLANES: list[Row] = [
    ("invalid-plan-order", "planes before the textures", "",
     lambda b: b.order(HEAD, BACK, DISC, PLAN, BACK_TEXR, DISC_TEXR, TAIL)),
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
    ("invalid-plan-tile", "tiles of 2^5 positions", "", lambda b: b.set(PLAN, tile=5)),
    ("invalid-plan-details", "what one of two levels adds", "",
     lambda b: b.set(PLAN, details=[3])),
    ("unsupported-model", "a model of the future", "NUM-2", lambda b: b.set(PLAN, model=77)),
    ("unsupported-model-0", "model 0", "NUM-2", lambda b: b.set(PLAN, model=0)),
    ("invalid-support-full", "a support that is everywhere", "",
     lambda b: b.set(PLAN, support=full(3, 3, 1))),
    ("invalid-support-empty", "a support that is nowhere", "",
     lambda b: b.set(PLAN, support=full(3, 3, 0))),
    ("invalid-support-cut", "a support of fewer cells", "PYR-5",
     lambda b: b.set(PLAN, support=bits([[0, 1, 1]]))),
    ("invalid-support-long", "a byte after the support", "PYR-5",
     lambda b: b.edit(PLAN, "support", lambda v: v + b"\0")),
    ("invalid-support-other", "the support of other latents", "PYR-6",
     lambda b: b.set(PLAN, support=bits([[1, 1, 1], [1, 1, 1], [1, 1, 0]]))),
    ("limit-samples", "a raster of 2^27 samples", "SEC-8",
     lambda b: b.set(PLAN, size=[1 << 14, 1 << 13])),
    ("limit-raster", "a raster of 44,000 rows", "SEC-8",
     lambda b: b.set(PLAN, size=[1, 44_000])),
]

_STREAMS: list[Row] = [
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

_TILES: list[Row] = [
    ("invalid-tile-missing", "a tile too few", "", _data(lambda v: v[:-_last(v)])),
    ("invalid-tile-more", "a tile too many", "", _data(lambda v: v + v[-_last(v):])),
    ("invalid-tile-cut", "the last tile ends in its words", "PYR-54", _data(lambda v: v[:-2])),
    ("invalid-tile-end", "a byte after the last tile", "PYR-54", _data(lambda v: v + b"\0")),
    ("invalid-tile-open", "a number of escapes without an end", "",
     _data(lambda v: v + b"\xff" * 5)),
    ("invalid-tile-escapes", "a tile with an escape that it does not have", "",
     _data(lambda v: v[:-_last(v)] + b"\1\0" + v[1 - _last(v):])),
    ("invalid-tile-word", "a bit of the last word of a tile flipped", "PYR-54",
     _data(lambda v: put(v, -1, lambda x: x ^ 1))),
    ("invalid-tile-none", "one stream where there have to be tiles", "",
     lambda b: b.set(TILED_PLAN, tile=0)),
]

_ORDER: list[Row] = [
    ("invalid-plan-use", "planes between others that no texture names", "", _between),
]

_LAST: list[Row] = [
    ("invalid-latent-high", "a latent above 2^16, after which nothing comes", "",
     lambda b: b.set(3, escapes=b"\xc0\x80\x08")),
]
# fmt: on
# fmt: on

CASES = {
    **refused((*_PLANES, *_STREAMS), Views),
    **refused(_TILES, Tiled),
    **refused(_ORDER, Clear),
    **refused(_LAST, Last),
}
