"""The compiled kernel (`kernel.cpp`) behind ctypes: rendering, training, entropy coding.

It is optional: `available()` is false where the package was installed without a C++ compiler.
"""

from __future__ import annotations

import ctypes as ct
import functools
import importlib.machinery
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError

if TYPE_CHECKING:
    from ..entropy.rans import Decoder


class Net(ct.Structure):
    """Shape of a decoder network; mirrors `struct Net`."""

    _fields_ = [(n, ct.c_int32) for n in ("dim", "octaves", "hidden", "depth", "channels")]


class Entries(ct.Structure):
    """Bilinear taps of every entry; mirrors `struct Entries`."""

    _fields_ = [(n, ct.c_void_p) for n in ("base", "stride", "fx", "fy")]


class Train(ct.Structure):
    """A training problem; mirrors `struct Train`."""

    _fields_ = [
        ("net", Net),
        ("entries", Entries),
        ("n_codes", ct.c_int64),
        *((n, ct.c_void_p) for n in ("first", "coverage", "learn", "target")),
        *((n, ct.c_void_p) for n in ("codes", "codes_m", "codes_v")),
        *((n, ct.c_void_p) for n in ("weights", "weights_m", "weights_v")),
        *((n, ct.c_void_p) for n in ("prior_row", "prior_next", "prior_weight")),
        ("n_prior", ct.c_int64),
        *((n, ct.c_void_p) for n in ("plane", "code_steps", "row_steps")),
        *((n, ct.c_int32) for n in ("code_max", "weight_max", "threads")),
    ]


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
            try:
                lib = ct.CDLL(str(path))
            except OSError:
                return None
            lib.pxi_train.restype = ct.c_double
            lib.pxi_train.argtypes = [
                ct.POINTER(Train), ct.c_void_p, ct.c_int64, ct.c_int64, ct.c_int64, ct.c_void_p,
                ct.c_void_p,
            ]  # fmt: skip
            lib.pxi_forward.restype = None
            lib.pxi_forward.argtypes = [
                ct.POINTER(Net), ct.c_void_p, ct.c_void_p, ct.POINTER(Entries), ct.c_int64,
                ct.c_void_p,
            ]  # fmt: skip
            lib.pxi_decode.restype = ct.c_int64
            lib.pxi_decode.argtypes = [ct.POINTER(Coded)]
            lib.pxi_pyramid_level.restype = ct.c_int
            lib.pxi_pyramid_level.argtypes = [ct.c_void_p]
            lib.pxi_pyramid_synthesis.restype = ct.c_int
            lib.pxi_pyramid_synthesis.argtypes = [ct.c_void_p]
            lib.pxi_coverage.restype = ct.c_int
            lib.pxi_coverage.argtypes = [ct.POINTER(Cover), ct.c_void_p, ct.c_void_p, ct.c_int64]
            lib.pxi_sample.restype = None
            lib.pxi_sample.argtypes = [
                ct.c_void_p, ct.c_int64, ct.c_int32, ct.POINTER(Points), ct.c_void_p,
            ]  # fmt: skip
            lib.pxi_blend.restype = None
            lib.pxi_blend.argtypes = [*(ct.c_void_p,) * 4, ct.c_int64]
            lib.pxi_rans_encode.restype = ct.c_int64
            lib.pxi_rans_encode.argtypes = [
                ct.c_void_p, ct.c_void_p, ct.c_void_p, ct.c_int64, ct.c_int32, ct.c_int32,
                ct.c_void_p, ct.c_void_p,
            ]  # fmt: skip
            return lib
    return None


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
    decoder: Decoder,
    known: NDArray[np.int16],
    y: NDArray[np.int32],
    x: NDArray[np.int32],
    bounds: NDArray[np.int64],
    alphabet: int,
    adaptation: tuple[int, int, int],
) -> None:
    """Decodes symbols into `known` [H + 1, W + 2, C], as `entropy.arrays` does in numpy.

    Args:
        decoder: The stream.
        known: -1 everywhere.
        y: Rows of the positions, in coding order.
        x: Columns.
        bounds: First position of each wavefront, and the end.
        alphabet: Number of symbols.
        adaptation: Initial count, increment and limit of the counts.

    Raises:
        FormatError: The stream ends too early.
    """
    lib = library()
    assert lib is not None, "check available() first"
    words, states = decoder.words.astype(np.uint16), decoder.states.astype(np.uint32)
    ys, xs = y.astype(np.int32, copy=False), x.astype(np.int32, copy=False)
    task = Coded(
        pointer(words), len(words), pointer(states),
        decoder.lanes, known.shape[2], alphabet, known.shape[1] - 2,
        pointer(ys), pointer(xs), pointer(bounds), len(bounds) - 1,
        decoder.scale_bits, *adaptation, pointer(known),
    )  # fmt: skip
    used = lib.pxi_decode(ct.byref(task))
    if used < 0:
        raise FormatError("entropy-coded stream ends too early", rule="ENT-6")
    decoder.states[:] = states
    decoder.used = used


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
