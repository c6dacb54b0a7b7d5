"""Encoding of a raster as planes: analysis, refinement in windows, entropy coding."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ...texture import planes as coded
from ...texture.grid import Grid, by_channel
from ...texture.latents import Latents
from ...texture.network import Floats
from ...texture.planes import Planes
from . import refine
from .load import load
from .model import LEVELS, Model
from .refine import Target
from .shifts import Sample, best_shift
from .window import Window

NUMBER = 2
"""Number of the registered model that is used."""

CELL = 3
"""Base-2 logarithm of the side of a cell of the support, in samples."""

WINDOW, MARGIN = 768, 64
"""Side of a window in samples, and margin that it sees beyond that; refinement in windows bounds
memory."""

REACH = 256
"""Samples that the analysis of a window sees beyond it, as many as its coarsest filters reach."""

SPARSE = 3
"""Distance of the latents, across and down, from which shifts of the scale index are found."""


class Effort(NamedTuple):
    """Duration of refinement.

    Attributes:
        steps: Steps with stochastic rounding.
        rounds: Rounds of moves by one after them.
    """

    steps: int
    rounds: int


EFFORTS = (
    Effort(0, 1), Effort(0, 2), Effort(0, 6), Effort(0, 15), Effort(0, 45), Effort(0, 80),
    Effort(0, 140), Effort(50, 150), Effort(300, 200),
)  # fmt: skip
"""Duration of refinement at effort 1..9."""


class Raster(NamedTuple):
    """Raster to encode.

    Attributes:
        samples: float32 [H, W, 3] samples in 0..255; grey ones have three equal components.
        weight: float32 [H, W] weights of the squared errors; None = 1.
        cells: bool [rows, columns], True for the cells of the support, which have latents; None =
            all.
        grey: Whether only one component is coded.
        structural: Whether to aim at MS-SSIM instead of the squared error.
    """

    samples: Floats
    weight: Floats | None = None
    cells: NDArray[np.bool_] | None = None
    grey: bool = False
    structural: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of samples."""
        return self.samples.shape[1], self.samples.shape[0]


def levels_for(size: tuple[int, int]) -> int:
    """Number of levels for a raster of `size` columns and rows: the lowest planes keep a few."""
    return max(min(LEVELS, (max(size) - 1).bit_length() - 2), 1)


def encode(
    raster: Raster, step: int, effort: Effort, seed: int, tick: Callable[[int], None]
) -> tuple[Planes, bool]:
    """Encodes a raster.

    On `KeyboardInterrupt`, in `tick` or elsewhere, refinement stops and its results so far are
    kept.

    Args:
        raster: The raster.
        step: Index s of the quantization step 2**(s / 64).
        effort: Duration of refinement.
        seed: Seed of all random numbers.
        tick: Called with the number of samples of a window after each step of its refinement.

    Returns:
        The planes, and whether refinement ran to its end.
    """
    model = load(NUMBER)
    job = Job(model, raster, step)
    complete = True
    random = torch.Generator().manual_seed(seed)  # that of torch belongs to the whole process
    try:
        for window in job.windows():
            if job.holds(window):
                job.refine(window, effort, seed, random, tick)
            else:
                tick(window.samples * (effort.steps + effort.rounds))
    except KeyboardInterrupt:
        complete = False
    return job.planes(), complete


