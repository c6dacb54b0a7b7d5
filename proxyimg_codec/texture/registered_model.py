"""Registered pyramid models: weights that are part of the specification, not of a file.

A model is one file in `models/`: a fixed sequence of arrays of integers, each in units of a power
of two (spec chapter 8). The `Context` networks predict probabilities in integer arithmetic; the
`Synthesis` networks compute colour in floating point.
"""

from __future__ import annotations

import functools
import hashlib
import struct
from importlib import resources
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError
from .network import Floats

MAGIC = b"PXIMODL1"
LEVEL_SETS = 4
"""Number of sets of weights: for levels 1, 2, 3, and for all coarser levels."""


class Registration(NamedTuple):
    """Entry of the registry of models.

    Attributes:
        file: Name of the file of its weights, without suffix; models may share one.
        digest: SHA-256 of that file.
        padded: Whether its planes are those of a raster padded to multiples of 2**levels.
    """

    file: str
    digest: str
    padded: bool


_FIRST = "91e24c9aca7764cc60f13d481e139d4a1ef71bbe6cffe0b1f3850315bb2d0934"

REGISTERED = {
    1: Registration("pyramid-1", _FIRST, True),
    2: Registration("pyramid-1", _FIRST, False),
}
"""Models by registered number."""

STEP_ORIGIN = 293
"""Origin of the quantization step as an input of networks: (step - STEP_ORIGIN) / 128."""

CAUSAL = tuple((dy, dx) for dy in (-2, -1, 0) for dx in (-2, -1, 0, 1, 2) if dy < 0 or dx < 0)
"""Offsets (dy, dx) of the neighbours, coded before, that are inputs of the context network."""


class Array(NamedTuple):
    """Array of a model.

    Attributes:
        values: Integers in units of 2**exponent.
        exponent: Exponent of the unit.
    """

    values: NDArray[np.int32]
    exponent: int

    @property
    def floats(self) -> Floats:
        """Array as float32, which is exact."""
        return (self.values * 2.0**self.exponent).astype(np.float32)


class Context(NamedTuple):
    """Weights of the context network of a level, with C hidden units.

    Weights are [out, in, ...], biases [out]. Biases are in 1/32 of the unit of their weights;
    `first_by_step` is in 1/256 of that.
    """

    first: Array  # [C, 12, 3, 3]
    first_bias: Array
    first_by_step: Array
    second: Array  # [C, C, 3, 3]
    second_bias: Array
    causal: Array  # [C, 18, 12]
    mix: Array  # [C, C]
    mix_bias: Array
    luma: Array  # [6, C]
    luma_bias: Array
    from_luma: Array  # [C, 6]
    from_luma_bias: Array
    chroma: Array  # [12, C]
    chroma_bias: Array


class Synthesis(NamedTuple):
    """Weights of the synthesis network of a level, with H hidden units."""

    delta: Array  # [12, 12, 5, 5], added to the weights of the CDF 9/7 wavelet
    gain: Array  # [9]
    gain_by_step: Array  # [9]
    first: Array  # [H, 12, 3, 3]
    first_bias: Array
    first_by_step: Array
    second: Array  # [H, H]
    second_bias: Array
    third: Array  # [12, H, 3, 3]
    third_bias: Array


class Model(NamedTuple):
    """Weights of a registered model; those of level l have the index min(l, 4) - 1."""

    to_colour: Array  # [3, 3]
    context: tuple[Context, ...]
    synthesis: tuple[Synthesis, ...]


WIDE = ("bias", "by_step", "gain", "to_colour")
"""Parts of the names of the arrays that are int32 in the file; the others are int8."""


def layout(hidden: int, context: int) -> list[tuple[str, tuple[int, ...], str]]:
    """Names, shapes and types of all arrays in the order of the file.

    Args:
        hidden: Hidden units of the synthesis networks.
        context: Hidden units of the context networks.
    """
    c, h = context, hidden
    ctx = [
        (c, 12, 3, 3), (c,), (c,), (c, c, 3, 3), (c,), (c, 18, 12), (c, c), (c,),
        (6, c), (6,), (c, 6), (c,), (12, c), (12,),
    ]  # fmt: skip
    syn = [
        (12, 12, 5, 5), (9,), (9,), (h, 12, 3, 3), (h,), (h,), (h, h), (h,), (12, h, 3, 3), (12,),
    ]  # fmt: skip
    names: list[tuple[str, tuple[int, ...]]] = [("to_colour", (3, 3))]
    for level in range(LEVEL_SETS):
        names += [(f"context {level} {n}", s) for n, s in zip(Context._fields, ctx, strict=True)]
        names += [
            (f"synthesis {level} {n}", s) for n, s in zip(Synthesis._fields, syn, strict=True)
        ]
    return [(n, s, "<i4" if any(w in n for w in WIDE) else "<i1") for n, s in names]


def pack(arrays: dict[str, Array], hidden: int, context: int) -> bytes:
    """Packs a model to the bytes of its file.

    Args:
        arrays: All arrays by their names in `layout`.
        hidden: Hidden units of the synthesis networks.
        context: Hidden units of the context networks.
    """
    out = [MAGIC, struct.pack("<HH", hidden, context)]
    for name, shape, kind in layout(hidden, context):
        values, exponent = arrays[name]
        assert values.shape == shape, name
        assert (values == values.astype(kind)).all(), name
        out += [struct.pack("<b", exponent), values.astype(kind).tobytes()]
    return b"".join(out)


def unpack(data: bytes) -> Model:
    """Unpacks the file of a model, which must be valid."""
    assert data[:8] == MAGIC
    hidden, context = struct.unpack_from("<HH", data, 8)
    at, arrays = 12, []
    for _, shape, kind in layout(hidden, context):
        count = int(np.prod(shape))
        values = np.frombuffer(data, kind, count, at + 1).reshape(shape).astype(np.int32)
        arrays.append(Array(values, struct.unpack_from("<b", data, at)[0]))
        at += 1 + count * np.dtype(kind).itemsize
    assert at == len(data)
    contexts, syntheses = [], []
    size = len(Context._fields) + len(Synthesis._fields)
    for level in range(LEVEL_SETS):
        own = arrays[1 + level * size : 1 + (level + 1) * size]
        contexts.append(Context(*own[: len(Context._fields)]))
        syntheses.append(Synthesis(*own[len(Context._fields) :]))
    return Model(arrays[0], tuple(contexts), tuple(syntheses))


def registration(number: int) -> Registration:
    """Finds the entry of a registered number.

    Raises:
        UnsupportedError: This program does not have the model.
    """
    if number not in REGISTERED:
        raise UnsupportedError(f"chunk PLAN: pyramid model {number} is not known; update "
                               "proxyimg-codec", rule="PYR-1")  # fmt: skip
    return REGISTERED[number]


def registered(number: int) -> Model:
    """Loads the weights of the model with a registered number, once.

    Raises:
        UnsupportedError: This program does not have the model, or its file is damaged.
    """
    entry = registration(number)
    return _loaded(entry.file, entry.digest)


@functools.cache
def _loaded(file: str, digest: str) -> Model:
    data = resources.files("proxyimg_codec.models").joinpath(f"{file}.bin").read_bytes()
    if hashlib.sha256(data).hexdigest() != digest:
        raise UnsupportedError(f"the weights {file}.bin are damaged; reinstall proxyimg-codec")
    return unpack(data)
