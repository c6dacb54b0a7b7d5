"""Coding of a level in the compiled kernel (`native/context.h`); `context` is the reference."""

from __future__ import annotations

import ctypes as ct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..entropy import laplace, rans
from ..errors import FormatError, LimitError
from ..native import kernel
from . import context
from .context import Ints, Place
from .watch import WATCH, Watch

WEIGHTS = (
    "first", "first_bias", "second", "second_bias", "causal", "mix", "mix_bias", "luma",
    "luma_bias", "from_luma", "from_luma_bias", "chroma", "chroma_bias",
)  # fmt: skip
BITS = {"first": 0, "second": 3, "causal": 3, "mix": 0, "luma": -1, "from_luma": 3, "chroma": -1}
"""Layers of the network, and the fractional bits that their results have beyond 1/32."""

STREAM_ENDS, ESCAPES_END, OUT_OF_RANGE = 1, 2, 3


class _Net(ct.Structure):
    """Mirrors `struct ContextNet`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in WEIGHTS),
        *((f"{n}_bits", ct.c_int32) for n in BITS),
        ("hidden", ct.c_int32),
    ]


class _Tables(ct.Structure):
    """Mirrors `struct Tables`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("ends", "reach", "shifts")),
        *((n, ct.c_int32) for n in ("columns", "scales", "certain", "limit", "scale_bits")),
    ]


class _Source(ct.Structure):
    """Mirrors `struct Source`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("words", "states", "escapes")),
        *((n, ct.c_int64) for n in ("n_words", "used", "n_escapes", "escapes_used")),
        ("lanes", ct.c_int32),
    ]


class _Sink(ct.Structure):
    """Mirrors `struct Sink`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("start", "freq", "ends", "escapes")),
        *((n, ct.c_int64) for n in ("n_symbols", "n_groups", "n_escapes")),
    ]


class _Level(ct.Structure):
    """Mirrors `struct Level`."""

    _fields_ = [
        ("net", _Net),
        ("tables", _Tables),
        ("source", _Source),
        ("sink", _Sink),
        *((n, ct.c_int32) for n in ("height", "width", "grey")),
        ("shifts", ct.c_int32 * 2),
        ("logs", ct.c_void_p),
        ("n_logs", ct.c_int64),
        *((n, ct.c_void_p) for n in ("low", "parent", "bands", "given", "latents")),
        ("watch", WATCH),
        ("listener", ct.c_void_p),
    ]


class _Lowest(ct.Structure):
    """Mirrors `struct Lowest`."""

    _fields_ = [
        ("tables", _Tables),
        ("source", _Source),
        ("scales", ct.c_int32 * 3),
        *((n, ct.c_int32) for n in ("count", "height", "width")),
        ("out", ct.c_void_p),
    ]


def decode(at: Place, stream: rans.Decoder, escapes: bytes, used: int, out: Ints) -> int:
    """Decodes a level.

    Args:
        at: Level to decode.
        stream: The entropy-coded stream, which is advanced.
        escapes: The list of escapes.
        used: Number of bytes of `escapes` that were read before.
        out: int32 [9, h, w] zeros that are replaced by the latents; by those that were read before
            an error, too.

    Returns:
        The number of bytes of `escapes` read by now.

    Raises:
        FormatError: The stream or the list of escapes is too short or corrupt, or a latent is out
            of range.
        LimitError: The kernel cannot allocate what it needs.
    """
    source, alive = _source(stream, escapes, used)
    level = _run(at, None, source, _Sink(), out)
    stream.states[:] = alive[1]
    stream.used = level.source.used
    return int(level.source.escapes_used)


