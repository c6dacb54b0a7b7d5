"""Refused files: faults of coded arrays, of boundaries and of lists of numbers."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from proxyimg_codec.entropy import arrays
from proxyimg_codec.geometry import boundary
from proxyimg_codec.geometry.boundary import Boundary

from .base import (
    BACK,
    BACK_TEXR,
    DISC,
    DISC_TEXR,
    GRID,
    INFINITY,
    NAN,
    NETW,
    Base,
    Row,
    put,
    refused,
    words,
)

QUIET = b"\x01\x7e"
"""A float16 that is NaN, with another bit set; its sign and lower bits do not matter."""


def _mask(b: Base, value: int) -> bytes:
    """Coded mask of stored codes that is `value` everywhere."""
    values = np.full((1, GRID[1], GRID[0]), value)
    return arrays.encode(values, 1, np.ones(values.shape[1:], bool))


def _half(value: float) -> bytes:
    """Bytes of a float16."""
    return struct.pack("<e", value)


def _halves(at: int, key: str, first: bytes) -> Callable[[Base], bytes]:
    """Builder of a file with other first float16 values in a field."""
    return lambda b: b.edit(at, key, lambda v: first + v[len(first) :])


def _inner(change: Callable[[int], int]) -> Callable[[Base], bytes]:
    """Builder of a file with the first length in the weights changed."""

    def edit(weights: bytes) -> bytes:
        return change(int.from_bytes(weights[:4], "little")).to_bytes(4, "little") + weights[4:]

    return lambda b: b.edit(NETW, "weights", edit)


def _swallow(weights: bytes) -> bytes:
    """Weights whose first array takes in the second."""
    return (len(weights) - 4).to_bytes(4, "little") + weights[4:]


def _shape(*points: tuple[int, int], unit: int = 0) -> dict[str, Any]:
    """Fields of a boundary of one path, given by three points a segment."""
    return boundary.encode(Boundary(unit, (np.array(points, np.int64),)))


def _wide_class(b: Base) -> bytes:
    """Deltas of which one has class 15, but the magnitude 5."""
    classes = np.zeros((6, 1, 1), np.int64)
    classes[0] = 15
    coded = arrays.encode(classes, 4, np.ones((1, 1), bool))
    return b.set(DISC, segments=[1], classes=coded, deltas=struct.pack(">I", 5))


# fmt: off
_STREAMS: list[Row] = [
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

_ARRAYS: list[Row] = [
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

_NUMBERS: list[Row] = [
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

CASES = refused((*_STREAMS, *_ARRAYS, *_NUMBERS))
