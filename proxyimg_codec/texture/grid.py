"""Sizes of the planes of a raster, and which latents of a level are coded (spec chapter 8)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import registered_model

Bands = NDArray[np.uint8]

BANDS = ((0, 1), (1, 0), (1, 1))
"""Bands of the three latents of a colour at a position: (vertical, horizontal), 1 = high pass."""


class Window(NamedTuple):
    """Rectangle of a plane: rows `top` .. `bottom` - 1 and columns `left` .. `right` - 1."""

    top: int
    bottom: int
    left: int
    right: int

    @classmethod
    def whole(cls, shape: tuple[int, int]) -> Window:
        """Window of a whole plane of these rows and columns."""
        return cls(0, shape[0], 0, shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left

    @property
    def area(self) -> int:
        """Number of positions."""
        return self.shape[0] * self.shape[1]

    def grown(self, by: int, shape: tuple[int, int]) -> Window:
        """Window with more rows and columns on all sides, as far as a plane of a shape has them."""
        rows, columns = shape
        return Window(
            max(self.top - by, 0), min(self.bottom + by, rows),
            max(self.left - by, 0), min(self.right + by, columns),
        )  # fmt: skip

    def halved(self) -> Window:
        """Window of the next coarser plane that lies over this one."""
        return Window(self.top // 2, -(-self.bottom // 2), self.left // 2, -(-self.right // 2))

    def doubled(self, shape: tuple[int, int]) -> Window:
        """Window of the next finer plane, of a shape, that lies under this one."""
        rows, columns = shape
        return Window(
            2 * self.top, min(2 * self.bottom, rows), 2 * self.left, min(2 * self.right, columns)
        )

    def common(self, other: Window) -> Window:
        """Window of what two windows share, which must not be nothing."""
        return Window(
            max(self.top, other.top), min(self.bottom, other.bottom),
            max(self.left, other.left), min(self.right, other.right),
        )  # fmt: skip

    def inside(self, outer: Window) -> Window:
        """Window in an array of those of an outer one."""
        return Window(
            self.top - outer.top, self.bottom - outer.top,
            self.left - outer.left, self.right - outer.left,
        )  # fmt: skip

    @property
    def at(self) -> tuple[slice, slice]:
        """Rows and columns of the window in an array of the whole plane."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


class Grid(NamedTuple):
    """Sizes of the planes of a raster.

    Attributes:
        size: Columns and rows of the raster, in samples.
        levels: Number of levels.
        padded: Whether planes are as large as those of a raster that is padded to multiples of
            2**levels, as in model 1. Otherwise each level is half as large as the one before,
            rounded up.
    """

    size: tuple[int, int]
    levels: int
    padded: bool = False

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Grid:
        """Grid of the values of a PLAN.

        Raises:
            UnsupportedError: The model is unknown.
        """
        columns, rows = fields["size"]
        padded = registered_model.registration(fields["model"]).padded
        return cls((columns, rows), fields["levels"], padded)

    def at(self, level: int) -> tuple[int, int]:
        """Rows and columns of the positions of a level; at level 0 those of the samples."""
        columns, rows = (
            -(-n >> self.levels) << (self.levels - level) if self.padded else -(-n >> level)
            for n in self.size
        )
        return rows, columns

    def tiles(self, level: int, tile: int) -> list[Window]:
        """Tiles of a level that has restart points, row by row; none if it has no such points.

        Args:
            level: Number of the level, from 1, the finest.
            tile: Binary logarithm of the side of a tile in positions; 0 = no tiles.
        """
        (rows, columns), side = self.at(level), 1 << tile
        if not tile or max(rows, columns) <= side:
            return []
        return [
            Window(y, min(y + side, rows), x, min(x + side, columns))
            for y in range(0, rows, side)
            for x in range(0, columns, side)
        ]

    def bands(self, cells: NDArray[np.bool_], cell: int, level: int) -> Bands:
        """Finds the latents of a level that are coded.

        These are at the positions over a sample of a stored cell; at levels whose positions are no
        smaller than cells, also at the eight around each, as the filters reach so far. A high-pass
        band has one sample less than positions where it halves an odd number of samples.

        Args:
            cells: bool [rows, columns] cells that have latents.
            cell: Binary logarithm of the side of a cell in samples.
            level: Number of the level, from 1, the finest.

        Returns:
            uint8 [h, w] with the shape of the level: bit b is set where the latents of band b of
            `BANDS` are coded.
        """
        over = np.zeros(self.at(level), bool)
        if cells.all():
            over[: -(-self.size[1] >> level), : -(-self.size[0] >> level)] = True
        elif level < cell:
            side = 1 << (cell - level)
            w, h = (-(-n >> level) for n in self.size)
            over[:h, :w] = cells.repeat(side, 0).repeat(side, 1)[:h, :w]
        else:
            i, j = np.nonzero(cells)
            over[i >> (level - cell), j >> (level - cell)] = True
            over = over if self.padded else _grown(over)
        out = over * np.uint8(7)
        rows, columns = self.at(level - 1)
        for band, (down, across) in enumerate(BANDS):
            out[rows // 2 if down else len(out) :] &= ~np.uint8(1 << band)
            out[:, columns // 2 if across else out.shape[1] :] &= ~np.uint8(1 << band)
        return out


def by_channel(bands: Bands) -> NDArray[np.bool_]:
    """Spreads the bits of `bands` [h, w] over the channels 3 * colour + band, bool [9, h, w]."""
    channel = np.arange(9).reshape(9, 1, 1)
    return (bands >> channel % 3 & 1).astype(bool)


def mirrored_indices(size: int, high: bool) -> NDArray[np.int64]:
    """Indices -2..n + 1 of a band, mirrored into itself; int64 [n + 4], n = ceil(size / 2).

    The samples that low and high bands give together are mirrored about the first and the last of
    them. A high band has size // 2 samples.

    Args:
        size: Number of samples of the line that the band is a half of.
        high: Whether it is the high band.
    """
    index = np.arange(-2, (size + 1) // 2 + 2)
    index = np.where(index < 0, -index - int(high), index)
    count = (size + 1 - int(high)) // 2
    index = np.where(index >= count, size - 1 - int(high) - index, index)
    return np.clip(index, 0, max(count - 1, 0))


def _grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Adds the eight neighbours of each position of a mask [h, w]."""
    wide = np.pad(mask, 1)
    tall = wide[:-2] | wide[1:-1] | wide[2:]
    return tall[:, :-2] | tall[:, 1:-1] | tall[:, 2:]
