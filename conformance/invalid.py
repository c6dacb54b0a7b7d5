"""Files that must be refused: one small valid file, broken in one place each."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import msgpack
import numpy as np

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container.chunks import MAPS_UNTIL, Chunk, read, write
from proxyimg_codec.entropy import arrays
from proxyimg_codec.model import Picture

from .builders import Numbers, changed, ellipse, layer, network, picture, texture, values

HEAD, BACK, DISC, NETW, BACK_TEXR, DISC_TEXR, TAIL = range(7)
"""Positions of the chunks in the base file."""

GRID = (7, 5)
NAN, INFINITY = b"\x00\x7e", b"\x00\x7c"


class Base:
    """A valid file: a back and a disc with a mask, 5-bit codes, one network."""

    def __init__(self) -> None:
        self.data = to_bytes(self.build(Numbers("base")))
        self.chunks = read(self.data)

    def build(self, n: Numbers) -> Picture:
        """The picture."""
        stored = n.integers(0, 2, GRID[::-1]) > 0
        back = layer("back", (0, 0, 12, 10), texture(n, grid=GRID, bits=5))
        plane = texture(n, grid=GRID, bits=5, stored=stored)
        disc = layer("disc", (2, 2, 8, 7), plane, ellipse((6, 5.5), (4, 3.5)))
        return picture((12, 10), [back, disc], network(n))

    def fields(self, at: int) -> dict[str, Any]:
        """The values of chunk number `at` by key."""
        return values(self.chunks[at])

    def order(self, *positions: int) -> bytes:
        """The chunks at `positions`."""
        return write([self.chunks[i] for i in positions])

    def payload(self, at: int, payload: bytes) -> bytes:
        """Chunk `at` with another payload and the right CRC."""
        chunks = list(self.chunks)
        chunks[at] = replace(chunks[at], payload=payload)
        return write(chunks)

    def set(self, at: int, **new: Any) -> bytes:
        """Chunk `at` with other, added or (if None) removed values."""
        return self.payload(at, changed(self.chunks[at], new).payload)

    def map(self, at: int, **new: Any) -> bytes:
        """The same with a map, in a file of a version that has maps."""
        return self.old(at, changed(self.chunks[at], new, in_map=True).payload)

    def old(self, at: int, payload: bytes) -> bytes:
        """A file of version 0.3 with another payload of chunk `at`."""
        return write(read(self.payload(at, payload)), MAPS_UNTIL)

    def edit(self, at: int, key: str, change: Callable[[bytes], bytes]) -> bytes:
        """Chunk `at` with the bytes of one field changed."""
        return self.set(at, **{key: change(self.fields(at)[key])})

    def insert(self, at: int, type_: str) -> bytes:
        """An empty chunk before chunk `at`."""
        return write([*self.chunks[:at], Chunk(type_, b""), *self.chunks[at:]])

    def damage(self, at: int, byte: int, bit: int) -> bytes:
        """A bit of chunk `at`'s payload flipped, the CRC as it was."""
        payload = put(self.chunks[at].payload, byte, lambda v: v ^ bit)
        return self.data.replace(self.chunks[at].payload, payload)

    def end(self, at: int) -> int:
        """Where chunk `at` ends in the file."""
        return (self.chunks[at].offset or 0) + self.chunks[at].size


def put(data: bytes, at: int, change: Callable[[int], int]) -> bytes:
    """`data` with the byte at `at` changed."""
    out = bytearray(data)
    out[at] = change(out[at])
    return bytes(out)


