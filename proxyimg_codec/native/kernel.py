"""Binding of the compiled kernel (`kernel.cpp`) by ctypes.

A kernel function whose structure only one module needs is called in that module:
`texture.context_native`, `texture.synthesis_native`, `encoder.implicit.fit_native`. The kernel is
optional: `available()` is False if the package was installed without a C++ compiler. Which of its
levels runs is chosen in `levels`.

Arrays must be contiguous and have the stated type, unless a function says otherwise: the kernel
gets their addresses. Every function here needs the kernel to be available.
"""

from __future__ import annotations

import ctypes as ct
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import SimpleNamespace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from . import levels


class Net(ct.Structure):
    """Shape of a decoder network; mirrors `struct Net`."""

    _fields_ = [(n, ct.c_int32) for n in ("dim", "octaves", "hidden", "depth", "channels")]


class Entries(ct.Structure):
    """Bilinear taps of N points; mirrors `struct Entries`."""

    _fields_ = [(n, ct.c_void_p) for n in ("base", "stride", "fx", "fy")]


class Coded(ct.Structure):
    """Coded array to decode; mirrors `struct Coded`."""

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
    """Points at which samples are interpolated; mirrors `struct Points`."""

    _fields_ = [*((n, ct.c_void_p) for n in ("first", "fx", "fy")), ("n", ct.c_int64)]


class Cover(ct.Structure):
    """Rectangle of pixels whose coverage is computed; mirrors `struct Cover`."""

    _fields_ = [
        *((n, ct.c_int64) for n in ("width", "height", "work", "most")),
        *((n, ct.c_void_p) for n in ("cells", "out")),
    ]


_ADDRESS, _INT, _LONG = ct.c_void_p, ct.c_int32, ct.c_int64

_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "pxi_decode": (_LONG, [ct.POINTER(Coded)]),
    "pxi_rans_encode": (_LONG, [*(_ADDRESS,) * 3, _LONG, _INT, _INT, _ADDRESS, _ADDRESS]),
    "pxi_pyramid_lowest": (ct.c_int, [_ADDRESS]),
    "pxi_pyramid_level": (ct.c_int, [_ADDRESS]),
    "pxi_pyramid_synthesis": (ct.c_int, [_ADDRESS]),
    "pxi_next_plain": (ct.c_int, [_ADDRESS]),
    "pxi_forward": (
        None, [ct.POINTER(Net), _ADDRESS, _ADDRESS, ct.POINTER(Entries), _LONG, _ADDRESS],
    ),
    "pxi_sample": (None, [_ADDRESS, _LONG, _INT, ct.POINTER(Points), _ADDRESS]),
    "pxi_coloured": (None, [_ADDRESS, _ADDRESS, _LONG, _ADDRESS]),
    "pxi_shown": (None, [_ADDRESS, _ADDRESS, _LONG, _ADDRESS]),
    "pxi_coverage": (ct.c_int, [ct.POINTER(Cover), _ADDRESS, _ADDRESS, _LONG]),
    "pxi_diffused": (ct.c_int, [_ADDRESS, _ADDRESS]),
    "pxi_completed": (ct.c_int, [_ADDRESS]),
    "pxi_blend": (None, [*(_ADDRESS,) * 4, _LONG]),
    "pxi_premultiplied": (None, [_ADDRESS, _INT, _LONG, _ADDRESS]),
    "pxi_painted": (None, [_ADDRESS]),
    "pxi_together": (ct.c_int, [_ADDRESS]),
    "pxi_finished": (None, [_ADDRESS, _INT, _LONG, _INT, _INT, _ADDRESS]),
    "pxi_refine": (ct.c_int, [_ADDRESS]),
    "pxi_refine_slopes": (ct.c_int, [_ADDRESS]),
    "pxi_refine_tally": (ct.c_int, [_ADDRESS]),
    "pxi_pyramid_analysis": (ct.c_int, [_ADDRESS]),
    "pxi_train": (ct.c_double, [*(_ADDRESS,) * 2, *(_LONG,) * 3, *(_ADDRESS,) * 2]),
}  # fmt: skip
"""Types of result and arguments of each function; structures of other modules are addresses."""


