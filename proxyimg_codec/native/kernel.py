"""The compiled kernel (`kernel.cpp`) behind ctypes.

Functions that take a structure of one module alone are called there: `texture.context_native`,
`texture.synthesis_native`, `encoder.implicit.fit_native`. The kernel is optional: `available()`
is false where the package was installed without a C++ compiler.
"""

from __future__ import annotations

import ctypes as ct
import functools
import importlib.machinery
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError


class Net(ct.Structure):
    """Shape of a decoder network; mirrors `struct Net`."""

    _fields_ = [(n, ct.c_int32) for n in ("dim", "octaves", "hidden", "depth", "channels")]


class Entries(ct.Structure):
    """Bilinear taps of every entry; mirrors `struct Entries`."""

    _fields_ = [(n, ct.c_void_p) for n in ("base", "stride", "fx", "fy")]


class Coded(ct.Structure):
    """A coded array; mirrors `struct Coded`."""

    _fields_ = [
        ("words", ct.c_void_p),
        ("n_words", ct.c_int64),
        ("states", ct.c_void_p),
        *((n, ct.c_int32) for n in ("lanes", "channels", "alphabet", "width")),
        *((n, ct.c_void_p) for n in ("y", "x", "bounds")),
        ("waves", ct.c_int64),
        *((n, ct.c_int32) for n in ("scale_bits", "count_start", "count_step", "count_limit")),
        ("known", ct.c_void_p),
    ]


class Points(ct.Structure):
    """Mirrors `struct Points`."""

    _fields_ = [*((n, ct.c_void_p) for n in ("first", "fx", "fy")), ("n", ct.c_int64)]


class Cover(ct.Structure):
    """What covers a rectangle of pixels; mirrors `struct Cover`."""

    _fields_ = [
        *((n, ct.c_int64) for n in ("width", "height", "work", "most")),
        *((n, ct.c_void_p) for n in ("cells", "out")),
    ]


_ADDRESS, _INT, _LONG = ct.c_void_p, ct.c_int32, ct.c_int64

_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "pxi_decode": (_LONG, [ct.POINTER(Coded)]),
    "pxi_rans_encode": (_LONG, [*(_ADDRESS,) * 3, _LONG, _INT, _INT, _ADDRESS, _ADDRESS]),
    "pxi_pyramid_level": (ct.c_int, [_ADDRESS]),
    "pxi_pyramid_synthesis": (ct.c_int, [_ADDRESS]),
    "pxi_forward": (
        None, [ct.POINTER(Net), _ADDRESS, _ADDRESS, ct.POINTER(Entries), _LONG, _ADDRESS],
    ),
    "pxi_sample": (None, [_ADDRESS, _LONG, _INT, ct.POINTER(Points), _ADDRESS]),
    "pxi_coverage": (ct.c_int, [ct.POINTER(Cover), _ADDRESS, _ADDRESS, _LONG]),
    "pxi_blend": (None, [*(_ADDRESS,) * 4, _LONG]),
    "pxi_train": (ct.c_double, [*(_ADDRESS,) * 2, *(_LONG,) * 3, *(_ADDRESS,) * 2]),
}  # fmt: skip
"""Result and arguments of each function; a structure of another module is an address here."""


@functools.cache
def library() -> ct.CDLL | None:
    """The loaded kernel, or None where it was not built or does not load on this machine.

    The environment variable PROXYIMG_NO_KERNEL switches it off: then all is numpy and torch.
    """
    if os.environ.get("PROXYIMG_NO_KERNEL"):
        return None
    for suffix in importlib.machinery.EXTENSION_SUFFIXES:
        path = Path(__file__).with_name("_kernel" + suffix)
        if path.exists():
            return _loaded(path)
    return None


def _loaded(path: Path) -> ct.CDLL | None:
    try:
        lib = ct.CDLL(str(path))
    except OSError:
        return None
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


def available() -> bool:
    """Whether the compiled kernel can be used."""
    return library() is not None


def pointer(array: NDArray[Any]) -> int:
    """Address of a contiguous array, for a `c_void_p` field; the caller keeps the array alive."""
    if not array.flags.c_contiguous:
        raise ValueError("the kernel takes contiguous arrays only")
    return array.ctypes.data


