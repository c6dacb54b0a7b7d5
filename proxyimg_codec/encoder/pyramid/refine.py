"""Rate-distortion refinement of latents: by stochastic rounding, then by greedy moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from .model import Likelihood, Model
from .rate import around, bits, bits_of_integers
from .similarity import ms_ssim

RATE_WEIGHT = 0.15
"""Squared error, in squares of the quantization step, that a bit is worth.

High-rate theory gives 2 ln 2 / 12 = 0.116 for uniform quantization. Here latents are chosen by
their cost, so a finer step with dearer bits is better.
"""

DEAD_ZONE = 0.2
"""Distance by which latents of the analysis are moved towards zero before refinement."""

RATE, BETAS = 0.08, (0.8, 0.95)
"""Learning rate and averages of Adam for latents: large and short, because there are few steps."""


class Target(NamedTuple):
    """Target of refinement: pictures that latents should show, and restrictions on the latents.

    Attributes:
        picture: [B, 3, H, W] pictures in 0..255.
        weight: [B, 1, H, W] weights of the squared errors of samples; None = 1.
        support: For each level, then for the lowest planes, a float mask [1, channels, h, w], 0 for
            latents that must be 0, else 1; None = all 1.
        free: For each level, then for the lowest planes, a bool mask of the latents that may
            change; None = all.
        step: [B] quantization steps.
        shifts: Shifts of the scale index for luma and chroma of level 1, then of level 2, and so
            on; None = 0.
        similarity: Weight of 1 - MS-SSIM, in squares of the step, as the error; None to use the
            squared error instead.
        price: Error that a bit is worth, in squares of the step.
    """

    picture: Tensor
    weight: Tensor | None
    support: Sequence[Tensor] | None
    free: Sequence[Tensor] | None
    step: Tensor
    shifts: Sequence[int] | None = None
    similarity: float | None = None
    price: float = RATE_WEIGHT


MOVING = 0.35
"""Share of the latents that gain by a move, which make it in a round."""


def annealed(share: float) -> float:
    """Factor of the learning rate when a share 0..1 of the steps is done."""
    return 0.475 * (1 + math.cos(math.pi * share)) + 0.05


def temperature(share: float) -> float:
    """Temperature of stochastic rounding when a share 0..1 of the steps is done."""
    return float(0.5 * 0.3**share)


def shrunk(latents: Sequence[Tensor], by: float) -> list[Tensor]:
    """Moves latents towards zero by at most `by`; the lowest planes, which are last, stay."""
    return [y - y.clamp(-by, by) for y in latents[:-1]] + [latents[-1]]


def relaxed(latents: Sequence[Tensor], temperature: float, random: torch.Generator) -> list[Tensor]:
    """Rounds latents stochastically, by Gumbel annealing (Yang, Bamler, Mandt 2020, section 3).

    Args:
        latents: Latents.
        temperature: Temperature; near 0, results are near integers.
        random: Generator that chooses the integers.

    Returns:
        Latents between the integers beside them, differentiable.
    """
    chosen = []
    for y in latents:
        low = torch.floor(y.detach())
        share = (y - low).clamp(1e-4, 1 - 1e-4)
        # atanh(r) - atanh(1 - r) with a single logarithm
        logit = 0.5 * torch.log(share * (1 + share) / ((1 - share) * (2 - share)))
        noise = torch.empty_like(share).uniform_(generator=random).clamp_(1e-6, 1 - 1e-6)
        gumbel = torch.log(noise / (1 - noise))
        chosen.append(low + torch.sigmoid((logit + gumbel) / temperature))
    return chosen


class Cost(NamedTuple):
    """Cost of the latents of B pictures.

    Attributes:
        error: [B] squared errors in squares of the step.
        spent: [B] bits, without those of the lowest planes.
        likely: Distributions of the latents of levels 1, 2, ...
        price: Error that a bit is worth, in squares of the step.
    """

    error: Tensor
    spent: Tensor
    likely: list[Likelihood]
    price: float

    @property
    def total(self) -> Tensor:
        """Error plus `price` times bits, summed over the pictures."""
        return (self.error + self.price * self.spent).sum()


def cost(model: Model, target: Target, latents: Sequence[Tensor], smooth: bool = True) -> Cost:
    """Computes the cost of latents.

    Args:
        model: The model.
        target: Target of the latents.
        latents: Latents of levels 1, 2, ..., then the lowest planes.
        smooth: Whether latents may lie between integers.
    """
    count = bits if smooth else bits_of_integers
    likely = model.likelihoods(list(latents), target.step, target.shifts)
    masks: Sequence[Tensor | None] = target.support or [None] * len(likely)
    spent = torch.zeros(len(target.step))
    for y, p, mask in zip(latents, likely, masks, strict=False):
        own = count(y, *p)
        spent = spent + sums(own if mask is None else own * mask)
    shown = model.synthesise(list(latents), target.step, target.picture.shape[2:])
    if target.similarity is not None:
        weight = 1.0 if target.weight is None else target.weight
        alike = ms_ssim(shown * weight, target.picture * weight)
        return Cost(target.similarity * (1 - alike), spent, likely, target.price)
    error = (shown - target.picture) ** 2
    if target.weight is not None:
        error = error * target.weight
    return Cost(sums(error) / target.step**2, spent, likely, target.price)


def sums(x: Tensor) -> Tensor:
    """Sums [B] of [B, C, h, w], the same for any number of threads: no channel is divided."""
    return x.sum((2, 3)).sum(1)


@torch.no_grad()
def structural(model: Model, target: Target, latents: Sequence[Tensor]) -> Target:
    """Makes a target that aims at MS-SSIM, with a weight by which the error of `latents` stays."""
    error = cost(model, target, latents, smooth=False).error
    alike = cost(model, target._replace(similarity=1.0), latents, smooth=False).error
    return target._replace(similarity=float(error / alike.clamp_min(1e-6)))


def refined(
    model: Model, target: Target, start: Sequence[Tensor], steps: int, random: torch.Generator,
    tick: Callable[[], None],
) -> list[Tensor]:  # fmt: skip
    """Refines latents by gradient descent with stochastic rounding.

    Args:
        model: The model.
        target: Target of the latents.
        start: Latents of levels 1, 2, ..., then the lowest planes.
        steps: Number of steps.
        random: Generator of the stochastic rounding.
        tick: Called after each step; `KeyboardInterrupt`, from there or elsewhere, passes through.

    Returns:
        Latents that are not rounded yet.
    """
    fixed = [y.detach() for y in start]
    latents = [y.clone().contiguous(memory_format=torch.channels_last) for y in fixed]
    for y in latents:
        y.requires_grad_(True)
    own = torch.optim.Adam(latents, lr=RATE, betas=BETAS, eps=1e-12)
    for turn in range(steps):
        share = turn / steps
        own.param_groups[0]["lr"] = RATE * annealed(share)
        chosen = held(relaxed(latents, temperature(share), random), fixed, target)
        own.zero_grad(set_to_none=True)
        cost(model, target, chosen).total.backward()  # type: ignore[no-untyped-call]  # torch's stubs
        own.step()
        tick()
    return held([y.detach() for y in latents], fixed, target)


def held(latents: Sequence[Tensor], fixed: Sequence[Tensor], target: Target) -> list[Tensor]:
    """Replaces latents that may not change by those in `fixed`, and those without support by 0."""
    out = list(latents)
    if target.free is not None:
        out = [torch.where(m, y, f) for y, f, m in zip(out, fixed, target.free, strict=True)]
    if target.support is not None:
        out = [y * mask for y, mask in zip(out, target.support, strict=True)]
    return out


def improved(
    model: Model, target: Target, latents: Sequence[Tensor], rounds: int, seed: int,
    tick: Callable[[], None],
) -> list[Tensor]:  # fmt: skip
    """Rounds latents, and moves them by one where that lowers the cost, round after round.

    Args:
        model: The model.
        target: Target of the latents.
        latents: Latents of levels 1, 2, ..., then the lowest planes.
        rounds: Number of rounds.
        seed: Seed of the choice of moves.
        tick: Called after each round.

    Returns:
        Integer latents: the best of all rounds.
    """
    random = torch.Generator().manual_seed(seed)
    now = held([torch.round(y) for y in latents], [torch.round(y) for y in latents], target)
    first = best = now
    least = math.inf
    for turn in range(rounds + 1):
        ys = [y.clone().requires_grad_(True) for y in now]
        with torch.set_grad_enabled(turn < rounds):
            spent = cost(model, target, ys, smooth=False)
        total = spent.total
        if total.item() < least:
            least, best = total.item(), now
        if turn == rounds:
            break
        slopes = torch.autograd.grad(total, ys)
        # The analysis rounds the lowest planes one by one, which a smooth border may show.
        found = moved(
            model, target.step, now, spent.likely, slopes, random, turn == 0, target.price
        )
        now = held(found, first, target)
        tick()
    return best


@torch.no_grad()
def moved(
    model: Model, step: Tensor, latents: Sequence[Tensor], likely: Sequence[Likelihood],
    slopes: Sequence[Tensor], random: torch.Generator, settle: bool, price: float = RATE_WEIGHT,
) -> list[Tensor]:  # fmt: skip
    """Makes one round of moves of integer latents by one.

    The change of a latent's own bits is exact. That of the error and of the bits of others is
    estimated from the slope of the cost and the curvature of the error. Neighbours that move
    together may overshoot, so only a random part of the latents that would gain moves.

    Args:
        model: The model.
        step: [B] quantization steps.
        latents: Integer latents of levels 1, 2, ..., then the lowest planes.
        likely: Distributions of the latents.
        slopes: Derivatives of the total cost by the latents.
        random: Generator that chooses the latents that move.
        settle: Whether the lowest planes move too, whose values all count as equally cheap.
        price: Error that a bit is worth, in squares of the step.
    """
    out = list(latents)
    for k, p in enumerate(likely):
        y = latents[k]
        own = around(y, *p)
        outer = slopes[k] - price * own.slope
        bend = model.level(k + 1).gains_at(step) ** 2
        down = bend - outer + price * (own.below - own.here)
        up = bend + outer + price * (own.above - own.here)
        change = torch.where(up < down, 1.0, -1.0)
        gains = torch.minimum(up, down) < -1e-3
        out[k] = y + change * (gains & (torch.rand(y.shape, generator=random) < MOVING))
    if settle:
        lowest, slope = latents[-1], slopes[-1]
        some = torch.rand(lowest.shape, generator=random) < MOVING
        out[-1] = lowest - torch.sign(slope) * ((slope.abs() > 1 + 1e-3) & some)
    return out