def words(stream: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """An entropy-coded stream with its words changed, their count with them."""
    head = 1 + 4 * (1 << stream[0])
    end = head + 4 + 2 * int.from_bytes(stream[head : head + 4], "little")
    new = change(stream[head + 4 : end])
    return stream[:head] + (len(new) // 2).to_bytes(4, "little") + new + stream[end:]


def _mask(b: Base, value: int) -> bytes:
    values = np.full((1, GRID[1], GRID[0]), value)
    return arrays.encode(values, 1, np.ones(values.shape[1:], bool))


def _half(value: float) -> bytes:
    return struct.pack("<e", value)


def _long(chunk: Chunk) -> bytes:
    """The payload with its last value, a small integer, in two bytes."""
    return chunk.payload[:-1] + b"\xcc" + chunk.payload[-1:]


def _deep(b: Base) -> bytes:
    return b.payload(HEAD, b"\x91" * 50_000 + b"\x00")


@dataclass(frozen=True)
class Invalid:
    """A case to be refused.

    Attributes:
        title: One sentence.
        tests: Ids of statements that it is there for, beside that of the error of the package.
        build: Breaks a base file.
        base: What it breaks.
        optional: Whether a decoder need not look, as in `cases.Case`.
    """

    title: str
    tests: tuple[str, ...]
    build: Callable[[Any], bytes]
    base: type[Base] = Base
    optional: bool = False


_Row = tuple[str, str, str, Callable[[Base], bytes]]

# fmt: off
_FRAMING: list[_Row] = [
    ("invalid-empty", "no bytes at all", "", lambda b: b""),
    ("invalid-cut-signature", "ends in the signature", "", lambda b: b.data[:5]),
    ("invalid-cut-version", "ends in the version", "", lambda b: b.data[:10]),
    ("invalid-no-chunk", "ends after the version", "", lambda b: b.data[:12]),
    ("invalid-cut-header", "ends in a chunk header", "",
     lambda b: b.data[:b.end(BACK) + 6]),
    ("invalid-cut-payload", "ends in a payload", "",
     lambda b: b.data[:b.end(NETW) - 20]),
    ("invalid-cut-crc", "ends in a CRC", "", lambda b: b.data[:-2]),
    ("invalid-no-tail", "no TAIL", "", lambda b: b.data[:b.end(DISC_TEXR)]),
    ("invalid-length", "a chunk's length has its top bit set", "SEC-4",
     lambda b: put(b.data, 12 + 7, lambda v: v | 128)),
    ("invalid-crc-head", "the width's last bit flipped", "",
     lambda b: b.damage(HEAD, 2, 1)),
    ("invalid-crc-texture", "the last code's last bit flipped", "SEC-4",
     lambda b: b.damage(BACK_TEXR, -1, 128)),
    ("invalid-crc-tail", "a bit of TAIL's CRC flipped", "",
     lambda b: put(b.data, len(b.data) - 1, lambda v: v ^ 1)),
    ("invalid-trailing-byte", "a zero after TAIL", "", lambda b: b.data + b"\0"),
    ("invalid-trailing-chunk", "a chunk after TAIL", "",
     lambda b: write([*b.chunks, Chunk("teSt", b"")])),
    ("invalid-signature", "the signature of PNG", "",
     lambda b: b.data.replace(b"PXI", b"PNG", 1)),
    ("invalid-line-ends", "line ends changed as by a text transfer", "",
     lambda b: b.data.replace(b"\r\n", b"\n", 1)),
    ("invalid-reserved", "the reserved field is not zero", "",
     lambda b: put(b.data, 10, lambda v: 1)),
    ("invalid-type-case", "a chunk type whose third letter is lower case", "",
     lambda b: b.insert(NETW, "tesT")),
    ("invalid-type-digit", "a chunk type with a digit", "",
     lambda b: b.insert(NETW, "t3ST")),
    ("unsupported-version", "format 1.2", "VER-1", lambda b: put(b.data, 8, lambda v: 1)),
    ("unsupported-version-0-4", "format 0.4", "VER-4",
     lambda b: put(b.data, 9, lambda v: 4)),
    ("unsupported-version-0-10", "format 0.10", "VER-4",
     lambda b: put(b.data, 9, lambda v: 10)),
    ("unsupported-version-0-0", "format 0.0", "VER-4",
     lambda b: put(b.data, 9, lambda v: 0)),
    ("unsupported-chunk", "an unknown critical chunk", "",
     lambda b: b.insert(NETW, "TeST")),
]

_STRUCTURE: list[_Row] = [
    ("invalid-head-late", "HEAD is the second chunk", "",
     lambda b: b.order(BACK, HEAD, DISC, NETW, BACK_TEXR, DISC_TEXR, TAIL)),
    ("invalid-head-twice", "two HEAD chunks", "",
     lambda b: b.order(HEAD, HEAD, BACK, DISC, NETW, BACK_TEXR, DISC_TEXR, TAIL)),
    ("invalid-order", "a texture before the network", "",
     lambda b: b.order(HEAD, BACK, DISC, BACK_TEXR, NETW, DISC_TEXR, TAIL)),
    ("invalid-layer-missing", "fewer layers than announced", "",
     lambda b: b.order(HEAD, BACK, NETW, BACK_TEXR, TAIL)),
    ("invalid-network-extra", "more networks than announced", "",
     lambda b: b.order(HEAD, BACK, DISC, NETW, NETW, BACK_TEXR, DISC_TEXR, TAIL)),
    ("invalid-texture-missing", "fewer textures than layers", "",
     lambda b: b.order(HEAD, BACK, DISC, NETW, BACK_TEXR, TAIL)),
    ("invalid-texture-extra", "more textures than layers", "",
     lambda b: b.order(HEAD, BACK, DISC, NETW, BACK_TEXR, DISC_TEXR, DISC_TEXR, TAIL)),
    ("invalid-tail-payload", "TAIL is not empty", "", lambda b: b.payload(TAIL, b"\0")),
    ("invalid-names", "two layers of one name", "", lambda b: b.set(DISC, name="back")),
    ("invalid-network-index", "a network that does not exist", "",
     lambda b: b.set(DISC_TEXR, network=1)),
    ("invalid-opaque-boundary", "opaque with a boundary on the back layer", "",
     lambda b: b.order(HEAD, DISC, BACK, NETW, DISC_TEXR, BACK_TEXR, TAIL)),
    ("invalid-depth", "a depth of 12 bits", "", lambda b: b.set(HEAD, depth=12)),
    ("invalid-box", "an empty box", "", lambda b: b.set(DISC, box=[2, 2, 8, 0])),
    ("invalid-grid", "a plane of one column", "", lambda b: b.set(BACK_TEXR, grid=[1, 5])),
    ("invalid-bits", "codes of nine bits", "", lambda b: b.set(BACK_TEXR, bits=9)),
    ("invalid-value-missing", "a value is missing", "CON-18", lambda b: b.set(HEAD, depth=None)),
    ("invalid-value-last", "the last value is missing", "",
     lambda b: b.set(DISC_TEXR, codes=None)),
    ("invalid-value-more", "a value too many", "CON-18", lambda b: b.set(HEAD, more=1)),
    ("invalid-value-order", "the values in the opposite order", "",
     lambda b: b.payload(DISC_TEXR, msgpack.packb([*b.fields(DISC_TEXR).values()][::-1]))),
    ("invalid-key-order", "a map in the opposite order", "",
     lambda b: b.old(HEAD, msgpack.packb(dict(reversed(b.fields(HEAD).items()))))),
    ("invalid-key-order-texture", "a map in the opposite order, the coder last",
     "",
     lambda b: b.old(DISC_TEXR, msgpack.packb(dict(reversed(b.fields(DISC_TEXR).items()))))),
    ("invalid-key-missing", "a map without one of the keys", "",
     lambda b: b.map(HEAD, depth=None)),
    ("invalid-key-unknown", "a map with a key too many", "",
     lambda b: b.map(HEAD, more=1)),
    ("invalid-map", "a map in a file of a version without maps", "CON-17",
     lambda b: b.payload(HEAD, changed(b.chunks[HEAD], {}, in_map=True).payload)),
    ("invalid-no-array", "a payload that is an integer", "",
     lambda b: b.payload(HEAD, b"\x07")),
    ("invalid-long-array", "a payload with three bytes of header for one", "",
     lambda b: b.payload(HEAD, b"\xdc\x00" + put(b.chunks[HEAD].payload, 0, lambda v: v & 15))),
    ("invalid-long-integer", "an integer in two bytes for one", "CON-18",
     lambda b: b.payload(HEAD, _long(b.chunks[HEAD]))),
    ("invalid-long-integer-map", "an integer in two bytes for one, in a map",
     "",
     lambda b: b.old(HEAD, _long(changed(b.chunks[HEAD], {}, in_map=True)))),
    ("invalid-float", "a float for an integer", "CON-16", lambda b: b.set(HEAD, depth=8.0)),
    ("invalid-boolean", "true for 1", "CON-16", lambda b: b.set(HEAD, opaque=True)),
    ("invalid-payload-end", "a byte after the array", "CON-18",
     lambda b: b.payload(HEAD, b.chunks[HEAD].payload + b"\0")),
    ("invalid-nesting", "arrays nested 50,000 deep", "SEC-1", _deep),
    ("unsupported-sampling", "a sampling of the future", "NUM-2",
     lambda b: b.set(DISC, sampling=200)),
    ("unsupported-coder", "a texture coder of the future", "NUM-2",
     lambda b: b.set(DISC_TEXR, coder=200)),
    ("limit-layers", "65,536 layers announced", "SEC-5", lambda b: b.set(HEAD, layers=1 << 16)),
    ("limit-side", "a canvas 1,048,577 pixels wide", "",
     lambda b: b.set(HEAD, size=[(1 << 20) + 1, 1])),
    ("limit-output", "a canvas of 2^28 pixels and some", "SEC-10",
     lambda b: b.set(HEAD, size=[1 << 14, (1 << 14) + 1])),
    ("limit-grid", "a plane of 2^48 codes", "SEC-5",
     lambda b: b.set(BACK_TEXR, grid=[1 << 24, 1 << 24])),
    ("limit-segments", "16 million segments", "", lambda b: b.set(DISC, segments=[1 << 24])),
    ("limit-parameters", "a network of 7 million parameters", "",
     lambda b: b.set(NETW, hidden=1024, depth=8)),
]

_STREAMS: list[_Row] = [
    ("invalid-step-nan", "a step is not a number", "",
     lambda b: b.edit(BACK_TEXR, "steps", lambda v: NAN + v[2:])),
    ("invalid-step-zero", "a step is zero", "",
     lambda b: b.edit(BACK_TEXR, "steps", lambda v: _half(0.0) + v[2:])),
    ("invalid-step-negative", "a network's step is negative", "",
     lambda b: b.edit(NETW, "steps", lambda v: _half(-0.5) + v[2:])),
    ("invalid-step-count", "a step too few", "",
     lambda b: b.edit(DISC_TEXR, "steps", lambda v: v[2:])),
    ("invalid-bias", "a bias is infinite", "",
     lambda b: b.edit(NETW, "biases", lambda v: v[:-2] + INFINITY)),
    ("invalid-weights-cut", "the weights end early", "",
     lambda b: b.edit(NETW, "weights", lambda v: v[:-1])),
    ("invalid-weights-long", "a byte after the weights", "",
     lambda b: b.edit(NETW, "weights", lambda v: v + b"\0")),
    ("invalid-codes-empty", "no bytes of codes", "",
     lambda b: b.set(BACK_TEXR, codes=b"")),
    ("invalid-codes-lanes", "2,048 lanes", "SEC-7",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: b"\x0b" + v[1:])),
    ("invalid-codes-cut", "fewer words than announced", "SEC-7",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: v[:12])),
    ("invalid-codes-short", "a word too few", "",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: words(v, lambda w: w[:-2]))),
    ("invalid-codes-long", "a word left over", "",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: words(v, lambda w: w + b"\0\0"))),
    ("invalid-codes-state", "a bit of a state flipped", "",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: put(v, 3, lambda x: x ^ 64))),
    ("invalid-codes-word", "a bit of the last word flipped", "", lambda b: b.edit(
        BACK_TEXR, "codes", lambda v: words(v, lambda w: put(w, -1, lambda x: x ^ 1)))),
    ("invalid-codes-padding", "a padding bit of the low bits is set", "ENT-15",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: put(v, -1, lambda x: x | 1))),
    ("invalid-codes-low-bits", "a byte of low bits too many", "ENT-1",
     lambda b: b.edit(BACK_TEXR, "codes", lambda v: v + b"\0")),
    ("invalid-mask-full", "a mask that stores all codes", "",
     lambda b: b.set(DISC_TEXR, stored=_mask(b, 1))),
    ("invalid-mask-empty", "a mask that stores no code", "",
     lambda b: b.set(DISC_TEXR, stored=_mask(b, 0))),
    ("invalid-deltas-padding", "a padding bit of the boundary is set", "GEO-5",
     lambda b: b.edit(DISC, "deltas", lambda v: put(v, -1, lambda x: x | 1))),
    ("invalid-deltas-cut", "a byte of the boundary is missing", "GEO-5",
     lambda b: b.edit(DISC, "deltas", lambda v: v[:-1])),
    ("invalid-no-segments", "boundary data without segments", "",
     lambda b: b.set(DISC, segments=[])),
    ("invalid-empty-path", "a path without segments", "",
     lambda b: b.set(DISC, segments=[4, 0])),
]
# fmt: on

CASES = {
    name: Invalid(title[0].upper() + title[1:], tuple(tests.split()), build)
    for name, title, tests, build in (*_FRAMING, *_STRUCTURE, *_STREAMS)
}
