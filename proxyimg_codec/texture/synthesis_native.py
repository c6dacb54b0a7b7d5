"""Synthesis of a level in the compiled kernel (`native/synthesis.h`).

`synthesis` is the reference.
"""

from __future__ import annotations

import ctypes as ct

import numpy as np

from ..errors import LimitError
from ..native import kernel
from .context import Ints
from .grid import Window
from .network import Floats
from .registered_model import Synthesis
from .watch import WATCH, Watch

ARRAYS = (
    "linear", "first", "first_bias", "second", "second_bias", "third", "third_bias", "gain",
)  # fmt: skip


class _Level(ct.Structure):
    """Mirrors `struct Synthesis`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ARRAYS),
        *((n, ct.c_int32) for n in ("hidden", "height", "width", "rows", "columns")),
        *((n, ct.c_void_p) for n in ("low", "latents", "colours", "out")),
        *((n, ct.c_int64) for n in ("low_line", "line", "band", "out_line")),
        *((n, ct.c_int32) for n in ("top", "bottom", "left", "right")),
        ("watch", WATCH),
        ("listener", ct.c_void_p),
    ]


def finer(
    weights: Synthesis, linear: Floats, gain: Floats, bias: Floats, low: Floats, latents: Ints,
    shape: tuple[int, int], part: Window, out: Floats, colours: Floats | None = None,
) -> None:  # fmt: skip
    """Puts the next finer planes of a raster, or the samples that they give.

    Args:
        weights: Weights of the level.
        linear: float32 [12, 12, 5, 5] weights of the linear part.
        gain: float32 [9] gains of the latents for the quantization step.
        bias: float32 [H] biases of the first layer for the quantization step.
        low: float32 [h, w, 3] planes. Of this, `latents` and `out` the rows may lie apart.
        latents: int32 [9, h, w] latents of the level.
        shape: Rows and columns of the finer planes: 2 h or 2 h - 1, and so on.
        part: The part of the finer planes that is made.
        out: float32 array of the shape of the part and 3, for the planes.
        colours: float32 [3, 3] weights of the planes in each component, to put samples in 0..1.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    h, w = low.shape[:2]
    own = {n: getattr(weights, n).floats for n in ARRAYS if n not in ("linear", "gain")}
    own |= {"linear": linear, "gain": gain, "first_bias": bias}
    arrays = [np.ascontiguousarray(own[n], np.float32) for n in ARRAYS]
    if colours is not None:
        colours = np.ascontiguousarray(colours)
    watch = Watch(h * w)
    level = _Level(
        *map(kernel.pointer, arrays), len(bias), h, w, *shape,
        kernel.rows_at(low, 12, 4), kernel.rows_at(latents, 4),
        None if colours is None else kernel.pointer(colours), kernel.rows_at(out, 12, 4),
        low.strides[0] // 4, latents.strides[1] // 4, latents.strides[0] // 4, out.strides[0] // 4,
        *part, watch.function,
    )  # fmt: skip
    wrong = lib.pxi_pyramid_synthesis(ct.byref(level))
    watch.check()
    if wrong:
        raise LimitError("there is not enough memory to decode a pyramid")
