"""Erasure of samples from coded planes; what is left stays as it was, as far as latents allow.

In place of what goes, the samples around it are continued smoothly. Latents that lie over any of
that are found anew, from this picture alone, so they know nothing of what was there. Those beside
them follow the change as far as their filters reach; all others stay.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from ...texture import planes as coded
from ...texture.context import SHIFT_ORIGIN
from ...texture.grid import Grid, by_channel
from ...texture.latents import Latents
from ...texture.network import Floats
from ...texture.planes import Planes
from ..completion.membrane import continued_from
from .encode import CELL, Job, Raster
from .goal import Effort, Goal
from .window import Window

NUMBER = 2
"""Number of a registered model with the networks that all of them have."""

PRICE = 0.02
"""Error that a bit is worth, in squares of the step; little, as the samples are not an original."""

BLANK = 0.05
"""Weight of errors where samples were erased."""

LAST_SHIFT = 15 - SHIFT_ORIGIN
"""Largest shift of the scale index."""


def erased(planes: Planes, kept: NDArray[np.bool_], effort: Effort, seed: int,
           tick: Callable[[int], None] = lambda samples: None) -> Planes:  # fmt: skip
    """Erases samples from planes.

    Args:
        planes: The planes.
        kept: bool [rows, columns], True for the samples that stay, at least one; the others go.
        effort: Duration of refinement.
        seed: Seed of all random numbers.
        tick: Called with the number of samples of a window after each step of its refinement.

    Returns:
        New planes with the same step and size. `planes` themselves if nothing is to go.

    Raises:
        FormatError: The planes are corrupt.
    """
    gone = ~kept & planes.stored
    if not gone.any():
        return planes
    job = _Erasure(planes, kept, gone)
    for window in job.windows():
        if job.concerns(window):
            job.refine(window, effort, seed, tick)
    return job.planes()


class _Erasure(Job):
    """Latents of planes from which samples are erased.

    Attributes:
        old: The planes.
        gone: bool [rows, columns], True for the samples to erase.
        cell: Base-2 logarithm of the side of a cell of the support.
        cells: bool [rows, columns], True for the cells that keep latents.
        free: For each level, then for the lowest planes, a bool mask of the latents that change.
    """

    def __init__(self, old: Planes, kept: NDArray[np.bool_], gone: NDArray[np.bool_]) -> None:
        self.old, self.gone = old, gone
        self.cell = old.packed["cell"] if old.packed["support"] else CELL
        cells = coded.blocks(kept, self.cell)
        # The filters of what is kept reach into the cells beside.
        self.cells = cv2.dilate(cells.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        if old.packed["support"]:
            left = old.support & self.cells
            self.cells = left if left.any() else old.support
        self.free: list[NDArray[np.bool_]] = []
        grid = Grid.of(old.packed)
        rows, columns = grid.at(0) if grid.padded else gone.shape
        beyond = (0, rows - gone.shape[0]), (0, columns - gone.shape[1])
        before = np.repeat(old.raster * np.float32(255), 3 // old.components, 2)
        after = _blanked(before, kept)
        before = np.pad(before, (*beyond, (0, 0)), mode="edge").transpose(2, 0, 1)
        self.before = np.ascontiguousarray(before)
        after = np.pad(after, (*beyond, (0, 0)), mode="edge")
        weight = np.pad(np.where(kept, 1, BLANK).astype(np.float32), beyond, mode="edge")
        raster = Raster(after, weight, self.cells, old.components == 1)
        super().__init__(NUMBER, raster, old.packed["step"], grid=grid)

    def _support(self) -> list[NDArray[np.bool_]]:
        masks = []
        for level in range(1, self.count + 1):
            mask = by_channel(self.grid.bands(self.cells, self.cell, level))
            mask[3:] &= level > self.old.packed["grey"]
            masks.append(mask)
        lowest = np.ones((3, *mask.shape[1:]), np.bool_)
        lowest[self.old.components :] = False
        return [*masks, lowest]

    def _analysed(self) -> list[Floats]:
        latents = self.old.latents
        found = [y.astype(np.float32) for y in (*latents.levels, latents.lowest)]
        over = [self._over(level) for level in self._depths()]
        # No dead zone: what shows beside the erased samples is to change as little as possible.
        after = self.analysis(self.picture)
        new = self.supported(
            [
                np.where(mask, np.rint(y), old + np.rint(y - before))
                for mask, y, old, before in zip(
                    over, after, found, self.analysis(self.before), strict=True
                )
            ]
        )
        self.free = [
            mask | (y != old).any(0, keepdims=True)
            for mask, y, old in zip(over, new, found, strict=True)
        ]
        return new

    def _over(self, level: int) -> NDArray[np.bool_]:
        """Positions of a level, bool [1, h, w], that lie over samples that go."""
        found = coded.blocks(self.gone, level, self.grid.at(level))
        return found[None]

    def concerns(self, box: Window) -> bool:
        """Whether any latents of a window change."""
        return any(m.any() for m in self._seen(box, self.free))

    def _goal(self, box: Window, now: list[Floats]) -> Goal:
        goal = super()._goal(box, now)
        free = [
            np.broadcast_to(m, y.shape)
            for m, y in zip(self._seen(box, self.free), now, strict=True)
        ]
        if goal.free is not None:
            free = [a & b for a, b in zip(free, goal.free, strict=True)]
        return goal._replace(free=free, price=PRICE)

    def planes(self, keep: bool = True) -> Planes:
        """Codes the present latents, which stay.

        Changed contexts may take a latent that did not change for certainly 0, though it is not.
        Then the scales of its level are shifted until it is coded again, or no more is allowed.
        """
        found = [np.rint(y).astype(np.int32) for y in self.latents]
        packed, shifts = self.old.packed, list(self.shifts)
        fixed = [~m for m in self.free]
        while True:
            made = coded.encoded(
                Latents(tuple(found[:-1]), found[-1]), self.old.size, packed["step"], self.cells,
                self.cell, self.old.components, packed["model"], tuple(shifts), packed["tile"],
            )  # fmt: skip
            lost = [
                2 * k + group
                for k, (y, z, m) in enumerate(zip(found, made.latents.levels, fixed, strict=False))
                for group, at in enumerate((slice(3), slice(3, 9)))
                if ((y != z) & m)[at].any() and shifts[2 * k + group] < LAST_SHIFT
            ]
            if not lost:
                return made
            for at in lost:
                shifts[at] += 1

    def find_shifts(self) -> None:
        """Takes those of the old planes."""
        self.shifts = tuple(v - SHIFT_ORIGIN for v in self.old.packed["shifts"])


def _blanked(samples: Floats, kept: NDArray[np.bool_]) -> Floats:
    """Samples [H, W, C] in which those that are not kept are continued from the others."""
    smooth = continued_from(samples, kept)
    smooth = np.clip(smooth, samples[kept].min(0), samples[kept].max(0))
    return np.where(kept[..., None], samples, smooth).astype(np.float32)