@functools.cache
def library() -> SimpleNamespace | None:
    """Functions of the kernel for this processor, by their names in `_SIGNATURES`.

    None if the kernel was not built, does not load on this machine, or is switched off
    (`levels.chosen`); then numpy and torch do its work.
    """
    lib, level, _ = levels.chosen()
    if lib is None:
        return None
    functions = {}
    for name, (result, arguments) in _SIGNATURES.items():
        function = functions[name] = getattr(lib, f"{name}_{level}")
        function.restype, function.argtypes = result, arguments
    return SimpleNamespace(**functions)


_allowed = ContextVar("_allowed", default=True)


@contextmanager
def for_engine(engine: str) -> Iterator[None]:
    """Context of work for an engine: within it ``numpy`` does without the kernel everywhere."""
    token = _allowed.set(_allowed.get() and engine != "numpy")
    try:
        yield
    finally:
        _allowed.reset(token)


def available() -> bool:
    """Whether the compiled kernel can be used, and the engine in use allows it."""
    return _allowed.get() and library() is not None


Made = TypeVar("Made")


class Computed(Generic[Made]):
    """Property that is computed when it is first needed: once with the kernel, once without.

    Args:
        make: Function that computes the value from its object.
    """

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self._make = make
        self.__doc__ = make.__doc__

    def __get__(self, instance: Any, owner: Any = None) -> Made:
        if instance is None:
            return self  # type: ignore[return-value]  # for documentation only
        key = f"{self._make.__name__} of {'the kernel' if available() else 'numpy'}"
        values = instance.__dict__
        if key not in values:
            values[key] = self._make(instance)
        found: Made = values[key]
        return found


def pointer(array: NDArray[Any]) -> int:
    """Address of an array for a `c_void_p` field; the caller has to keep the array alive.

    Raises:
        ValueError: The array is not contiguous.
    """
    if not array.flags.c_contiguous:
        raise ValueError("the kernel takes contiguous arrays only")
    return array.ctypes.data


