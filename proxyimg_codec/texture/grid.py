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
        if level < cell:
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