class Job:
    """Latents of a raster that are being refined.

    Attributes:
        picture: [1, 3, rows, columns] samples.
        weight: [1, 1, rows, columns] weights; None = 1.
        support: For each level, then for the lowest planes, a mask [1, channels, h, w], 0 for
            latents that must be 0; None = all 1.
        latents: Latents of levels 1, 2, ..., then the lowest planes.
        shifts: Shifts of the scale index.
        grid: Sizes of the planes.
        count: Number of levels.

    Args:
        model: The model.
        raster: The raster.
        step: Index s of the quantization step 2**(s / 64).
        grid: Sizes of the planes; by default those of a new raster.
    """

    def __init__(self, model: Model, raster: Raster, step: int, grid: Grid | None = None) -> None:
        self.model, self.raster, self.step_index = model, raster, step
        self.step = torch.tensor([2.0 ** (step / 64)])
        self.grid = grid or Grid(raster.size, levels_for(raster.size))
        self.count = self.grid.levels
        self.picture = tensor(raster.samples.transpose(2, 0, 1))
        self.weight = None if raster.weight is None else tensor(raster.weight[None])
        self.support = self._support()
        self.latents = self._analysed()
        self.shifts = self._shifts()

    def _support(self) -> list[Tensor] | None:
        r = self.raster
        unit = 1 << self.count
        if r.cells is None and not r.grey and r.size[0] % unit == r.size[1] % unit == 0:
            return None
        cells = np.ones(coded.cells_of(r.size, CELL), bool) if r.cells is None else r.cells
        masks = []
        for level in range(1, self.count + 1):
            mask = by_channel(self.grid.bands(cells, CELL, level))
            mask[3:] &= not r.grey
            masks.append(tensor(mask.astype(np.float32)))
        lowest = np.ones((3, *mask.shape[1:]), np.float32)
        lowest[1:] *= not r.grey
        return [*masks, tensor(lowest)]

    def _analysed(self) -> list[Tensor]:
        """Latents to begin with, not rounded."""
        return self.supported(refine.shrunk(self.analysis(self.picture), refine.DEAD_ZONE))

    def supported(self, latents: list[Tensor]) -> list[Tensor]:
        """Latents with 0 where they must be 0."""
        if self.support is None:
            return latents
        return [y * mask for y, mask in zip(latents, self.support, strict=True)]

    @torch.no_grad()
    def analysis(self, picture: Tensor) -> list[Tensor]:
        """Analysis of samples [1, 3, rows, columns], window by window."""
        shapes = [self.grid.at(level) for level in self._depths()]
        found = [torch.zeros(1, 9, *shape) for shape in shapes[:-1]]
        found.append(torch.zeros(1, 3, *shapes[-1]))
        for box in self.windows(REACH):
            part = picture[:, :, box.outer[0], box.outer[1]]
            self._keep(box, found, self.model.analyse(part, self.step, self.count))
        return found

    def _depths(self) -> list[int]:
        """Level of each array of latents; the lowest planes have the size of the last level."""
        return [*range(1, self.count + 1), self.count]

    def windows(self, reach: int = MARGIN) -> list[Window]:
        """Windows that cover the raster, row by row, and see at least `reach` samples beyond."""
        unit = 1 << self.count
        _, _, rows, columns = self.picture.shape
        side = max(WINDOW // unit, 1) * unit
        margin = -(-reach // unit) * unit
        return [
            Window.of((top, left), side, margin, (rows, columns))
            for top in range(0, rows, side)
            for left in range(0, columns, side)
        ]

    def holds(self, box: Window) -> bool:
        """Whether a window sees any cell of the support."""
        if self.raster.cells is None:
            return True
        rows, columns = (slice(s.start >> CELL, -(-s.stop >> CELL)) for s in box.outer)
        return bool(self.raster.cells[rows, columns].any())

    def refine(
        self, box: Window, effort: Effort, seed: int, random: torch.Generator,
        tick: Callable[[int], None],
    ) -> None:  # fmt: skip
        """Refines the latents of a window; those that earlier windows decided stay."""
        now = self._seen(box, self.latents)
        target = self._target(box, now)
        if self.raster.structural:
            # Moves by one need the curvature of the squared error, so all turns become steps.
            target = refine.structural(self.model, target, now)
            effort = Effort(effort.steps + effort.rounds, 0)

        def done() -> None:
            tick(box.samples)

        best = now
        try:
            if effort.steps:
                best = refine.refined(self.model, target, now, effort.steps, random, done)
            if effort.rounds:
                best = refine.improved(self.model, target, best, effort.rounds, seed, done)
        finally:
            self._keep(box, self.latents, best)

    def _target(self, box: Window, now: list[Tensor]) -> Target:
        """Target of the latents `now` that a window sees."""
        rows, columns = box.outer
        free = None
        if box.partial:
            masks = map(box.mask, self._depths())
            free = [m.expand(1, y.shape[1], -1, -1) for y, m in zip(now, masks, strict=True)]
        support = None if self.support is None else self._seen(box, self.support)
        weight = None if self.weight is None else self.weight[:, :, rows, columns]
        picture = self.picture[:, :, rows, columns]
        return Target(picture, weight, support, free, self.step, self.shifts)

    def _seen(self, box: Window, arrays: list[Tensor]) -> list[Tensor]:
        """Parts that a window sees of arrays of levels 1, 2, ..., and maybe of lowest planes."""
        places = map(box.at, self._depths())
        return [y[:, :, i, j] for y, (i, j) in zip(arrays, places, strict=False)]

    def _keep(self, box: Window, arrays: list[Tensor], found: list[Tensor]) -> None:
        """Copies the inner part of arrays that a window found to the arrays of the raster.

        The margin is left out, because the edges of the window disturb it.
        """
        for whole, new, level in zip(arrays, found, self._depths(), strict=True):
            (i, j), within = box.at(level, inner=True), box.inside(level)
            whole[:, :, i, j] = new[:, :, within[0], within[1]]

    def planes(self) -> Planes:
        """Codes the present latents, rounded."""
        found = [torch.round(y) for y in self.latents]
        whole = [y[0].numpy().astype(np.int32) for y in found]
        r = self.raster
        return coded.encoded(
            Latents(tuple(whole[:-1]), whole[-1]), r.size, self.step_index, r.cells, CELL,
            1 if r.grey else 3, NUMBER, self._shifts(),
        )  # fmt: skip

    @torch.no_grad()
    def _shifts(self) -> tuple[int, ...]:
        """Shifts of the scale index with which the present latents take the fewest bits."""
        samples: list[list[Sample]] = [[] for _ in range(2 * self.count)]
        few = slice(None, None, SPARSE)
        for box in self.windows():
            own = [torch.round(y) for y in self._seen(box, self.latents)]
            for k, p in enumerate(self.model.likelihoods(own, self.step)):
                y, mean, scale = (v[:, :, few, few] for v in (own[k], *p))
                mask = torch.ones(1, 9, 1, 1)
                if self.support is not None:
                    a = box.at(k + 1)
                    mask = self.support[k][:, :, a[0], a[1]][:, :, few, few]
                for group, at in enumerate((slice(3), slice(3, 9))):
                    part = Sample(y[:, at] - mean[:, at], scale[:, at], mask[:, at])
                    samples[2 * k + group].append(part)
        return tuple(best_shift(part) for part in samples)


def tensor(values: NDArray[np.floating]) -> Tensor:
    """Tensor float32 [1, C, H, W] of an array [C, H, W], with channels last in memory."""
    whole = torch.from_numpy(np.ascontiguousarray(values, np.float32))[None]
    return whole.contiguous(memory_format=torch.channels_last)