def rows_at(array: NDArray[Any], *inner: int) -> int:
    """Address of an array of 32-bit numbers whose rows may lie apart, for a `c_void_p` field.

    Args:
        array: The array; the caller has to keep it alive.
        inner: Bytes from an item to the next along each of the last axes.

    Raises:
        ValueError: Its rows are not contiguous.
    """
    last = zip(array.shape[-len(inner) :], array.strides[-len(inner) :], inner, strict=True)
    # Steps along axes of one item may be anything.
    if array.itemsize != 4 or any(n > 1 and step != wanted for n, step, wanted in last):
        raise ValueError("the kernel takes contiguous rows only")
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
    """Interpolates codes at N points, and runs the decoder network on them.

    Args:
        net: Shape of the network.
        codes: [rows, dim] dequantized codes.
        weights: All parameters in one dimension: for each layer its weights [out, in], then its
            biases [out].
        base: [N] row in `codes` of the upper left code of each point.
        stride: [N] number of rows from a code to the code below.
        fx: [N] horizontal fractions in 0..1.
        fy: [N] vertical fractions in 0..1.

    Returns:
        float32 [N, channels] outputs, not clamped.
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
    """Interpolates samples at N points, as `texture.pyramid` does in numpy.

    Args:
        samples: [h, w, C] samples, C = 3 or 4.
        first: [N] number (row * w + column) of the upper left one of the 4x4 samples that a point
            is interpolated from.
        fx: [N] horizontal fractions in 0..1.
        fy: [N] vertical fractions in 0..1.

    Returns:
        float32 [N, C] interpolated samples.
    """
    lib = library()
    assert lib is not None, "check available() first"
    _, stride, channels = samples.shape
    out = np.empty((len(first), channels), np.float32)
    at = Points(pointer(first), pointer(fx), pointer(fy), len(first))
    lib.pxi_sample(pointer(samples), stride, channels, ct.byref(at), pointer(out))
    return out


def coloured(planes: NDArray[np.float32], colours: NDArray[np.float32]) -> NDArray[np.float32]:
    """Colours of planes, as `texture.synthesis` computes them in numpy.

    Args:
        planes: float32 [h, w, 3] planes.
        colours: float32 [3, 3] weights of the planes in each component.

    Returns:
        float32 [h, w, 3] samples in 0..255, not clipped.
    """
    lib = library()
    assert lib is not None, "check available() first"
    out, colours = np.empty_like(planes), np.ascontiguousarray(colours)
    lib.pxi_coloured(pointer(planes), pointer(colours), planes.size // 3, pointer(out))
    return out


def shown(
    planes: NDArray[np.float32], colours: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Puts colours of planes, as `coloured` computes them, as samples in 0..1, clipped.

    Args:
        planes: float32 [h, w, 3] planes.
        colours: float32 [3, 3] weights of the planes in each component.
        out: float32 [h, w, 3].
    """
    lib = library()
    assert lib is not None, "check available() first"
    colours = np.ascontiguousarray(colours)
    lib.pxi_shown(pointer(planes), pointer(colours), planes.size // 3, pointer(out))


def blend(
    result: NDArray[np.float32],
    clear: NDArray[np.float32],
    colour: NDArray[np.float32],
    coverage: NDArray[np.float32] | None,
) -> None:
    """Composites a layer behind the layers drawn so far, as `render.compose` does in numpy.

    Args:
        result: float32 [N, 4] premultiplied colour and alpha so far; changed in place.
        clear: float32 [N] share of light that still passes, 0..1; changed in place.
        colour: float32 [N, 4] premultiplied colour and alpha of the layer.
        coverage: float32 [N] coverage of the layer in 0..1; None for 1 everywhere.

    Raises:
        ValueError: An array is not float32, or not contiguous.
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
    """Computes the coverage of pixels, as `geometry.coverage` does in numpy.

    Args:
        segments: [m, 4, 2] control points of Bézier segments in 1/256 pixel, relative to the upper
            left corner; need not be contiguous.
        log2: [m] base-2 logarithm of the number of chords of each segment.
        width: Number of columns.
        height: Number of rows.
        most: Most pieces of chords, in rows and in pixels; beyond it the computation stops.

    Returns:
        int32 [height, width] coverage in 0..`geometry.coverage.FULL`, and the number of pieces; if
        that exceeds `most`, the coverage is incomplete.
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
    """Decodes the symbols of an adaptively coded array, as `entropy.arrays` does in numpy.

    Args:
        words: Words of the stream.
        states: State of each lane; changed in place.
        scale_bits: Frequencies add up to 2**scale_bits.
        known: [H + 1, W + 2, C] filled with -1; the symbols of position y, x are written to
            [y + 1, x + 1].
        y: [N] rows of the positions, in coding order.
        x: [N] columns of the positions.
        bounds: Index of the first position of each wavefront, and N.
        alphabet: Number of symbols.
        adaptation: Initial count, increment and limit of the counts.

    Returns:
        Number of words used.

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
    """Encodes N symbols with interleaved rANS, as `entropy.rans` does in numpy.

    Args:
        start: [N] cumulative frequency before each symbol.
        freq: [N] frequency of each symbol.
        ends: Number of symbols up to the end of each group.
        scale_bits: Frequencies add up to 2**scale_bits.
        states: Initial state of each lane; changed in place. The number of lanes is a power of two.

    Returns:
        uint16 words of the stream.
    """
    lib = library()
    assert lib is not None, "check available() first"
    words = np.empty(len(start), np.uint16)
    count = lib.pxi_rans_encode(
        pointer(start), pointer(freq), pointer(ends), len(ends), scale_bits, len(states),
        pointer(states), pointer(words),
    )  # fmt: skip
    return words[len(words) - count :]