def forward(
    net: Net,
    codes: NDArray[np.float32],
    weights: NDArray[np.float32],
    base: NDArray[np.int32],
    stride: NDArray[np.int32],
    fx: NDArray[np.float32],
    fy: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Network outputs [N, channels] of N entries with taps base [N], stride [N], fx, fy [N].

    Args:
        net: Shape of the network.
        codes: [rows, dim] dequantized codes.
        weights: Flat parameters, per layer [out][in] rows and then the biases.
        base: Row of each entry's upper left code.
        stride: Distance in rows to the code below.
        fx: Horizontal fraction in 0..1.
        fy: Vertical fraction in 0..1.
    """
    lib = library()
    assert lib is not None, "check available() first"
    out = np.empty((len(base), net.channels), np.float32)
    entries = Entries(pointer(base), pointer(stride), pointer(fx), pointer(fy))
    lib.pxi_forward(
        ct.byref(net), pointer(codes), pointer(weights), ct.byref(entries), len(base), pointer(out)
    )
    return out


def sample(
    samples: NDArray[np.float32],
    first: NDArray[np.int32],
    fx: NDArray[np.float32],
    fy: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Interpolates at points, as `texture.pyramid` does in numpy: [N, C].

    Args:
        samples: [h, w, C], C being 3 or 4.
        first: Number of the sample up and left of the four by four that count, of each point [N].
        fx: Horizontal fractions [N] in 0..1.
        fy: Vertical fractions.
    """
    lib = library()
    assert lib is not None, "check available() first"
    _, stride, channels = samples.shape
    out = np.empty((len(first), channels), np.float32)
    at = Points(pointer(first), pointer(fx), pointer(fy), len(first))
    lib.pxi_sample(pointer(samples), stride, channels, ct.byref(at), pointer(out))
    return out


def blend(
    result: NDArray[np.float32],
    clear: NDArray[np.float32],
    colour: NDArray[np.float32],
    coverage: NDArray[np.float32] | None,
) -> None:
    """Puts colours behind what is there, as `render.compose` does in numpy.

    Args:
        result: [N, 4] premultiplied colour and alpha; what is there.
        clear: [N] what that lets through.
        colour: [N, 4] premultiplied.
        coverage: [N] in 0..1, or None for 1.
    """
    lib = library()
    assert lib is not None, "check available() first"
    arrays = (result, clear, colour) if coverage is None else (result, clear, colour, coverage)
    if any(a.dtype != np.float32 for a in arrays):
        raise ValueError("the kernel takes float32 only")
    covered = None if coverage is None else pointer(coverage)
    lib.pxi_blend(pointer(result), pointer(clear), pointer(colour), covered, len(result))


def coverage(
    segments: NDArray[np.int64], log2: NDArray[np.int64], width: int, height: int, most: int
) -> tuple[NDArray[np.int32], int]:
    """Coverage [height, width] of pixels, as `geometry.coverage` computes it in numpy.

    Args:
        segments: Control points [m, 4, 2] in 1/256 pixel.
        log2: Into how many chords each is divided, as a power of two.
        width: Columns.
        height: Rows.
        most: Pieces of chords, in rows and in pixels, after which it stops.

    Returns:
        The coverage, and the number of pieces; with more than `most` of these, the coverage is not
        complete.
    """
    lib = library()
    assert lib is not None, "check available() first"
    cells, out = np.zeros((height, width + 2), np.int64), np.zeros((height, width), np.int32)
    segments = np.ascontiguousarray(segments)
    to = Cover(width, height, 0, most, pointer(cells), pointer(out))
    lib.pxi_coverage(ct.byref(to), pointer(segments), pointer(log2), len(log2))
    return out, to.work


def decode(
    words: NDArray[np.uint16], states: NDArray[np.uint32], scale_bits: int,
    known: NDArray[np.int16], y: NDArray[np.int32], x: NDArray[np.int32],
    bounds: NDArray[np.int64], alphabet: int, adaptation: tuple[int, int, int],
) -> int:  # fmt: skip
    """Decodes symbols into `known` [H + 1, W + 2, C], as `entropy.arrays` does in numpy.

    Args:
        words: The stream, from its first word on.
        states: One of each lane; they move on.
        scale_bits: Frequencies sum to 2**scale_bits.
        known: -1 everywhere.
        y: Rows of the positions, in coding order.
        x: Columns.
        bounds: First position of each wavefront, and the end.
        alphabet: Number of symbols.
        adaptation: Initial count, increment and limit of the counts.

    Returns:
        How many words were used.

    Raises:
        FormatError: The stream ends too early.
    """
    lib = library()
    assert lib is not None, "check available() first"
    task = Coded(
        pointer(words), len(words), pointer(states),
        len(states), known.shape[2], alphabet, known.shape[1] - 2,
        pointer(y), pointer(x), pointer(bounds), len(bounds) - 1,
        scale_bits, *adaptation, pointer(known),
    )  # fmt: skip
    used: int = lib.pxi_decode(ct.byref(task))
    if used < 0:
        raise FormatError("entropy-coded stream ends too early", rule="ENT-6")
    return used


def rans_encode(
    start: NDArray[np.uint16], freq: NDArray[np.uint16], ends: NDArray[np.int64],
    scale_bits: int, states: NDArray[np.uint32],
) -> NDArray[np.uint16]:  # fmt: skip
    """Words of the stream of symbols [N], as `entropy.rans` makes them in numpy.

    Args:
        start: Cumulative frequencies before the symbols.
        freq: Their frequencies.
        ends: Number of symbols up to the end of each group.
        scale_bits: Frequencies sum to 2**scale_bits.
        states: A power of two of states at their start; they move on.
    """
    lib = library()
    assert lib is not None, "check available() first"
    words = np.empty(len(start), np.uint16)
    count = lib.pxi_rans_encode(
        pointer(start), pointer(freq), pointer(ends), len(ends), scale_bits, len(states),
        pointer(states), pointer(words),
    )  # fmt: skip
    return words[len(words) - count :]
