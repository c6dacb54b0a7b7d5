"""Rate-distortion refinement of latents: stochastic rounding, then a greedy one."""

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
"""Squared error, in units of the quantization step squared, that a bit is worth.

High-rate theory gives 2 ln 2 / 12 = 0.116 for uniform quantization; as latents are chosen with
their cost in mind, a finer step with dearer bits is better.
"""

DEAD_ZONE = 0.2
"""How far the analysis' latents are drawn to zero before refinement."""

RATE, BETAS = 0.08, (0.8, 0.95)
"""Adam's rate and averages for latents: large and short, as there are few steps."""


class Target(NamedTuple):
    """What latents should show.

    Attributes:
        picture: [1, 3, H, W] in 0..255, H and W multiples of 2**levels.
        weight: [1, 1, H, W] of the squared error of each sample, or None for 1.
        support: For each level a mask [1, 1, h, w] of its latents, or None for all.
        free: For each level, then the lowest plane, a mask of the latents that may change, or
            None for all.
        step: Quantization step, [1].
        shifts: Shift of the scale index per level: luma, chroma; None = 0.
        similarity: What 1 - MS-SSIM counts, in steps squared, instead of the squared error; None =
            the squared error it is.
    """

    picture: Tensor
    weight: Tensor | None
    support: Sequence[Tensor] | None
    free: Sequence[Tensor] | None
    step: Tensor
    shifts: Sequence[int] | None = None
    similarity: float | None = None


MOVING = 0.35
"""Share of the latents that would gain by a move, that make it in a round."""


def annealed(share: float) -> float:
    """Factor of the rate when `share` of the steps is done."""
    return 0.475 * (1 + math.cos(math.pi * share)) + 0.05


def temperature(share: float) -> float:
    """Temperature of the rounding when `share` of the steps is done."""
    return float(0.5 * 0.3**share)


def shrunk(latents: Sequence[Tensor], by: float) -> list[Tensor]:
    """Latents drawn to zero by at most `by`; the lowest plane stays."""
    return [y - y.clamp(-by, by) for y in latents[:-1]] + [latents[-1]]


def relaxed(latents: Sequence[Tensor], temperature: float) -> list[Tensor]:
    """Latents rounded stochastically: Gumbel annealing (Yang, Bamler, Mandt 2020, section 3)."""
    chosen = []
    for y in latents:
        low = torch.floor(y.detach())
        share = (y - low).clamp(1e-4, 1 - 1e-4)
        # atanh(r) - atanh(1 - r) = log(r (1 + r) ... ) / 2, in one logarithm
        logit = 0.5 * torch.log(share * (1 + share) / ((1 - share) * (2 - share)))
        noise = torch.rand_like(y).clamp(1e-6, 1 - 1e-6)
        gumbel = torch.log(noise / (1 - noise))
        chosen.append(low + torch.sigmoid((logit + gumbel) / temperature))
    return chosen


class Cost(NamedTuple):
    """What latents cost.

    Attributes:
        error: Squared error in steps squared, [B].
        spent: Bits, [B].
        likely: The distributions of levels 1...
    """

    error: Tensor
    spent: Tensor
    likely: list[Likelihood]

    @property
    def total(self) -> Tensor:
        """Error plus `RATE_WEIGHT` a bit, of all pictures."""
        return (self.error + RATE_WEIGHT * self.spent).sum()


def cost(model: Model, target: Target, latents: Sequence[Tensor], smooth: bool = True) -> Cost:
    """Costs of latents; `smooth` if they lie between integers."""
    count = bits if smooth else bits_of_integers
    likely = model.likelihoods(list(latents), target.step, target.shifts)
    masks: Sequence[Tensor | None] = target.support or [None] * len(likely)
    spent = torch.zeros(len(target.step))
    for y, p, mask in zip(latents, likely, masks, strict=False):
        own = count(y, *p)
        spent = spent + (own if mask is None else own * mask).sum((1, 2, 3))
    shown = model.synthesise(list(latents), target.step)
    if target.similarity is not None:
        weight = 1.0 if target.weight is None else target.weight
        alike = ms_ssim(shown * weight, target.picture * weight)
        return Cost(target.similarity * (1 - alike), spent, likely)
    error = (shown - target.picture) ** 2
    if target.weight is not None:
        error = error * target.weight
    return Cost(error.sum((1, 2, 3)) / target.step**2, spent, likely)


