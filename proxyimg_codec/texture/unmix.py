"""Colours of a layer's own at its boundary, without what lay behind it [PYR-52].

A sample that a boundary crosses is a mixture of the layer's own colour, and of the colour behind.
The latter is about that of samples of the raster beyond the boundary. So outlines and texture stay
up to the rim, where filling it from farther inside would lose them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..native import kernel
from .implicit import Box
from .network import Floats
from .occlusion import Edge, Moved, Occlusion
from .planes import Planes

BEYOND = 3
"""Distance in samples, across and down, up to which samples tell the colour behind."""

Indices = NDArray[np.intp]


class Rim(NamedTuple):
    """Samples at a boundary that have another colour than the raster.

    Attributes:
        places: intp [N] ascending numbers of the samples of the part, row by row.
        values: float32 [N, C] straight components, alpha last if there is any.
    """

    places: Indices
    values: Floats

    def put(self, place: Indices, colour: Floats, alpha: Floats | None) -> None:
        """Puts its values over those of samples.

        Args:
            place: intp [M] numbers of the samples.
            colour: float32 [M, 3] their straight colour.
            alpha: float32 [M, 1] their alpha, or None.
        """
        at = np.searchsorted(self.places, place).clip(max=len(self.places) - 1)
        found = np.flatnonzero(self.places[at] == place)
        values = self.values[at[found]]
        if alpha is not None:
            alpha[found], values = values[:, -1:], values[:, :-1]
        colour[found] = values


def rim(
    planes: Planes, alpha: Planes | None, part: Box, cuts: Occlusion, moved: Moved
) -> Rim | None:
    """Unmixes the samples at a layer's own boundary.

    Args:
        planes: Planes of the colour.
        alpha: Planes of the alpha, or None.
        part: Part of the raster: x, y, width, height in samples.
        cuts: Cuts of the view.
        moved: Neighbours that have moved.

    Returns:
        The rim; None if no sample is unmixed.

    Raises:
        FormatError: The planes are corrupt.
    """
    return _rim(planes, alpha, part, cuts, moved, kernel.available())


@lru_cache(maxsize=16)
def _rim(
    planes: Planes, alpha: Planes | None, part: Box, cuts: Occlusion, moved: Moved, native: bool
) -> Rim | None:
    """Computes `rim`, once with rasters of the kernel, once without, as `native` tells."""
    edge = cuts.edge(moved)
    if edge is None or not len(edge.core):
        return None
    x, y, width, height = part
    rasters = [p.raster[y : y + height, x : x + width] for p in (planes, alpha) if p is not None]
    own = _own(rasters[0], edge)
    inner = np.concatenate([own, *(v.reshape(-1, 1)[edge.core] for v in rasters[1:])], axis=1)
    total, count = np.zeros((len(edge.outer), inner.shape[1])), np.zeros(len(edge.outer))
    for place, inside in _around(edge.outer, 1, height, width):
        at = np.searchsorted(edge.core, place).clip(max=len(edge.core) - 1)
        inside &= edge.core[at] == place
        total += np.where(inside[:, None], inner[at], 0)
        count += inside
    beside = count > 0
    outer = (total[beside] / count[beside, None]).astype(np.float32)
    places = np.concatenate([edge.core, edge.outer[beside]])
    order = np.argsort(places)
    return Rim(places[order], np.concatenate([inner, outer])[order])


def _own(raster: Floats, edge: Edge) -> Floats:
    """Own colours float32 [N, C] of the samples `edge.core` of a raster [height, width, C]."""
    height, width, components = raster.shape
    flat, free = raster.reshape(-1, components), edge.free.ravel()
    mixed = flat[edge.core]
    total, count = np.zeros(mixed.shape), np.zeros((len(mixed), 1))
    for place, inside in _around(edge.core, BEYOND, height, width):
        known = (inside & free[place])[:, None]
        total += np.where(known, flat[place], 0)
        count += known
    share = edge.share[:, None]
    behind = total / np.maximum(count, 1)
    own = ((mixed - (1 - share) * behind) / share).clip(0, 1)
    return np.where(count > 0, own, mixed).astype(np.float32)


def _around(
    place: Indices, reach: int, height: int, width: int
) -> Iterator[tuple[Indices, NDArray[np.bool_]]]:
    """Yields the neighbours of samples, up to `reach` away, and which of them are in the part."""
    row, column = np.divmod(place, width)
    for j, i in product(range(-reach, reach + 1), repeat=2):
        y, x = row + j, column + i
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        yield np.where(inside, y * width + x, 0), inside
