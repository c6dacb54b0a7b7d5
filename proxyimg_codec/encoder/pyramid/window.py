"""Windows on a raster and its latents, which are refined one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats

WINDOW, MARGIN = 768, 64
"""Side of a window in samples, and margin that it sees beyond that; refinement in windows bounds
memory."""


class Window(NamedTuple):
    """Window on a raster.

    Attributes:
        inner: Rows and columns, in samples, whose latents are decided in this window.
        outer: Rows and columns that it sees: the inner ones and a margin.
        partial: Whether the raster has other windows.
    """

    inner: tuple[slice, slice]
    outer: tuple[slice, slice]
    partial: bool

    @classmethod
    def of(cls, corner: tuple[int, int], side: int, margin: int, shape: tuple[int, int]) -> Window:
        """Makes a window.

        Args:
            corner: First row and column of its inner part.
            side: Most rows and columns of its inner part.
            margin: Most rows and columns that it sees beyond that.
            shape: Rows and columns of the raster.
        """
        inner = [slice(c, min(c + side, n)) for c, n in zip(corner, shape, strict=True)]
        outer = [
            slice(max(s.start - margin, 0), min(s.stop + margin, n))
            for s, n in zip(inner, shape, strict=True)
        ]
        partial = any(s.stop - s.start < n for s, n in zip(inner, shape, strict=True))
        return cls((inner[0], inner[1]), (outer[0], outer[1]), partial)

    @property
    def samples(self) -> int:
        """Number of samples of the inner part."""
        rows, columns = self.inner
        return int((rows.stop - rows.start) * (columns.stop - columns.start))

    @property
    def seen(self) -> int:
        """Number of samples that the window sees."""
        rows, columns = self.outer
        return int((rows.stop - rows.start) * (columns.stop - columns.start))

    def at(self, level: int, inner: bool = False) -> tuple[slice, slice]:
        """Rows and columns of latents of a level that the window sees, or only those `inner`."""
        rows, columns = (
            slice(s.start >> level, -(-s.stop >> level))
            for s in (self.inner if inner else self.outer)
        )
        return rows, columns

    def inside(self, level: int) -> tuple[slice, slice]:
        """Rows and columns of the inner part, among the latents of a level that the window sees."""
        rows, columns = (
            slice((i.start - o.start) >> level, -(-(i.stop - o.start) >> level))
            for i, o in zip(self.inner, self.outer, strict=True)
        )
        return rows, columns

    def mask(self, level: int) -> NDArray[np.bool_]:
        """Mask of the latents of a level that may change: those that no earlier window decided.

        Windows above, and windows to the left in the same rows, are earlier.

        Returns:
            bool [1, h, w] of the latents that the window sees.
        """
        rows, columns = self.at(level)
        i, j = self.inside(level)
        out = np.zeros((1, rows.stop - rows.start, columns.stop - columns.start), bool)
        out[:, i, j.start :] = True
        out[:, i.stop :] = True
        return out

    def keep(self, arrays: list[Floats], found: Sequence[Floats], depths: Sequence[int]) -> None:
        """Copies the inner part of arrays that the window found to the arrays of the raster.

        The margin is left out, because the edges of the window disturb it.

        Args:
            arrays: Arrays [C, h, w] of the raster.
            found: Those of the window.
            depths: Level of each array.
        """
        for whole, new, level in zip(arrays, found, depths, strict=True):
            (i, j), within = self.at(level, inner=True), self.inside(level)
            whole[:, i, j] = new[:, within[0], within[1]]


def windows(shape: tuple[int, ...], levels: int, reach: int = MARGIN) -> list[Window]:
    """Windows that cover a raster, row by row, and see at least `reach` samples beyond.

    Args:
        shape: Rows and columns of the raster.
        levels: Number of levels, whose positions windows do not divide.
        reach: Least number of samples.
    """
    unit = 1 << levels
    rows, columns = shape
    side = max(WINDOW // unit, 1) * unit
    margin = -(-reach // unit) * unit
    return [
        Window.of((top, left), side, margin, (rows, columns))
        for top in range(0, rows, side)
        for left in range(0, columns, side)
    ]
