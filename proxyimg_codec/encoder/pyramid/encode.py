"""Encoding of a raster as planes: analysis, refinement in windows, entropy coding."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...native import kernel
from ...texture import planes as coded
from ...texture import synthesis
from ...texture.grid import Grid, by_channel
from ...texture.latents import Latents
from ...texture.network import Floats
from ...texture.planes import Planes
from ...texture.registered_model import registered
from . import engine_native
from .borders import bordered
from .goal import DEAD_ZONE, LEVELS, RATE_WEIGHT, Effort, Goal, shrink
from .shifts import SHIFTS, best_shift
from .window import Window, windows

NUMBER = 2
"""Number of the registered model that is used."""

CELL = 3
"""Base-2 logarithm of the side of a cell of the support, in samples."""

EFFORTS = (
    Effort(1, 1), Effort(2, 2), Effort(6, 3), Effort(15, 4), Effort(45, 6), Effort(80, 8),
    Effort(145, 11), Effort(270, 15), Effort(500, 20),
)  # fmt: skip
"""Duration of refinement at effort 1..9: each takes 1.3 to 1.5 times as long as the one before."""

ALPHA_ROUNDS = 4
"""Least rounds for alpha, in which the moves along its steep edges are made one after the other."""

TRIAL = 2
"""Rounds after which the shifts of the scale index are found again, if at least as many follow."""


class Raster(NamedTuple):
    """Raster to encode.

    Attributes:
        samples: float32 [H, W, 3] samples in 0..255; grey ones have three equal components.
        weight: float32 [H, W] weights of the squared errors; None = 1.
        cells: bool [rows, columns], True for the cells of the support, which have latents; None =
            all.
        grey: Whether only one component is coded.
        structural: Whether to aim at MS-SSIM instead of the squared error.
        alpha: Whether the samples are the alpha of a picture.
    """

    samples: Floats
    weight: Floats | None = None
    cells: NDArray[np.bool_] | None = None
    grey: bool = False
    structural: bool = False
    alpha: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of samples."""
        return self.samples.shape[1], self.samples.shape[0]

    def bordered(self, step: int) -> Raster:
        """Raster with the weights of errors at borders; see `borders`."""
        if self.structural:
            return self
        return self._replace(weight=bordered(self.samples, self.weight, self.alpha, step))

    def effort(self, effort: Effort) -> Effort:
        """Effort for this raster of that for a picture."""
        least = ALPHA_ROUNDS if self.alpha and effort.rounds else 0
        return effort._replace(rounds=max(effort.rounds, least))


def levels_for(size: tuple[int, int]) -> int:
    """Number of levels for a raster of `size` columns and rows: the lowest planes keep a few."""
    return max(min(LEVELS, (max(size) - 1).bit_length() - 2), 1)


def encode(
    raster: Raster, step: int, effort: Effort, seed: int, tick: Callable[[int], None],
    threads: int = 2,
) -> tuple[Planes, bool]:  # fmt: skip
    """Encodes a raster.

    On `KeyboardInterrupt`, in `tick` or elsewhere, refinement stops and its results so far are
    kept.

    Args:
        raster: The raster.
        step: Index s of the quantization step 2**(s / 64).
        effort: Duration of refinement.
        seed: Seed of all random numbers.
        tick: Called with the number of samples of a window after each step of its refinement.
        threads: Number of threads; results do not depend on it.

    Returns:
        The planes, and whether refinement ran to its end.

    Raises:
        LimitError: There is not enough memory.
        UnsupportedError: torch is needed and not installed.
    """
    job = Job(NUMBER, raster.bordered(step), step, threads)
    complete = True
    try:
        for part in job.parts(effort):
            job.refine_all(part, seed, tick)
    except KeyboardInterrupt:
        complete = False
    return job.planes(), complete


def engine(structural: bool = False) -> ModuleType:
    """Module that refines latents: the compiled kernel, else torch, which also aims at MS-SSIM."""
    if kernel.available() and not structural:
        return engine_native
    from . import engine_torch

    return engine_torch


