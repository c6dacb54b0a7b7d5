"""Fill and completion in the compiled kernel (`native/diffusion.h`, `native/completion.h`).

`diffusion`, `completion` and `lifts` are the reference.
"""

from __future__ import annotations

import ctypes as ct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..native import kernel

Values = NDArray[np.int32]
Samples = NDArray[np.bool_]


class _Plane(ct.Structure):
    """Mirrors `struct Plane`."""

    _fields_ = [
        *((n, ct.c_int32) for n in ("channels", "height", "width")),
        *((n, ct.c_void_p) for n in ("values", "known")),
    ]


class _Copies(ct.Structure):
    """Mirrors `struct Copies`."""

    _fields_ = [
        ("plane", _Plane),
        *((n, ct.c_void_p) for n in ("known", "offsets", "sources")),
        *((n, ct.c_int32) for n in ("rows", "columns", "grain", "drift", "most")),
    ]


def diffused(value: Values, known: Samples, done: Samples) -> Values:
    """Fills unknown values as `diffusion.diffused` does, but for tiles that are all `done`.

    Args:
        value: int32 [C, H, W] values.
        known: bool [H, W], True at known positions, of which there is at least one.
        done: bool [H, W], True where the result is not needed.

    Returns:
        int32 [C, H, W].

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    out, known = np.array(value, np.int32, order="C"), np.ascontiguousarray(known)
    done = np.ascontiguousarray(done)
    plane = _Plane(*out.shape, kernel.pointer(out), kernel.pointer(known))
    _checked("diffused", ct.byref(plane), kernel.pointer(done))
    return out


def completed(
    values: Values, known: Samples, grain: int, offsets: NDArray[np.int32],
    sources: NDArray[np.uint8], drift: int, most: int,
) -> tuple[Values, Samples]:  # fmt: skip
    """Completes unknown samples as `completion.completed` does.

    Args:
        values: int32 [C, H, W] samples in 0..`most`, C <= 4.
        known: bool [H, W], True for known samples.
        grain: Binary logarithm of the side of a cell in samples.
        offsets: int32 [N, 2] offsets dx, dy.
        sources: uint8 [rows, columns], for each cell 1 + the number of its offset, or 0.
        drift: Largest correction of a copy.
        most: Largest value.

    Returns:
        int32 [C, H, W] values, and bool [H, W], True for samples known now.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    out, now = np.array(values, np.int32, order="C"), np.array(known, order="C")
    offsets, sources = np.ascontiguousarray(offsets), np.ascontiguousarray(sources)
    plane = _Plane(*out.shape, kernel.pointer(out), kernel.pointer(now))
    copies = _Copies(
        plane, kernel.pointer(now), kernel.pointer(offsets), kernel.pointer(sources),
        *sources.shape, grain, drift, most,
    )  # fmt: skip
    _checked("completed", ct.byref(copies))
    return out, now


def _checked(name: str, *arguments: Any) -> None:
    lib = kernel.library()
    assert lib is not None, "check available() first"
    if getattr(lib, f"pxi_{name}")(*arguments):
        raise LimitError("there is not enough memory to complete what is hidden")
