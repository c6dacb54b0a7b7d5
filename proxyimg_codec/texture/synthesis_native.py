"""Synthesis of a level in the compiled kernel (`native/synthesis.h`).

`synthesis` is the reference.
"""

from __future__ import annotations

import ctypes as ct

import numpy as np

from ..errors import LimitError
from ..native import kernel
from .context import Ints
from .network import Floats
from .registered_model import Synthesis
from .watch import LISTENED, Watch

ARRAYS = (
    "linear", "first", "first_bias", "second", "second_bias", "third", "third_bias", "gain",
)  # fmt: skip


class _Level(ct.Structure):
    """Mirrors `struct Synthesis`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ARRAYS),
        *((n, ct.c_int32) for n in ("hidden", "height", "width", "rows", "columns")),
        *((n, ct.c_void_p) for n in ("low", "latents", "out")),
        ("watch", LISTENED),
        ("listener", ct.c_void_p),
    ]


def finer(
    weights: Synthesis, linear: Floats, gain: Floats, bias: Floats, low: Floats, latents: Ints,
    shape: tuple[int, int],
) -> Floats:  # fmt: skip
    """Computes the next finer planes of a raster.

    Args:
        weights: Weights of the level.
        linear: float32 [12, 12, 5, 5] weights of the linear part.
        gain: float32 [9] gains of the latents for the quantization step.
        bias: float32 [H] biases of the first layer for the quantization step.
        low: float32 [h, w, 3] planes.
        latents: int32 [9, h, w] latents of the level.
        shape: Rows and columns of the finer planes: 2 h or 2 h - 1, and so on.

    Returns:
        float32 [rows, columns, 3] planes.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    h, w = low.shape[:2]
    own = {n: getattr(weights, n).floats for n in ARRAYS if n not in ("linear", "gain")}
    own |= {"linear": linear, "gain": gain, "first_bias": bias}
    arrays = [np.ascontiguousarray(own[n], np.float32) for n in ARRAYS]
    low, latents = np.ascontiguousarray(low), np.ascontiguousarray(latents, np.int32)
    out = np.empty((*shape, 3), np.float32)
    watch = Watch(h * w)
    level = _Level(
        *map(kernel.pointer, arrays), len(bias), h, w, *shape,
        *map(kernel.pointer, (low, latents, out)), watch.function,
    )  # fmt: skip
    wrong = lib.pxi_pyramid_synthesis(ct.byref(level))
    watch.check()
    if wrong:
        raise LimitError("there is not enough memory to decode a pyramid")
    return out
