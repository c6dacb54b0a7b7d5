"""Bits of latents under the tabulated distributions, differentiable."""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import torch
from torch import Tensor

TAIL_SHARE, TAIL_RATIO = 1 / 8, math.e
"""Share and relative scale of the second Laplace distribution of the mixture; spec chapter 8."""

_LEAST = 1e-6


class _Bits(torch.autograd.Function):
    """-log2 of the mass of n and of n + 1, for n - mean and log scale."""

    @staticmethod
    def forward(ctx: Any, offset: Tensor, log_scale: Tensor) -> tuple[Tensor, Tensor]:
        # Mirrored so that n + 1/2 is not below the mean: survival then never cancels.
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
        # By the offset z, the survival falls by the density; by the log scale it gains z times it.
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


def _tails(distance: Tensor, rate: Tensor) -> tuple[Tensor, Tensor]:
    """Halves of the survival functions of both parts of the mixture."""
    near = torch.exp(-distance * rate) * ((1 - TAIL_SHARE) / 2)
    far = torch.exp(distance * rate * (-1 / TAIL_RATIO)) * (TAIL_SHARE / 2)
    return near, far


def bits(values: Tensor, mean: Tensor, log_scale: Tensor) -> Tensor:
    """Bits of latents; between integers, the line that joins the bits of both neighbours."""
    low = torch.floor(values.detach())
    pair: tuple[Tensor, Tensor] = _Bits.apply(low - mean, log_scale)  # type: ignore[no-untyped-call]  # torch's stubs
    return pair[0] + (values - low) * (pair[1] - pair[0])


class _Smooth(torch.autograd.Function):
    """Bits of integers, whose gradient by the value is that of the density."""

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


def bits_of_integers(values: Tensor, mean: Tensor, log_scale: Tensor) -> Tensor:
    """Bits of integer latents; the gradient by `values` is that of the smooth density."""
    found: Tensor = _Smooth.apply(values - mean, log_scale)  # type: ignore[no-untyped-call]  # torch's stubs
    return found


@torch.no_grad()
def bits_at(offset: Tensor, log_scale: Tensor) -> Tensor:
    """Bits of integers that lie `offset` from their mean; no gradient."""
    distance, rate = offset.abs(), torch.exp(-log_scale)
    inner, outer = (sum(_tails((distance + by).abs(), rate)) for by in (-0.5, 0.5))
    inner = torch.where(distance < 0.5, 1 - inner, inner)
    return -torch.log2((inner - outer).clamp_min(_LEAST))


class Around(NamedTuple):
    """Bits of integers and of their neighbours.

    Attributes:
        here, below, above: Bits of n, n - 1 and n + 1.
        slope: Derivative of the bits of n by n.
    """

    here: Tensor
    below: Tensor
    above: Tensor
    slope: Tensor


@torch.no_grad()
def around(values: Tensor, mean: Tensor, log_scale: Tensor) -> Around:
    """Bits around integer latents."""
    offset = values - mean
    rate = torch.exp(-log_scale)
    distance = offset.abs()
    survivals, densities = [], []
    for shift in (-1.5, -0.5, 0.5, 1.5):
        z = distance + shift
        near, far = _tails(z.abs(), rate)
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
