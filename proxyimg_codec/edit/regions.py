"""Parts of layers as masks: where a layer lies at rest, and boundaries traced from such masks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..encoder.shapes.contours import fit_paths
from ..geometry import coverage as cover
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS
from ..model import Layer
from ..texture.implicit import Box

UNIT = 2
"""Unit of traced boundaries: control points are multiples of 2**-UNIT pixel."""

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]


def extent(boundary: Boundary | None, size: tuple[int, int]) -> Box:
    """Rectangle x, y, width, height of whole pixels that holds a layer at rest.

    Args:
        boundary: Boundary of the layer at rest; None for the whole canvas.
        size: Width and height of the canvas in pixels.
    """
    if boundary is None:
        return 0, 0, *size
    x0, y0, x1, y1 = boundary.bounds()
    return x0, y0, max(x1 - x0, 1), max(y1 - y0, 1)


def united(one: Box, other: Box) -> Box:
    """Smallest rectangle that holds two."""
    x0, y0 = min(one[0], other[0]), min(one[1], other[1])
    x1, y1 = (max(one[k] + one[k + 2], other[k] + other[k + 2]) for k in (0, 1))
    return x0, y0, x1 - x0, y1 - y0


def coverage(boundary: Boundary | None, box: Box, scale: int = 1) -> Ints:
    """Coverage of the pixels of a rectangle at rest by a boundary.

    Args:
        boundary: Boundary at rest; None covers everything.
        box: Rectangle x, y, width, height.
        scale: Points across and down a pixel.

    Returns:
        int32 [height * scale, width * scale] in 0..`FULL`.
    """
    x, y, width, height = box
    columns, rows = width * scale, height * scale
    if boundary is None:
        return np.full((rows, columns), cover.FULL, np.int32)
    paths = [
        np.stack(
            [
                cover.to_output(path[:, 0], boundary.unit, x, width, columns),
                cover.to_output(path[:, 1], boundary.unit, y, height, rows),
            ],
            axis=1,
        )
        for path in boundary.paths
    ]
    return cover.coverage(paths, 0, 0, columns, rows)


def at_rest(layer: Layer, wanted: Bools, box: Box, covered: Ints) -> Bools:
    """Part of a layer at rest that lies in a mask when the layer is in its present place.

    Args:
        layer: The layer, which is not bent.
        wanted: bool [H, W], mask on the canvas.
        box: Rectangle x, y, width, height at rest.
        covered: int32 [height, width], what the layer covers of the rectangle.

    Returns:
        bool [height, width], True for pixels that the layer covers and whose centres lie in the
        mask.
    """
    row, column = np.nonzero(covered)
    half = 1 << (FRACTION_BITS - 1)
    points = np.stack([column + box[0], row + box[1]], 1).astype(np.int64)
    points = (points << FRACTION_BITS) + half
    x, y = (layer.pose.apply(points) >> FRACTION_BITS).T
    height, width = wanted.shape
    there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    out = np.zeros(covered.shape, np.bool_)
    out[row[there], column[there]] = wanted[y[there], x[there]]
    return out


def traced(inside: Bools, box: Box, scale: int = 1) -> Boundary:
    """Boundary around a mask, as the encoder fits it.

    Args:
        inside: bool [height * scale, width * scale], not empty.
        box: Rectangle x, y, width, height at rest that the mask lies on.
        scale: Points of the mask across and down a pixel, 1 or 4.
    """
    unit = UNIT if scale == 1 else scale.bit_length()
    step = scale / (1 << unit)
    tolerance = 0.6 if scale == 1 else 1.2
    corner = np.array(box[:2], np.int64) << unit
    paths = fit_paths(inside, tolerance=tolerance, step=step)
    return Boundary(unit, tuple(path + corner for path in paths))


def eroded(mask: Bools, beyond: bool) -> Bools:
    """Mask without the pixels that touch, also at a corner, one that is outside.

    Args:
        mask: bool [H, W].
        beyond: Whether what lies beyond the array counts as inside.
    """
    padded = np.pad(mask, 1, constant_values=beyond)
    rows = padded[:-2] & padded[1:-1] & padded[2:]
    return np.asarray(rows[:, :-2] & rows[:, 1:-1] & rows[:, 2:])


def within(mask: Bools | None, cell: int, part: Box) -> Bools | None:
    """Samples that lie in the cells of the mask of a view, bool [height, width]; None = all.

    Args:
        mask: bool [rows, columns], cells of the part; None = all.
        cell: Base-2 logarithm of the side of a cell in samples.
        part: Part of the raster: x, y, width, height.
    """
    if mask is None:
        return None
    return mask.repeat(1 << cell, 0)[: part[3]].repeat(1 << cell, 1)[:, : part[2]]