def decode_lowest(
    scales: list[int], shape: tuple[int, int], stream: rans.Decoder, escapes: bytes, used: int
) -> tuple[Ints, int]:
    """Decodes the lowest planes, as `latents` does in numpy.

    Args:
        scales: Scale index of each of 1 to 3 planes.
        shape: Rows and columns of the planes.
        stream: The entropy-coded stream, which is advanced.
        escapes: The list of escapes.
        used: Number of bytes of `escapes` that were read before.

    Returns:
        int32 [3, h, w] planes, 0 where there is no scale, and the bytes of `escapes` read by now.

    Raises:
        FormatError: As of `decode`.
        LimitError: The kernel cannot allocate what it needs.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    source, alive = _source(stream, escapes, used)
    tables, kept = _tables()
    out = np.zeros((3, *shape), np.int32)
    planes = _Lowest(
        tables, source, (ct.c_int32 * 3)(*scales), len(scales), *shape, kernel.pointer(out)
    )
    _check(lib.pxi_pyramid_lowest(ct.byref(planes)))
    del kept  # alive until here
    stream.states[:] = alive[1]
    stream.used = planes.source.used
    return out, planes.source.escapes_used


Alive = tuple[NDArray[Any], ...]
"""Arrays that a structure points to."""


def _source(stream: rans.Decoder, escapes: bytes, used: int) -> tuple[_Source, Alive]:
    words, states = stream.words.astype(np.uint16), stream.states.astype(np.uint32)
    listed = np.frombuffer(escapes, np.uint8)
    source = _Source(
        kernel.pointer(words), kernel.pointer(states), kernel.pointer(listed),
        len(words), stream.used, len(listed), used, stream.lanes,
    )  # fmt: skip
    return source, (words, states, listed)


def _tables() -> tuple[_Tables, Alive]:
    tables = laplace.tables()
    arrays = tuple(
        np.ascontiguousarray(array, dtype)
        for array, dtype in (
            (tables.ends, np.uint16), (tables.reach, np.int64), (laplace.SHIFTS, np.int64),
        )
    )  # fmt: skip
    found = _Tables(
        *map(kernel.pointer, arrays),
        laplace.WIDTH + 1, laplace.SCALES, laplace.CERTAIN, context.LIMIT, rans.SCALE_BITS,
    )  # fmt: skip
    return found, arrays


def _check(wrong: int) -> None:
    """Raises the error of what went wrong, if anything."""
    if wrong == STREAM_ENDS:
        raise FormatError(rans.TOO_SHORT, rule="ENT-6")
    if wrong == ESCAPES_END:
        raise FormatError(context.BAD_ESCAPES, rule="PYR-13")
    if wrong == OUT_OF_RANGE:
        raise FormatError(context.BAD_LATENT, rule="PYR-12")
    if wrong:
        raise LimitError("there is not enough memory to code a pyramid")


def encode(at: Place, values: Ints, stream: rans.Encoder) -> tuple[Ints, NDArray[np.int64]]:
    """Encodes a level.

    Args:
        at: Level to encode.
        values: int32 [9, h, w] latents, less than `context.LIMIT` in magnitude.
        stream: The encoder to which symbols are added.

    Returns:
        int32 [9, h, w] latents as a decoder finds them, and int64 [N] differences that escape.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    h, w = at.bands.shape
    most = 9 * int(np.count_nonzero(at.bands))
    start, freq = np.empty(2 * most, np.uint16), np.empty(2 * most, np.uint16)
    ends, escapes = np.empty(4 * (w + 3 * h), np.int64), np.empty(most, np.int64)
    sink = _Sink(*(kernel.pointer(a) for a in (start, freq, ends, escapes)))
    latents = np.zeros((9, h, w), np.int32)
    level = _run(at, values, _Source(), sink, latents)
    groups, symbols = level.sink.n_groups, level.sink.n_symbols
    stream.put_groups(start[:symbols].copy(), freq[:symbols].copy(), ends[:groups])
    return latents, escapes[: level.sink.n_escapes].copy()


def _run(at: Place, values: Ints | None, source: _Source, sink: _Sink, latents: Ints) -> _Level:
    """Calls the kernel, which puts the latents, and returns its structure after the call."""
    lib = kernel.library()
    assert lib is not None, "check available() first"
    coder, weights = at.coder, at.coder.weights
    h, w = at.bands.shape
    tables, kept = _tables()
    alive: list[NDArray[Any]] = [*kept]

    def address(array: NDArray[Any], dtype: type[np.generic]) -> int:
        alive.append(np.ascontiguousarray(array, dtype))
        return kernel.pointer(alive[-1])

    watch = Watch(h * w)
    parts = {n: getattr(weights, n).values for n in WEIGHTS} | {"first_bias": coder.first_bias}
    level = _Level(
        _Net(
            *(address(parts[n], np.int32) for n in WEIGHTS),
            *(-getattr(weights, n).exponent - kept for n, kept in BITS.items()),
            len(weights.mix.values),
        ),
        tables, source, sink, h, w, coder.grey, (ct.c_int32 * 2)(*coder.shifts),
        address(context.LOG, np.int32), len(context.LOG),
        address(at.low, np.int32), address(at.parent, np.int32), address(at.bands, np.uint8),
        None if values is None else address(values, np.int32),
        kernel.pointer(latents), watch.function,
    )  # fmt: skip
    wrong = lib.pxi_pyramid_level(ct.byref(level))
    watch.check()
    _check(wrong)
    return level
