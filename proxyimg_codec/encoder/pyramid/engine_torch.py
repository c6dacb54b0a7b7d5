"""Engine of the encoder in torch: the judge of the compiled one, and what it does not do itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import UnsupportedError
from ...texture.grid import Grid
from ...texture.network import Floats
from .goal import Effort, Goal
from .shifts import SHIFTS
from .window import windows

try:
    # Threads of OpenMP spin, unless OMP_WAIT_POLICY says otherwise when torch is imported; beside
    # one busy process, encoding then takes 5 to 10 times as long. No call changes that later, so a
    # program that imports torch before this module sets the variable itself.
    from ..yielding import torch
    from . import refine
    from .curvature import bends
    from .load import load
    from .model import LOG_SCALES
    from .rate import bits_at
except ModuleNotFoundError as error:
    raise UnsupportedError(
        f"this effort, --tune ms-ssim and encoding without the compiled core need {error.name}: "
        "pip install torch"
    ) from None

REACH = 256
"""Samples that the analysis of a window sees beyond it, as many as its coarsest filters reach."""

SPARSE = (3, 3)
"""Distance of the latents, down and across, from which shifts of the scale index are found."""


def tensor(values: NDArray[np.floating]) -> torch.Tensor:
    """Tensor float32 [1, C, H, W] of an array [C, H, W], with channels last in memory."""
    whole = torch.from_numpy(np.ascontiguousarray(values, np.float32))[None]
    return whole.contiguous(memory_format=torch.channels_last)


def arrays(found: Sequence[torch.Tensor]) -> list[Floats]:
    """Arrays float32 [C, h, w] of tensors [1, C, h, w]."""
    return [np.ascontiguousarray(y.detach()[0].numpy()) for y in found]


@torch.no_grad()
def analysed(number: int, picture: Floats, step: int, grid: Grid, threads: int) -> list[Floats]:
    """Analyses samples, window by window.

    Args:
        number: Number of the model.
        picture: float32 [3, rows, columns] samples in 0..255.
        step: Index s of the quantization step 2**(s / 64).
        grid: Sizes of the planes.
        threads: Number of threads, which torch decides by itself.

    Returns:
        Latents float32 [9, h, w] of levels 1, 2, ..., then the lowest planes, not rounded.
    """
    depths = [*range(1, grid.levels + 1), grid.levels]
    out = [np.zeros((9, *grid.at(level)), np.float32) for level in depths]
    out[-1] = out[-1][:3]
    for box in windows(picture.shape[1:], grid.levels, REACH):
        part = tensor(picture[:, box.outer[0], box.outer[1]])
        found = load(number).analyse(part, torch.tensor([2.0 ** (step / 64)]), grid.levels)
        box.keep(out, arrays(found), depths)
    return out


def improved(
    goal: Goal, latents: Sequence[Floats], effort: Effort, seed: int, threads: int,
    tick: Callable[[], None],
) -> tuple[list[Floats], BaseException | None]:  # fmt: skip
    """Refines latents.

    Args:
        goal: Goal of refinement.
        latents: float32 latents [9, h, w] of levels 1, 2, ..., then the lowest planes.
        effort: Duration of refinement.
        seed: Seed of stochastic rounding.
        threads: Number of threads, which torch decides by itself.
        tick: Called after each step or round.

    Returns:
        The latents, and what `tick` raised, which ended refinement.
    """
    model, best = load(goal.model), list(map(tensor, latents))
    target = target_of(goal)
    try:
        if goal.structural:
            # Moves by one need the curvature of the squared error, so these are steps.
            target = refine.structural(model, target, best)
            random = torch.Generator().manual_seed(seed)  # that of torch is the whole process's
            best = refine.refined(model, target, best, effort.steps, random, tick)
        else:
            best = refine.improved(model, target, best, effort.rounds, tick, goal.done)
    except KeyboardInterrupt as error:
        return arrays(best), error
    return arrays(best), None


def target_of(goal: Goal) -> refine.Target:
    """Goal in tensors."""
    free = None
    if goal.free is not None:
        free = [torch.from_numpy(np.ascontiguousarray(m))[None] for m in goal.free]
    return refine.Target(
        tensor(goal.picture), None if goal.weight is None else tensor(goal.weight[None]),
        None if goal.support is None else list(map(tensor, goal.support)), free,
        torch.tensor([2.0 ** (goal.step / 64)]), goal.shifts, price=goal.price,
        bends=list(map(tensor, bends(goal.picture.shape[1:], len(goal.shifts) // 2, goal.weight))),
    )  # fmt: skip


@torch.no_grad()
def bits_by_shift(goal: Goal, latents: Sequence[Floats], threads: int) -> NDArray[np.float64]:
    """Bits of a sample of integer latents under each shift of the scale index.

    Args:
        goal: Goal of refinement, of which the step, the support and the model count.
        latents: float32 latents [9, h, w] of levels 1, 2, ..., then the lowest planes.
        threads: Number of threads, which torch decides by itself.

    Returns:
        float64 [2 * levels, 16] bits, for luma and chroma of level 1, then of level 2, and so on.
    """
    own = list(map(tensor, latents))
    likely = load(goal.model).likelihoods(own, torch.tensor([2.0 ** (goal.step / 64)]))
    few = np.s_[..., :: SPARSE[0], :: SPARSE[1]]
    out = np.zeros((2 * len(likely), len(SHIFTS)))
    for k, p in enumerate(likely):
        y, mean, scale = (v[few] for v in (own[k], *p))
        mask = torch.ones(1) if goal.support is None else tensor(goal.support[k])[few]
        spent = bits_of(y - mean, scale, mask)
        out[2 * k], out[2 * k + 1] = spent[:, :3].sum(1), spent[:, 3:].sum(1)
    return out


def bits_of(offset: torch.Tensor, log_scale: torch.Tensor, mask: torch.Tensor) -> Floats:
    """Bits float32 [16, C] of latents [1, C, h, w] of each channel under each shift."""
    out = []
    for shift in SHIFTS:
        bits = bits_at(offset, (log_scale + shift / 8).clamp(*LOG_SCALES)) * mask
        out.append(bits.sum((2, 3))[0].numpy())  # the same for any number of threads
    return np.stack(out)
