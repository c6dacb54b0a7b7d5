"""Convolutions of the networks: weights of 8 bits, straight-through rounding, bfloat16."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class _Through(torch.autograd.Function):
    """Rounding to multiples of a step within bounds, inside which the gradient passes unchanged."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, step: float, low: float, high: float) -> Tensor:
        ctx.save_for_backward((x >= low * step) & (x <= high * step))
        return (x * (1 / step)).round_().clamp_(low, high).mul_(step)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None, None, None]:
        (inside,) = ctx.saved_tensors
        return grad * inside, None, None, None


def through(x: Tensor, step: float, low: float, high: float) -> Tensor:
    """Rounds `x`, straight through, to multiples of `step` in low * step..high * step."""
    rounded: Tensor = _Through.apply(x, step, low, high)  # type: ignore[no-untyped-call]  # torch's stubs
    return rounded


def weight_step(weights: Tensor) -> float:
    """Smallest power of two in 2**-12..2**-3 in units of which weights are at most 127."""
    most = max(float(weights.detach().abs().max()), 1e-6)
    return 2.0 ** min(max(math.ceil(math.log2(most / 127)), -12), -3)


def eight_bit(weights: Tensor) -> Tensor:
    """Rounds weights to integers in -127..127, in units of the smallest power of two that fits."""
    most = max(float(weights.detach().abs().max()), 1e-6)
    return through(weights, 2.0 ** math.ceil(math.log2(most / 127)), -127, 127)


def convolve(x: Tensor, w: Tensor, b: Tensor | None, pad: tuple[int, int], fast: bool) -> Tensor:
    """Convolves `x` with weights `w`, biases `b` and zero padding `pad`; in bfloat16 if `fast`."""
    if not fast:
        return F.conv2d(x, w, b, padding=pad)
    half = torch.bfloat16
    return F.conv2d(x.to(half), w.to(half), None if b is None else b.to(half), padding=pad)


class Convolution(nn.Conv2d):
    """Convolution with weights of 0: to draw them takes random numbers of the whole process."""

    def reset_parameters(self) -> None:
        """Sets weights and biases to 0."""
        for p in self.parameters():
            nn.init.zeros_(p)


class Residual(nn.Module):
    """Network of three convolutions: 3 x 3, 1 x 1 and 3 x 3. Its initial output is 0.

    Args:
        inputs: Input channels.
        hidden: Width of the hidden layers.
        outputs: Output channels.

    Attributes:
        by_step: [hidden] slope of the biases of the first layer by `log_step`.
    """

    def __init__(self, inputs: int, hidden: int, outputs: int) -> None:
        super().__init__()
        self.first = Convolution(inputs, hidden, 3)
        self.by_step = nn.Parameter(torch.zeros(hidden))
        self.second = Convolution(hidden, hidden, 1)
        self.third = Convolution(hidden, outputs, 3)

    def forward(self, x: Tensor, q: Tensor, fast: bool, quantized: bool = False) -> Tensor:
        """Runs the network.

        Args:
            x: [B, inputs, h, w] inputs.
            q: [B, 1, 1, 1] result of `log_step`.
            fast: Whether convolutions run in bfloat16.
            quantized: Whether to simulate 8-bit weights.

        Returns:
            float32 [B, outputs, h, w].
        """
        first, second, third = (
            eight_bit(layer.weight) if quantized else layer.weight
            for layer in (self.first, self.second, self.third)
        )
        z = convolve(x, first, self.first.bias, (1, 1), fast)
        z = F.relu(z + (self.by_step.view(1, -1, 1, 1) * q).to(z.dtype))
        z = F.relu(convolve(z, second, self.second.bias, (0, 0), fast))
        return convolve(z, third, self.third.bias, (1, 1), fast).float()