class Job:
    """Latents of a raster that are being refined.

    Attributes:
        picture: float32 [3, rows, columns] samples.
        support: For each level, then for the lowest planes, a mask bool [channels, h, w], False for
            latents that must be 0; None = all True.
        latents: Latents of levels 1, 2, ..., then the lowest planes, float32 [channels, h, w].
        shifts: Shifts of the scale index.
        bits: Estimate of the bits of latents as they were when shifts were found, without those of
            the lowest planes.
        grid: Sizes of the planes.
        count: Number of levels.
        done: Rounds of moves that were made.
        price: Error that a bit is worth, in squares of the step.

    Args:
        number: Number of the registered model.
        raster: The raster.
        step: Index s of the quantization step 2**(s / 64).
        threads: Number of threads.
        grid: Sizes of the planes; by default those of a new raster.
    """

    def __init__(
        self, number: int, raster: Raster, step: int, threads: int = 2, grid: Grid | None = None
    ) -> None:
        self.number, self.raster, self.step, self.threads = number, raster, step, threads
        self.grid = grid or Grid(raster.size, levels_for(raster.size))
        self.count = self.grid.levels
        self.picture = np.asarray(raster.samples, np.float32).transpose(2, 0, 1)
        self.support = self._support()
        self.latents = self._analysed()
        self.done, self.bits, self.price = 0, 0.0, RATE_WEIGHT
        self.shifts: tuple[int, ...] = ()
        self.find_shifts()

    def _support(self) -> list[NDArray[np.bool_]] | None:
        r = self.raster
        unit = 1 << self.count
        if r.cells is None and not r.grey and r.size[0] % unit == r.size[1] % unit == 0:
            return None
        cells = np.ones(coded.cells_of(r.size, CELL), bool) if r.cells is None else r.cells
        masks = []
        for level in range(1, self.count + 1):
            mask = by_channel(self.grid.bands(cells, CELL, level))
            mask[3:] &= not r.grey
            masks.append(mask)
        lowest = np.ones((3, *mask.shape[1:]), np.bool_)
        lowest[1:] = not r.grey
        return [*masks, lowest]

    def _analysed(self) -> list[Floats]:
        """Latents to begin with, not rounded."""
        found = self.analysis(self.picture)
        shrink(found, DEAD_ZONE)
        return self.supported(found)

    def supported(self, latents: list[Floats]) -> list[Floats]:
        """Sets latents to 0 in place where they must be 0, and returns them."""
        if self.support is None:
            return latents
        for y, mask in zip(latents, self.support, strict=True):
            y *= mask
        return latents

    def analysis(self, picture: Floats) -> list[Floats]:
        """Analysis of samples float32 [3, rows, columns]."""
        found: list[Floats] = engine().analysed(
            self.number, picture, self.step, self.grid, self.threads
        )
        return found

    def _depths(self) -> list[int]:
        """Level of each array of latents; the lowest planes have the size of the last level."""
        return [*range(1, self.count + 1), self.count]

    def windows(self) -> list[Window]:
        """Windows in which latents are refined, one after the other."""
        return windows(self.picture.shape[1:], self.count)

    def holds(self, box: Window) -> bool:
        """Whether a window sees any cell of the support."""
        if self.raster.cells is None:
            return True
        rows, columns = (slice(s.start >> CELL, -(-s.stop >> CELL)) for s in box.outer)
        return bool(self.raster.cells[rows, columns].any())

    def parts(self, effort: Effort) -> Iterator[Effort]:
        """Yields parts of refinement; between them, shifts are found for latents as they are."""
        first = 0 if self.raster.structural or effort.rounds < 2 * TRIAL else TRIAL
        if first:
            yield effort._replace(rounds=first)
            self.find_shifts()
        yield effort._replace(rounds=effort.rounds - first)

    def refine_all(self, effort: Effort, seed: int, tick: Callable[[int], None]) -> None:
        """Refines the latents of all windows; adds to the rounds that were made."""
        for window in self.windows():
            if self.holds(window):
                self.refine(window, effort, seed, tick)
            else:
                tick(window.samples * effort.turns(self.raster.structural))
        self.done += effort.rounds

    def refine(self, box: Window, effort: Effort, seed: int, tick: Callable[[int], None]) -> None:
        """Refines the latents of a window; those that earlier windows decided stay."""
        now = self._seen(box, self.latents)
        goal = self._goal(box, now)
        tools = engine(self.raster.structural)
        best, raised = tools.improved(
            goal, now, effort, seed, self.threads, lambda: tick(box.samples)
        )
        box.keep(self.latents, best, self._depths())
        if raised:
            raise raised

    def _goal(self, box: Window, now: list[Floats]) -> Goal:
        """Goal of the latents `now` that a window sees."""
        rows, columns = box.outer
        free = None
        if box.partial:
            masks = map(box.mask, self._depths())
            free = [np.broadcast_to(m, y.shape) for y, m in zip(now, masks, strict=True)]
        support = None
        if self.support is not None:
            support = [mask.astype(np.float32) for mask in self._seen(box, self.support)]
        weight = self.raster.weight
        return Goal(
            self.picture[:, rows, columns], None if weight is None else weight[rows, columns],
            support, free, self.step, self.shifts, self.number, structural=self.raster.structural,
            done=self.done, price=self.price,
        )  # fmt: skip

    def _seen(self, box: Window, arrays: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
        """Parts that a window sees of arrays of levels 1, 2, ..., and of the lowest planes."""
        places = map(box.at, self._depths())
        return [y[:, i, j] for y, (i, j) in zip(arrays, places, strict=True)]

    def rescale(self, step: int) -> None:
        """Takes another quantization step, for which latents are scaled; they are not rounded."""
        finer = np.float32(2 ** ((self.step - step) / 64))
        self.latents[-1] *= finer
        sets = registered(self.number).synthesis
        for k, y in enumerate(self.latents[:-1]):
            own = sets[min(k, len(sets) - 1)]
            ratio = finer * synthesis.gains(own, self.step) / synthesis.gains(own, step)
            y *= ratio[:, None, None]
        self.step = step

    def samples(self) -> Floats:
        """Samples float32 [rows, columns, 3] in 0..1 that the present latents, rounded, show."""
        model = registered(self.number)
        low = np.ascontiguousarray(np.rint(self.latents[-1]).transpose(1, 2, 0), np.float32)
        for level in range(self.count, 0, -1):
            high = np.rint(self.latents[level - 1]).astype(np.int32)
            low = synthesis.finer(model, level, low, high, self.step, self.grid.at(level - 1))
        out = np.empty_like(low)
        synthesis.put_samples(model, low, self.step, 0, out)
        return out

    def planes(self, keep: bool = False) -> Planes:
        """Codes the present latents, rounded.

        Args:
            keep: Whether latents are still needed; otherwise they are gone then, to make room.
        """
        self.find_shifts()
        r, whole = self.raster, list[NDArray[np.int32]]()
        left = list(self.latents) if keep else self.latents
        while left:
            whole.insert(0, np.rint(left.pop()).astype(np.int32))
        return coded.encoded(
            Latents(tuple(whole[:-1]), whole[-1]), r.size, self.step, r.cells, CELL,
            1 if r.grey else 3, self.number, self.shifts, likely=self.bits / 8,
        )  # fmt: skip

    def find_shifts(self) -> None:
        """Finds the shifts with which present latents take the fewest bits, and counts these."""
        self.shifts = (0,) * (2 * self.count)
        tools, each = engine(), list[NDArray[np.float64]]()
        for box in self.windows():
            own = [np.rint(y) for y in self._seen(box, self.latents)]
            each.append(tools.bits_by_shift(self._goal(box, own), own, self.threads))
        self.shifts = tuple(map(best_shift, np.sum(each, axis=0)))
        own_share = [box.samples / box.seen for box in self.windows()]  # what they see overlaps
        chosen = np.tensordot(own_share, each, 1)[
            range(2 * self.count), [v - SHIFTS[0] for v in self.shifts]
        ]
        for k in range(self.count):  # chroma that is 0 in the finest levels is not coded
            if np.rint(self.latents[k][3:]).any():
                break
            chosen[2 * k + 1] = 0
        thinned = [
            math.prod(n / -(-n // by) for n, by in zip(self.grid.at(k), tools.SPARSE, strict=True))
            for k in range(1, self.count + 1)
        ]
        self.bits = float(chosen.reshape(-1, 2).sum(1) @ thinned)
