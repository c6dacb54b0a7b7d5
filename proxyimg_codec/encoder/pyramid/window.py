"""Windows on a raster and its latents, which are refined one after the other."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


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

    def mask(self, level: int) -> Tensor:
        """Mask of the latents of a level that may change: those that no earlier window decided.

        Windows above, and windows to the left in the same rows, are earlier.

        Returns:
            bool [1, 1, h, w] of the latents that the window sees.
        """
        rows, columns = self.at(level)
        i, j = self.inside(level)
        out = torch.zeros(
            (1, 1, rows.stop - rows.start, columns.stop - columns.start), dtype=torch.bool
        )
        out[:, :, i, j.start :] = True
        out[:, :, i.stop :] = True
        return out
