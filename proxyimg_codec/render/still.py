"""Drawing of layers whose points lie on samples of their raster: no point is interpolated.

That is what a picture at rest, at its own size, is made of, so it has a way of its own, in the
compiled kernel (`native/finish.h`); `compose` is the reference.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import LimitError
from ..geometry import coverage as cover
from ..native import kernel
from ..texture import sampling
from ..texture.grid import Window
from ..texture.network import Floats
from ..texture.occlusion import Moved
from ..texture.pyramid import PyramidTexture
from .cache import Sheet

Box = tuple[int, int, int, int]


class Still(NamedTuple):
    """Points of a rectangle that lie on samples, all of which show.

    Attributes:
        samples: float32 [rows, columns, 1 or 3] raster.
        rows: int64 [h] row of each row of points.
        columns: int64 [w] column of each column of points.
    """

    samples: Floats
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


class _Points(ct.Structure):
    """Mirrors `struct Still`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("samples", "rows", "columns", "at", "colour", "known")),
        *((n, ct.c_int64) for n in ("stride", "width", "start", "n")),
        ("channels", ct.c_int32),
    ]


def find(
    texture: PyramidTexture, x: NDArray[np.float64], y: NDArray[np.float64], box: Box,
    moved: Moved, seen: bool,
) -> Still | None:  # fmt: skip
    """Finds the samples that points lie on.

    Args:
        texture: Texture of the layer, which stands still.
        x: float64 [w] x of the columns of points in canvas pixels, ascending.
        y: float64 [h] y of the rows of points.
        box: Rectangle of the layer in canvas pixels.
        moved: Neighbours that have moved relative to the layer.
        seen: As for `PyramidTexture.sample`.

    Returns:
        The samples; None if not all points lie on samples, or more than those are to be drawn.

    Raises:
        FormatError: The planes are corrupt.
    """
    if texture.alpha is not None or texture.matte is not None:
        return None
    left, top, width, height = texture.part
    column, across = sampling.position(x, box[0], box[2], width)
    row, down = sampling.position(y, box[1], box[3], height)
    if across.any() or down.any() or not (seen or texture.kept(moved) is None):
        return None
    rows, columns = row.astype(np.int64) + top, column.astype(np.int64) + left
    window = Window(int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1)
    return Still(texture.planes.samples(window), rows, columns)


def paint(still: Still, sheet: Sheet, at: NDArray[np.int64]) -> None:
    """Paints samples of a sheet; `at` are their numbers, ascending, from `sheet.start` on."""
    lib = kernel.library()
    assert lib is not None, "check available() first"
    _, stride, channels = still.samples.shape
    arrays: list[NDArray[Any]] = [*still, at, sheet.colour, sheet.known]
    points = _Points(
        *map(kernel.pointer, arrays), stride, len(still.columns), sheet.start, len(at), channels
    )
    lib.pxi_painted(ct.byref(points))


class _Together(ct.Structure):
    """Mirrors `struct Together`."""

    _fields_ = [
        *((n, ct.c_void_p) for n in ("samples", "rows", "columns", "covers", "out")),
        *((n, ct.c_int64) for n in ("stride", "height", "width")),
        *((n, ct.c_int32) for n in ("channels", "layers", "full")),
    ]


def together(still: Still, covers: Sequence[NDArray[np.int32] | None]) -> Floats:
    """Composites layers that show the same samples.

    Args:
        still: The samples.
        covers: For each layer, front to back, int32 [h, w] coverage in 0..`cover.FULL`; None where
            it covers all.

    Returns:
        float32 [h, w, 4] premultiplied colour and alpha.

    Raises:
        LimitError: The kernel cannot allocate what it needs.
    """
    lib = kernel.library()
    assert lib is not None, "check available() first"
    _, stride, channels = still.samples.shape
    height, width = len(still.rows), len(still.columns)
    out = np.empty((height, width, 4), np.float32)
    addresses = [None if v is None else kernel.pointer(v) for v in covers]
    arrays: list[Any] = [kernel.pointer(v) for v in still]
    arrays += [ct.cast((ct.c_void_p * len(covers))(*addresses), ct.c_void_p), kernel.pointer(out)]
    layers = _Together(*arrays, stride, height, width, channels, len(covers), cover.FULL)
    if lib.pxi_together(ct.byref(layers)):
        raise LimitError("there is not enough memory to draw the picture; ask for a smaller one")
    return out