@torch.no_grad()
def structural(model: Model, target: Target, latents: Sequence[Tensor]) -> Target:
    """The target with MS-SSIM as its aim, which counts as much as the error of `latents` now."""
    error = cost(model, target, latents, smooth=False).error
    alike = cost(model, target._replace(similarity=1.0), latents, smooth=False).error
    return target._replace(similarity=float(error / alike.clamp_min(1e-6)))


def refined(
    model: Model, target: Target, start: Sequence[Tensor], steps: int, tick: Callable[[], None]
) -> list[Tensor]:
    """Latents after `steps` of stochastic refinement, not yet rounded.

    Args:
        model: The model.
        target: What they should show.
        start: Latents of levels 1.., and the lowest plane.
        steps: Number of steps.
        tick: Called after each; `KeyboardInterrupt` from it, or in it, passes through.
    """
    fixed = [y.detach() for y in start]
    latents = [y.clone().contiguous(memory_format=torch.channels_last) for y in fixed]
    for y in latents:
        y.requires_grad_(True)
    own = torch.optim.Adam(latents, lr=RATE, betas=BETAS, eps=1e-12)
    for turn in range(steps):
        share = turn / steps
        own.param_groups[0]["lr"] = RATE * annealed(share)
        chosen = held(relaxed(latents, temperature(share)), fixed, target)
        own.zero_grad(set_to_none=True)
        cost(model, target, chosen).total.backward()  # type: ignore[no-untyped-call]  # torch's stubs
        own.step()
        tick()
    return held([y.detach() for y in latents], fixed, target)


def held(latents: Sequence[Tensor], fixed: Sequence[Tensor], target: Target) -> list[Tensor]:
    """Latents where they are free and supported, elsewhere as fixed or 0."""
    out = list(latents)
    if target.free is not None:
        out = [torch.where(m, y, f) for y, f, m in zip(out, fixed, target.free, strict=True)]
    if target.support is not None:
        out[:-1] = [y * mask for y, mask in zip(out[:-1], target.support, strict=True)]
    return out


def improved(
    model: Model, target: Target, latents: Sequence[Tensor], rounds: int, seed: int,
    tick: Callable[[], None],
) -> list[Tensor]:  # fmt: skip
    """Integer latents, each moved by one where that lowers the cost, again and again.

    Returns:
        The best of all rounds.
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
        now = held(moved(model, target.step, now, spent.likely, slopes, random), first, target)
        tick()
    return best


@torch.no_grad()
def moved(
    model: Model, step: Tensor, latents: Sequence[Tensor], likely: Sequence[Likelihood],
    slopes: Sequence[Tensor], random: torch.Generator,
) -> list[Tensor]:  # fmt: skip
    """Integer latents after one round of moves by one.

    The change of a latent's own bits is exact; distortion and the bits of others follow the
    slopes of the cost, and the curvature of the former. As neighbours that move together may
    overshoot, only a random part of what would gain moves.
    """
    out = list(latents)
    for k, p in enumerate(likely):
        y = latents[k]
        own = around(y, *p)
        outer = slopes[k] - RATE_WEIGHT * own.slope
        bend = model.level(k + 1).gains_at(step) ** 2
        down = bend - outer + RATE_WEIGHT * (own.below - own.here)
        up = bend + outer + RATE_WEIGHT * (own.above - own.here)
        change = torch.where(up < down, 1.0, -1.0)
        gains = torch.minimum(up, down) < -1e-3
        out[k] = y + change * (gains & (torch.rand(y.shape, generator=random) < MOVING))
    return out
