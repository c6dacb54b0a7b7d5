"""Refused files: chunks in a wrong order or number, and values that contradict each other."""

from __future__ import annotations

import msgpack

from proxyimg_codec.container.chunks import Chunk

from ..builders import changed
from .base import (
    BACK,
    BACK_TEXR,
    DISC,
    DISC_TEXR,
    HEAD,
    NETW,
    TAIL,
    Base,
    Row,
    put,
    refused,
)


def _long(chunk: Chunk) -> bytes:
    """Payload with its last value, a small integer, encoded in two bytes."""
    return chunk.payload[:-1] + b"\xcc" + chunk.payload[-1:]


def _deep(b: Base) -> bytes:
    return b.payload(HEAD, b"\x91" * 50_000 + b"\x00")


# fmt: off
_STRUCTURE: list[Row] = [
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
    ("invalid-tail-early", "TAIL before the last texture", "",
     lambda b: b.order(HEAD, BACK, DISC, NETW, BACK_TEXR, TAIL, DISC_TEXR)),
    ("invalid-tail-twice", "two TAIL chunks", "",
     lambda b: b.order(*range(TAIL + 1), TAIL)),
    ("invalid-only-tail", "nothing but TAIL", "", lambda b: b.order(TAIL)),
    ("invalid-only-head", "nothing but HEAD", "", lambda b: b.order(HEAD, TAIL)),
    ("invalid-layers-few", "more layers than announced", "", lambda b: b.set(HEAD, layers=1)),
    ("invalid-layers-many", "a layer less than announced", "", lambda b: b.set(HEAD, layers=3)),
    ("invalid-networks-none", "a network that was not announced", "",
     lambda b: b.set(HEAD, networks=0)),
    ("invalid-networks-many", "a network less than announced", "",
     lambda b: b.set(HEAD, networks=2)),
]
# fmt: on

CASES = refused(_STRUCTURE)
