"""Synthesis of a level in the compiled kernel (`native/synthesis.h`); `synthesis` is its judge."""

from __future__ import annotations

import ctypes as ct

import numpy as np

from ..native import kernel
from .context import Ints
from .network import Floats
from .registered_model import Synthesis

ARRAYS = (
    "linear", "first", "first_bias", "second", "second_bias", "third", "third_bias", "gain",
)  # fmt: skip


class _Level(ct.Structure):
    """Mirrors `struct Synthesis`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ARRAYS),
        *((n, ct.c_int32) for n in ("hidden", "height", "width")),
        *((n, ct.c_void_p) for n in ("low", "latents", "out")),
    ]


def finer(
    weights: Synthesis, linear: Floats, gain: Floats, bias: Floats, low: Floats, latents: Ints
) -> Floats:
    """The next finer planes [2h, 2w, 3].

    Args:
        weights: Of the level.
        linear: Weights of the wavelet [12, 12, 5, 5].
        gain: Of the latents at the step [9].
        bias: Of the first layer at the step [H].
        low: The planes [h, w, 3].
        latents: [9, h, w].
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    h, w = low.shape[:2]
    own = {n: getattr(weights, n).floats for n in ARRAYS if n not in ("linear", "gain")}
    own |= {"linear": linear, "gain": gain, "first_bias": bias}
    arrays = [np.ascontiguousarray(own[n], np.float32) for n in ARRAYS]
    low, latents = np.ascontiguousarray(low), np.ascontiguousarray(latents, np.int32)
    out = np.empty((2 * h, 2 * w, 3), np.float32)
    level = _Level(
        *map(kernel.pointer, arrays), len(bias), h, w, *map(kernel.pointer, (low, latents, out))
    )
    if lib.pxi_pyramid_synthesis(ct.byref(level)):
        raise MemoryError("not enough memory to decode a pyramid")
    return out
