"""The plain wavelet in the compiled kernel (`native/lifting.h`); `context` is the reference."""

from __future__ import annotations

import ctypes as ct

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..native import kernel

Ints = NDArray[np.int32]


class _Plain(ct.Structure):
    """Mirrors `struct Plain`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("low", "high")),
        *((n, ct.c_int32) for n in ("height", "width", "rows", "columns")),
        ("taps", ct.c_void_p), ("most", ct.c_int32), ("out", ct.c_void_p),
    ]  # fmt: skip


def next_plain(low: Ints, high: Ints, shape: tuple[int, int], taps: Ints, most: int) -> Ints:
    """Computes the next finer planes, as `context.next_plain` does.

    Args:
        low: int32 [3, h, w] in 1/16.
        high: int32 [9, h, w] latents.
        shape: Rows and columns of the finer planes.
        taps: int32 [2, 2, 5] taps of the low and the high bands, for even and odd samples.
        most: Largest magnitude of a result.

    Returns:
        int32 [3, rows, columns] in 1/16.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    low, high, taps = (np.ascontiguousarray(a, np.int32) for a in (low, high, taps))
    out = np.empty((3, *shape), np.int32)
    planes = _Plain(
        kernel.pointer(low), kernel.pointer(high), *low.shape[1:], *shape,
        kernel.pointer(taps), most, kernel.pointer(out),
    )  # fmt: skip
    if lib.pxi_next_plain(ct.byref(planes)):
        raise LimitError("there is not enough memory to decode a pyramid")
    return out
