"""Bits of latents under the tabulated distributions, as differentiable functions.

All arrays have the shape of the latents; `log_scale` is the natural logarithm of the scale.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import torch
from torch import Tensor

TAIL_SHARE, TAIL_RATIO = 1 / 8, math.e
"""Share and relative scale of the second Laplace distribution in the mixture; spec chapter 8."""

_LEAST = 1e-6


class _Bits(torch.autograd.Function):
    """Bits, -log2 of the probability, of n and of n + 1, from n - mean and log scale."""

    @staticmethod
    def forward(ctx: Any, offset: Tensor, log_scale: Tensor) -> tuple[Tensor, Tensor]:
        # Mirrored so that n + 1/2 is not below the mean. Differences of survival functions then
        # lose no digits.
        flip = offset < -0.5
        centre = torch.where(flip, -1 - offset, offset)
        rate = torch.exp(-log_scale)
        survivals, densities = [], []
        for shift in (-0.5, 0.5, 1.5):
            z = centre + shift
            near, far = _tails(z.abs(), rate)
            survival = near + far
            densities.append((near + far / TAIL_RATIO) * rate)
            survivals.append(
                torch.where(z < 0, 1 - survival, survival) if shift < 0.5 else survival
            )
        first = (survivals[0] - survivals[1]).clamp_min(_LEAST)
        second = (survivals[1] - survivals[2]).clamp_min(_LEAST)
        # The derivative of a survival function by z is minus the density; by the log scale it is z
        # times the density.
        moments = [d * (centre + s) for d, s in zip(densities, (-0.5, 0.5, 1.5), strict=True)]
        k = 1 / math.log(2)
        grads = [
            (densities[0] - densities[1]) * (k / first),
            (densities[1] - densities[2]) * (k / second),
            (moments[1] - moments[0]) * (k / first),
            (moments[2] - moments[1]) * (k / second),
        ]
        low = torch.where(flip, second, first)
        high = torch.where(flip, first, second)
        ctx.save_for_backward(flip, *grads)
        return -torch.log2(low), -torch.log2(high)

    @staticmethod
    def backward(ctx: Any, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor]:
        flip, by_first, by_second, scale_first, scale_second = ctx.saved_tensors
        first, second = torch.where(flip, high, low), torch.where(flip, low, high)
        by_offset = first * by_first + second * by_second
        return torch.where(flip, -by_offset, by_offset), first * scale_first + second * scale_second


def _tails(
    distance: Tensor, rate: Tensor, share: Tensor | float = TAIL_SHARE
) -> tuple[Tensor, Tensor]:
    """Survival functions of both parts of the mixture at a distance >= 0 from the mean."""
    near = torch.exp(-distance * rate) * ((1 - share) / 2)
    far = torch.exp(distance * rate * (-1 / TAIL_RATIO)) * (share / 2)
    return near, far


def _share(odds: Tensor | None) -> Tensor | float:
    """Share of the wide part, for what is added to the logarithm of its odds."""
    if odds is None:
        return TAIL_SHARE
    return torch.sigmoid(odds + math.log(TAIL_SHARE / (1 - TAIL_SHARE)))


def bits(values: Tensor, mean: Tensor, log_scale: Tensor) -> Tensor:
    """Bits of latents; those between integers are interpolated linearly."""
    low = torch.floor(values.detach())
    pair: tuple[Tensor, Tensor] = _Bits.apply(low - mean, log_scale)  # type: ignore[no-untyped-call]  # torch's stubs
    return pair[0] + (values - low) * (pair[1] - pair[0])


class _Smooth(torch.autograd.Function):
    """Bits of integers, with the gradient that they have as a smooth function of n - mean."""

    @staticmethod
    def forward(ctx: Any, offset: Tensor, log_scale: Tensor) -> Tensor:
        with torch.enable_grad():
            o, s = offset.detach().requires_grad_(), log_scale.detach().requires_grad_()
            out: Tensor = _Bits.apply(o, s)[0]  # type: ignore[no-untyped-call]  # torch's stubs
            ctx.save_for_backward(*torch.autograd.grad(out.sum(), (o, s)))
        return out.detach()

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor]:
        by_offset: Tensor
        by_scale: Tensor
        by_offset, by_scale = ctx.saved_tensors
        return grad * by_offset, grad * by_scale


def bits_of_integers(
    values: Tensor, mean: Tensor, log_scale: Tensor, odds: Tensor | None = None
) -> Tensor:
    """Bits of integer latents, with the gradient that they have as a smooth function of them.

    Args:
        values: The latents.
        mean: Means.
        log_scale: Natural logarithms of the scales.
        odds: What is added to the logarithm of the odds of the wide part of the mixture, in models
            that choose it; None = 0.
    """
    if odds is not None:
        return _mixed(values - mean, log_scale, odds)
    found: Tensor = _Smooth.apply(values - mean, log_scale)  # type: ignore[no-untyped-call]  # torch's stubs
    return found


def _mixed(offset: Tensor, log_scale: Tensor, odds: Tensor) -> Tensor:
    """Bits of integers that differ from their means by `offset`, differentiable by all."""
    distance, rate, share = offset.abs(), torch.exp(-log_scale), _share(odds)
    near, far = _tails(distance + 0.5, rate, share)
    inner, outer = _tails((distance - 0.5).abs(), rate, share)
    inside = torch.where(distance < 0.5, 1 - inner - outer, inner + outer)
    return -torch.log2((inside - near - far).clamp_min(_LEAST))


@torch.no_grad()
def bits_at(offset: Tensor, log_scale: Tensor) -> Tensor:
    """Bits of integers whose differences from their means are `offset`; without gradient."""
    distance, rate = offset.abs(), torch.exp(-log_scale)
    inner, outer = (sum(_tails((distance + by).abs(), rate)) for by in (-0.5, 0.5))
    inner = torch.where(distance < 0.5, 1 - inner, inner)
    return -torch.log2((inner - outer).clamp_min(_LEAST))


class Around(NamedTuple):
    """Bits of integers n and of their neighbours.

    Attributes:
        here: Bits of n.
        below: Bits of n - 1.
        above: Bits of n + 1.
        slope: Derivative of the bits of n by n.
    """

    here: Tensor
    below: Tensor
    above: Tensor
    slope: Tensor


@torch.no_grad()
def around(values: Tensor, mean: Tensor, log_scale: Tensor, odds: Tensor | None = None) -> Around:
    """Bits of integer latents and of their neighbours; without gradient.

    Arguments are those of `bits_of_integers`.
    """
    share = _share(odds)
    offset = values - mean
    rate = torch.exp(-log_scale)
    distance = offset.abs()
    survivals, densities = [], []
    for shift in (-1.5, -0.5, 0.5, 1.5):
        z = distance + shift
        near, far = _tails(z.abs(), rate, share)
        survivals.append(torch.where(z < 0, 1 - near - far, near + far))
        densities.append(near + far / TAIL_RATIO)
    nearer, here, farther = ((a - b).clamp_min(_LEAST) for a, b in itertools.pairwise(survivals))
    slope = (densities[1] - densities[2]) * rate / (here * math.log(2)) * offset.sign()
    up = offset >= 0
    nearer, farther = -torch.log2(nearer), -torch.log2(farther)
    return Around(
        -torch.log2(here),
        torch.where(up, nearer, farther),
        torch.where(up, farther, nearer),
        slope,
    )
