"""Refused files: values of chunks that are out of range, of a wrong type, or cut off.

Cases at the ends of ranges are made from the tables of fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgpack

from proxyimg_codec.container import head, layr, mesh, motn, netw, plan, pose, texr
from proxyimg_codec.container.fields import Field

from . import motion, poses, pyramids
from .base import BACK, BACK_TEXR, DISC, HEAD, NETW, Base, Refused, Row, refused

CHUNKS: Mapping[str, tuple[type[Base], int, Sequence[Field]]] = {
    "head": (Base, HEAD, head.FIELDS),
    "layr": (Base, DISC, layr.FIELDS),
    "mesh": (poses.Posed, poses.DISC_MESH, mesh.FIELDS),
    "pose": (poses.Posed, poses.POSE, pose.FIELDS),
    "netw": (Base, NETW, netw.FIELDS),
    "plan": (pyramids.Views, pyramids.PLAN, plan.FIELDS),
    "texr": (Base, BACK_TEXR, texr.FIELDS),
    "view": (pyramids.Views, pyramids.DISC_TEXR, texr.PYRAMID_FIELDS),
    "shared": (poses.Posed, poses.COPY_TEXR, texr.SHARED_FIELDS),
    "motn": (motion.Moving, motion.MOTION, motn.FIELDS),
}
"""Base file and position of a chunk of each kind."""

AMBIGUOUS = {
    # These exceed a limit, too.
    "head size high", "head layers high", "head networks high", "layr segments high",
    "mesh gates high", "texr grid high", "plan size high", "motn intervals high",
    # Numbers that a later version may use are refused as unsupported.
    "layr sampling low", "layr sampling high", "plan model low", "plan model high",
    "texr coder low", "texr coder high", "view coder low", "view coder high", "shared coder low",
    "shared coder high",
}  # fmt: skip
"""Values for which another class of error is allowed."""


def _beyond(field: Field, end: str) -> int | None:
    """Number just beyond one end of the range of a field; None if it would make a large file."""
    number = field.low - 1 if end == "low" else field.high + 1
    if field.kind in ("int", "ints"):
        return number
    return number if field.kind == "str" and number <= 1 << 10 else None


def _set(at: int, field: Field, number: int) -> Callable[[Base], bytes]:
    """Builder of a file in which a field has a number, or a length, of `number`."""

    def build(b: Base) -> bytes:
        value: Any = number
        if field.kind == "str":
            value = "a" * number
        if field.kind == "ints":
            value = [number, *b.fields(at)[field.key][1:]]
        return b.set(at, **{field.key: value})

    return build


def _ranges() -> dict[str, Refused]:
    """Cases of numbers just beyond the ranges of fields."""
    out = {}
    for kind, (base, at, fields) in CHUNKS.items():
        for field in fields:
            for end in ("low", "high"):
                number = _beyond(field, end)
                if number is None or f"{kind} {field.key} {end}" in AMBIGUOUS:
                    continue
                what = {"str": "length of", "ints": "first item of", "int": "value of"}[field.kind]
                name = f"invalid-{end}-{kind}-{field.key}".replace("_", "-")
                title = f"The {what} {field.key} in {kind} is {number}"
                out[name] = Refused(title, (), _set(at, field, number), base)
    return out


def _cut(at: int) -> Callable[[Base], bytes]:
    """Builder of a file with a payload that lacks its last byte."""
    return lambda b: b.payload(at, b.chunks[at].payload[:-1])


def _cut_stream(at: int, key: str) -> Callable[[Base], bytes]:
    """Builder of a file with a coded array that lacks its last byte."""
    return lambda b: b.edit(at, key, lambda v: v[:-1])


STREAMS = {
    "mesh": ("symbols", "classes"),
    "pose": ("node_classes", "node_deltas"),
    "plan": ("support",),
    "motn": ("curve_classes", "shape_classes", "shape_deltas"),
}
"""Coded arrays of chunks that are cut off here because no other module does it."""


def _cuts() -> dict[str, Refused]:
    """Cases of payloads and coded arrays that are cut off."""
    out = {}
    for kind, (base, at, _) in CHUNKS.items():
        title = f"The last value of {kind} ends early"
        out[f"invalid-cut-{kind}"] = Refused(title, ("CON-18",), _cut(at), base)
        for key in STREAMS.get(kind, ()):
            name = f"invalid-cut-{kind}-{key}".replace("_", "-")
            title = f"A byte of {key} in {kind} is missing"
            out[name] = Refused(title, (), _cut_stream(at, key), base)
    return out


def _raw(key: str, packed: bytes) -> Callable[[Base], bytes]:
    """Builder of a file with other bytes for one value in LAYR of the disc."""

    def build(b: Base) -> bytes:
        values = {k: msgpack.packb(v) for k, v in b.fields(DISC).items()} | {key: packed}
        return b.payload(DISC, bytes([0x90 + len(values)]) + b"".join(values.values()))

    return build


# fmt: off
_TYPES: list[Row] = [
    ("invalid-value-nil", "nil for an integer", "CON-16", _raw("unit", b"\xc0")),
    ("invalid-value-negative", "-1 for an integer that is not signed", "", _raw("unit", b"\xff")),
    ("invalid-value-map", "a map for an array", "CON-16", _raw("box", b"\x80")),
    ("invalid-value-extension", "an extension for bytes", "CON-16",
     _raw("deltas", b"\xd4\x01\x00")),
    ("invalid-value-timestamp", "a timestamp for an integer", "CON-16",
     _raw("unit", b"\xd6\xff\0\0\0\0")),
    ("invalid-value-text", "a text for bytes", "", _raw("deltas", b"\xa1a")),
    ("invalid-value-bytes", "bytes for a text", "", _raw("name", b"\xc4\x01a")),
    ("invalid-value-integer", "an integer for an array", "", _raw("box", b"\x07")),
    ("invalid-value-array", "an array for an integer", "", _raw("unit", b"\x91\x04")),
    ("invalid-value-nested", "an array in an array", "", _raw("segments", b"\x91\x91\x04")),
    ("invalid-value-items", "a text in an array of integers", "", _raw("segments", b"\x91\xa14")),
    ("invalid-value-float32", "a float in an array of integers", "CON-16",
     _raw("segments", b"\x91\xca\x40\x80\0\0")),
    ("invalid-utf8", "a name that is not UTF-8", "CON-16", _raw("name", b"\xa2\xc3\x28")),
    ("invalid-utf8-overlong", "a name with a character in two bytes for one", "CON-16",
     _raw("name", b"\xa2\xc1\xa1")),
    ("invalid-utf8-surrogate", "a name with half of a surrogate pair", "CON-16",
     _raw("name", b"\xa3\xed\xa0\x80")),
    ("invalid-utf8-cut", "a name that ends within a character", "CON-16",
     _raw("name", b"\xa2a\xc3")),
    ("invalid-long-uint16", "an integer in three bytes for one", "", _raw("unit", b"\xcd\0\x04")),
    ("invalid-long-uint32", "an integer in five bytes for one", "",
     _raw("unit", b"\xce\0\0\0\x04")),
    ("invalid-long-uint64", "an integer in nine bytes for one", "",
     _raw("unit", b"\xcf" + bytes(7) + b"\x04")),
    ("invalid-long-signed", "a signed form for an integer above 0", "", _raw("unit", b"\xd0\x04")),
    ("invalid-long-negative", "a negative integer in two bytes for one", "",
     _raw("box", b"\x94\xd0\xff\x02\x08\x07")),
    ("invalid-long-text", "a text with two bytes of header for one", "",
     _raw("name", b"\xd9\x01a")),
    ("invalid-long-text16", "a text with three bytes of header for one", "",
     _raw("name", b"\xda\0\x01a")),
    ("invalid-long-bytes", "bytes with three bytes of header for two", "",
     lambda b: _raw("deltas", b"\xc5\0" + msgpack.packb(b.fields(DISC)["deltas"])[1:])(b)),
    ("invalid-long-value", "an array with three bytes of header for one", "",
     _raw("segments", b"\xdc\0\x01\x04")),
    ("invalid-huge-integer", "an integer of 2^64 - 1", "",
     _raw("unit", b"\xcf" + b"\xff" * 8)),
    ("invalid-huge-negative", "an integer of -2^63", "SEC-12",
     _raw("box", b"\x94\xd3\x80" + bytes(7) + b"\x02\x08\x07")),
    ("invalid-huge-bytes", "bytes that announce four gigabytes", "SEC-1",
     _raw("deltas", b"\xc6" + b"\xff" * 4)),
    ("invalid-huge-text", "a text that announces four gigabytes", "SEC-1",
     _raw("name", b"\xdb" + b"\xff" * 4)),
    ("invalid-huge-array", "an array that announces 2^32 - 1 items", "CON-16 SEC-1",
     _raw("segments", b"\xdd" + b"\xff" * 4)),
    ("invalid-empty-payload", "a payload of no bytes", "", lambda b: b.payload(BACK, b"")),
    ("invalid-empty-array", "an empty array", "CON-18", lambda b: b.payload(BACK, b"\x90")),
    ("invalid-reserved-byte", "a payload of the byte that MessagePack never uses", "",
     lambda b: b.payload(BACK, b"\xc1")),
]
# fmt: on

CASES = {**_ranges(), **_cuts(), **refused(_TYPES)}
