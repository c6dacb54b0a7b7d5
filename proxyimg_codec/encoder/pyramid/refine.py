"""Rate-distortion refinement of latents: by stochastic rounding, then by greedy moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from .goal import FIRST_SHARE, HESITATION, LEAST_GAIN, RAMP, RATE_WEIGHT, SURE
from .model import Likelihood, Model
from .rate import around, bits, bits_of_integers
from .similarity import ms_ssim

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
        bends: Factors of the curvature of the error, as `curvature.bends` gives them, [1, 3, h, w]
            and [1, 1, h, w]; None = 1.
    """

    picture: Tensor
    weight: Tensor | None
    support: Sequence[Tensor] | None
    free: Sequence[Tensor] | None
    step: Tensor
    shifts: Sequence[int] | None = None
    similarity: float | None = None
    price: float = RATE_WEIGHT
    bends: Sequence[Tensor] | None = None


def annealed(share: float) -> float:
    """Factor of the learning rate when a share 0..1 of the steps is done."""
    return 0.475 * (1 + math.cos(math.pi * share)) + 0.05


def temperature(share: float) -> float:
    """Temperature of stochastic rounding when a share 0..1 of the steps is done."""
    return float(0.5 * 0.3**share)


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
        alike = ms_ssim(shown * weight, target.picture * weight, mirror=True)
        return Cost(target.similarity * (1 - alike), spent, likely, target.price)
    # What is beyond 0..255 is shown as these bounds; slopes lead back there all the same.
    shown = shown + (shown.clamp(0, 255) - shown).detach()
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
    model: Model, target: Target, latents: Sequence[Tensor], rounds: int, tick: Callable[[], None],
    done: int = 0,
) -> list[Tensor]:  # fmt: skip
    """Rounds latents, and moves them by one where that lowers the cost, round after round.

    Args:
        model: The model.
        target: Target of the latents.
        latents: Latents of levels 1, 2, ..., then the lowest planes.
        rounds: Number of rounds.
        tick: Called after each round.
        done: Rounds that were made before.

    Returns:
        Integer latents: the best of all rounds.
    """
    now = held([torch.round(y) for y in latents], [torch.round(y) for y in latents], target)
    best, least = now, math.inf
    last = [torch.zeros_like(y) for y in now]
    for turn in range(rounds + 1):
        if 0 < turn == rounds and done + turn < SURE:
            return now
        ys = [y.clone().requires_grad_(True) for y in now]
        with torch.set_grad_enabled(turn < rounds):
            spent = cost(model, target, ys, smooth=False)
        total = spent.total
        if total.item() < least:
            least, best = total.item(), now
        if turn == rounds:
            break
        slopes = torch.autograd.grad(total, ys)
        changes = moves(model, target, now, spent.likely, slopes, done + turn, last)
        now, last = after(now, changes, last)
        tick()
    return best


def after(
    latents: Sequence[Tensor], changes: Sequence[Tensor], last: Sequence[Tensor]
) -> tuple[list[Tensor], list[Tensor]]:
    """Latents after the changes of a round, and the last move of each; see `moves`."""
    made = [torch.where(c != 0, c, v) for c, v in zip(changes, last, strict=True)]
    return [y + c for y, c in zip(latents, changes, strict=True)], made


@torch.no_grad()
def moves(
    model: Model, target: Target, latents: Sequence[Tensor], likely: Sequence[Likelihood],
    slopes: Sequence[Tensor], turn: int, last: Sequence[Tensor],
) -> list[Tensor]:  # fmt: skip
    """Finds the moves of integer latents in a round.

    The change of a latent's own bits is exact. That of the error and of the bits of others is
    estimated from the slope of the cost and the curvature of the error. Neighbours that move
    together may overshoot, so a move has to gain nearly as much as the best of 3 x 3 positions.

    Args:
        model: The model.
        target: Target of the latents.
        latents: Integer latents of levels 1, 2, ..., then the lowest planes.
        likely: Distributions of the latents.
        slopes: Derivatives of the total cost by the latents.
        turn: Number of the round, from 0.
        last: Last move of each latent.

    Returns:
        Changes of the latents: -1, 0 or 1.
    """
    price, out = target.price, []
    share = FIRST_SHARE + (1 - FIRST_SHARE) * min(turn / RAMP, 1)
    for k, p in enumerate(likely):
        own = around(latents[k], *p)
        outer = slopes[k] - price * own.slope
        bend = model.level(k + 1).gains_at(target.step) ** 2
        if target.bends is not None:
            bend = bend * target.bends[k].tile(1, 3, 1, 1)
        down = bend - outer + price * (own.below - own.here)
        up = bend + outer + price * (own.above - own.here)
        change = torch.where(up < down, 1.0, -1.0)
        gain = -torch.minimum(up, down)
        good = (gain > LEAST_GAIN) & ~((last[k] == -change) & (gain < HESITATION))
        gain = gain * good * _allowed(target, k, gain)
        best = F.max_pool2d(gain.amax(1, keepdim=True), 3, 1, 1)
        out.append(change * ((gain > 0) & (gain >= share * best)))
    change = torch.zeros_like(latents[-1])
    if turn == 0:
        # The analysis rounds the lowest planes one by one, which a smooth border may show. All
        # their values count as equally cheap; of those beside each other one moves.
        rows, columns = (torch.arange(n) for n in change.shape[2:])
        some = (rows[:, None] + columns) % 2 == 0
        bend = torch.ones(1) if target.bends is None else target.bends[-1]
        change = -torch.sign(slopes[-1]) * ((slopes[-1].abs() > bend + LEAST_GAIN) & some)
        change = change * _allowed(target, len(likely), change)
    return [*out, change]


def _allowed(target: Target, k: int, like: Tensor) -> Tensor:
    """Mask, 1 for the latents of array `k` that may move."""
    out = torch.ones_like(like)
    if target.free is not None:
        out = out * target.free[k]
    return out if target.support is None else out * target.support[k]
