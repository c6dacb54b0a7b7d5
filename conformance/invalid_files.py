"""More files that must be refused: polyglots, ranges that overlap, numbers that are none."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from proxyimg_codec.container.chunks import Chunk, write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.geometry import boundary
from proxyimg_codec.geometry.boundary import Boundary

from .invalid import (
    BACK,
    BACK_TEXR,
    DISC,
    DISC_TEXR,
    HEAD,
    INFINITY,
    NETW,
    TAIL,
    Base,
    Invalid,
    put,
)  # fmt: skip

ZIP = b"PK\x05\x06" + bytes(18)
"""An empty ZIP archive."""
PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
PAGE = b"<html><script>alert(1)</script>"
QUIET = b"\x01\x7e"
"""A float16 that is no number, with a bit more; its sign and lower bits do not matter."""


def _halves(at: int, key: str, first: bytes) -> Callable[[Base], bytes]:
    """Other first halves in a field."""
    return lambda b: b.edit(at, key, lambda v: first + v[len(first) :])


def _joined(b: Base) -> bytes:
    """LAYR takes in the chunk behind it, framing and all, with the right CRC."""
    chunks = list(b.chunks)
    after = write([chunks[DISC]])[12:]
    chunks[BACK] = replace(chunks[BACK], payload=chunks[BACK].payload + after)
    return write([*chunks[:DISC], *chunks[DISC + 1 :]])


def _short(b: Base) -> bytes:
    """The length of LAYR ends within its payload: its CRC would be that of other bytes."""
    return put(b.data, b.chunks[BACK].offset + 4, lambda v: v - 2)  # type: ignore[operator]  # it was read


def _inner(change: Callable[[int], int]) -> Callable[[Base], bytes]:
    """Weights whose first length is another."""

    def edit(weights: bytes) -> bytes:
        return change(int.from_bytes(weights[:4], "little")).to_bytes(4, "little") + weights[4:]

    return lambda b: b.edit(NETW, "weights", edit)


def _swallow(weights: bytes) -> bytes:
    """The first array of weights takes in the second."""
    return (len(weights) - 4).to_bytes(4, "little") + weights[4:]


def _shape(*points: tuple[int, int], unit: int = 0) -> dict[str, Any]:
    """Fields of a boundary of one path, whose three points a segment are given."""
    return boundary.encode(Boundary(unit, (np.array(points, np.int64),)))


def _wide_class(b: Base) -> bytes:
    """Deltas of which one has class 15, and the magnitude 5."""
    classes = np.zeros((6, 1, 1), np.int64)
    classes[0] = 15
    coded = arrays.encode(classes, 4, np.ones((1, 1), bool))
    return b.set(DISC, segments=[1], classes=coded, deltas=struct.pack(">I", 5))


def _private(type_: str) -> Callable[[Base], bytes]:
    return lambda b: b.insert(NETW, type_)


def _ancillary(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """The framing of an unknown ancillary chunk changed."""

    def build(b: Base) -> bytes:
        chunk = write([Chunk("teSt", b"abc")])[12:]
        at = b.end(BACK)
        return b.data[:at] + change(chunk) + b.data[at:]

    return build


_Row = tuple[str, str, str, Callable[[Base], bytes]]

# fmt: off
_POLYGLOTS: list[_Row] = [
    ("invalid-zip-after", "a ZIP archive after TAIL", "REG-3", lambda b: b.data + ZIP),
    ("invalid-zip-before", "a ZIP archive before the signature", "REG-3", lambda b: ZIP + b.data),
    ("invalid-html-after", "a page after TAIL", "", lambda b: b.data + PAGE),
    ("invalid-html-before", "a page before the signature", "", lambda b: PAGE + b.data),
    ("invalid-png-before", "the beginning of a PNG file before the signature", "",
     lambda b: PNG + b.data),
    ("invalid-blank-before", "a byte order mark before the signature", "",
     lambda b: b"\xef\xbb\xbf" + b.data),
    ("invalid-file-twice", "a file after a file", "", lambda b: b.data + b.data),
]

_FRAMING: list[_Row] = [
    ("invalid-ancillary-first", "an ancillary chunk before HEAD", "CON-12",
     lambda b: b.insert(HEAD, "teSt")),
    ("invalid-ancillary-crc", "an unknown ancillary chunk with a wrong CRC", "CON-9",
     _ancillary(lambda v: put(v, -1, lambda x: x ^ 1))),
    ("invalid-ancillary-type", "an unknown ancillary chunk whose third letter is lower case",
     "CON-9", lambda b: b.insert(NETW, "test")),
    ("invalid-ancillary-length", "an unknown ancillary chunk with a length of two gigabytes",
     "CON-9 SEC-1", _ancillary(lambda v: v[:4] + b"\xff\xff\xff\x7f" + v[8:])),
    ("invalid-type-space", "a chunk type with a space", "", lambda b: b.insert(NETW, "te T")),
    ("invalid-tail-early", "TAIL before the last texture", "",
     lambda b: b.order(HEAD, BACK, DISC, NETW, BACK_TEXR, TAIL, DISC_TEXR)),
    ("invalid-tail-twice", "two TAIL chunks", "",
     lambda b: b.order(*range(TAIL + 1), TAIL)),
    ("invalid-only-tail", "nothing but TAIL", "", lambda b: b.order(TAIL)),
    ("invalid-only-head", "nothing but HEAD", "", lambda b: b.order(HEAD, TAIL)),
    ("unsupported-chunk-private", "a private critical chunk", "CON-8", _private("TsST")),
    ("unsupported-chunk-last", "an unknown critical chunk after the textures", "",
     lambda b: b.insert(TAIL, "TEST")),
    ("unsupported-chunk-case", "a known type with another case of its last letter", "CON-8",
     _private("LAYr")),
    ("invalid-chunk-joined", "a chunk that takes in the next one, with the right CRC", "",
     _joined),
    ("invalid-chunk-short", "a chunk whose length ends within its payload", "", _short),
    ("invalid-layers-few", "more layers than announced", "", lambda b: b.set(HEAD, layers=1)),
    ("invalid-layers-many", "a layer less than announced", "", lambda b: b.set(HEAD, layers=3)),
    ("invalid-networks-none", "a network that was not announced", "",
     lambda b: b.set(HEAD, networks=0)),
    ("invalid-networks-many", "a network less than announced", "",
     lambda b: b.set(HEAD, networks=2)),
]

_ARRAYS: list[_Row] = [
    ("invalid-weights-overlap", "weights of which the first array takes in the second", "",
     lambda b: b.edit(NETW, "weights", _swallow)),
    ("invalid-weights-short", "weights whose first array ends early", "",
     _inner(lambda v: v - 1)),
    ("invalid-weights-zero", "weights whose first array has no bytes", "", _inner(lambda v: 0)),
    ("invalid-weights-huge", "weights whose first array has four gigabytes", "SEC-1",
     _inner(lambda v: (1 << 32) - 1)),
    ("invalid-weights-none", "no bytes of weights", "", lambda b: b.set(NETW, weights=b"")),
    ("invalid-mask-cut", "a mask of codes that ends early", "TEX-1",
     lambda b: b.edit(DISC_TEXR, "stored", lambda v: v[:-1])),
    ("invalid-mask-long", "a byte after a mask of codes", "TEX-1",
     lambda b: b.edit(DISC_TEXR, "stored", lambda v: v + b"\0")),
    ("invalid-classes-cut", "classes of a boundary that end early", "GEO-5",
     lambda b: b.edit(DISC, "classes", lambda v: v[:-1])),
    ("invalid-classes-long", "a byte after the classes of a boundary", "GEO-5 ENT-1",
     lambda b: b.edit(DISC, "classes", lambda v: v + b"\0")),
    ("invalid-classes-few", "classes of fewer segments", "GEO-4",
     lambda b: b.set(DISC, segments=[5])),
    ("invalid-classes-many", "classes of more segments", "GEO-4",
     lambda b: b.set(DISC, segments=[3])),
    ("invalid-deltas-long", "a byte after the deltas of a boundary", "GEO-5",
     lambda b: b.edit(DISC, "deltas", lambda v: v + b"\0")),
    ("invalid-delta-class", "a delta in a larger class than it needs", "ENT-17", _wide_class),
    ("invalid-point-high", "a control point at 2^26", "",
     lambda b: b.set(DISC, **_shape((1, 1), (5, 1), (1 << 26, 3)))),
    ("invalid-point-low", "a control point at -2^26", "",
     lambda b: b.set(DISC, **_shape((1, 1), (5, -1 << 26), (2, 3)))),
    ("invalid-point-sum", "control points that are out of range only when summed up", "SEC-12",
     lambda b: b.set(DISC, **_shape(*((k * 40_000_000, 1) for k in range(3))))),
    ("invalid-unit-none", "a unit without a boundary", "", lambda b: b.set(BACK, unit=1)),
    ("invalid-classes-none", "classes without a boundary", "",
     lambda b: b.set(BACK, classes=b"\0")),
    ("invalid-codes-words", "codes that announce 2^32 - 1 words", "SEC-7 SEC-1",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: v[: 1 + 4 * (1 << v[0])] + b"\xff" * 4)),
    ("invalid-codes-states", "codes of 1,024 lanes in ten bytes", "SEC-7",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: b"\x0a" + v[1:10])),
    ("invalid-codes-low-state", "codes that begin with a state below 2^16", "",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: v[:1] + b"\xff\xff\0\0" + v[5:])),
]

_NUMBERS: list[_Row] = [
    (f"invalid-half-{name}-{where}", f"{said} among the {key} of {of}", "",
     _halves(at, key, half))
    for at, of, where, key, halves in (
        (BACK_TEXR, "a texture", "texture-step", "steps",
         ("infinity", "nan", "minus-infinity", "minus-zero", "negative")),
        (NETW, "a network", "network-step", "steps", ("infinity", "nan", "zero", "minus-zero")),
        (NETW, "a network", "bias", "biases", ("nan", "minus-infinity", "minus-nan")),
    )
    for name in halves
    for said, half in [{
        "infinity": ("Infinity", INFINITY), "minus-infinity": ("minus infinity", b"\0\xfc"),
        "nan": ("no number", QUIET), "minus-nan": ("no number, with a sign", b"\xff\xff"),
        "zero": ("zero", b"\0\0"), "minus-zero": ("minus zero", b"\0\x80"),
        "negative": ("the smallest negative number", b"\x01\x80"),
    }[name]]
]
# fmt: on

CASES = {
    name: Invalid(title[0].upper() + title[1:], tuple(tests.split()), build)
    for name, title, tests, build in (*_POLYGLOTS, *_FRAMING, *_ARRAYS, *_NUMBERS)
}
