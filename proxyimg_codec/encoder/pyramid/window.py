"""Windows on a raster and its latents: what is refined at a time."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Window(NamedTuple):
    """A window: slices of rows and columns of the raster, in samples.

    Attributes:
        inner: What it is responsible for.
        outer: What it sees.
        partial: Whether there are other windows.
    """

    inner: tuple[slice, slice]
    outer: tuple[slice, slice]
    partial: bool

    @classmethod
    def of(cls, corner: tuple[int, int], side: int, margin: int, shape: tuple[int, int]) -> Window:
        """The window at a corner, of a raster of `shape`."""
        inner = [slice(c, min(c + side, n)) for c, n in zip(corner, shape, strict=True)]
        outer = [
            slice(max(s.start - margin, 0), min(s.stop + margin, n))
            for s, n in zip(inner, shape, strict=True)
        ]
        partial = any(s.stop - s.start < n for s, n in zip(inner, shape, strict=True))
        return cls((inner[0], inner[1]), (outer[0], outer[1]), partial)

    @property
    def samples(self) -> int:
        """Samples it is responsible for."""
        rows, columns = self.inner
        return int((rows.stop - rows.start) * (columns.stop - columns.start))

    def at(self, level: int, inner: bool = False) -> tuple[slice, slice]:
        """The window among the latents of a level."""
        rows, columns = (
            slice(s.start >> level, s.stop >> level) for s in (self.inner if inner else self.outer)
        )
        return rows, columns

    def inside(self, level: int) -> tuple[slice, slice]:
        """The inner window within the outer one, among latents of a level."""
        rows, columns = (
            slice((i.start - o.start) >> level, (i.stop - o.start) >> level)
            for i, o in zip(self.inner, self.outer, strict=True)
        )
        return rows, columns

    def mask(self, level: int) -> Tensor:
        """[1, 1, h, w] of a level: what may change, which is what is not settled before it.

        Settled are windows above, and those to the left in the same rows.
        """
        rows, columns = self.at(level)
        i, j = self.inside(level)
        out = torch.zeros(
            (1, 1, rows.stop - rows.start, columns.stop - columns.start), dtype=torch.bool
        )
        out[:, :, i, j.start :] = True
        out[:, :, i.stop :] = True
        return out
