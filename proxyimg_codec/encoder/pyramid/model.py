"""Model of pyramid textures in torch: analysis, synthesis and context, for training and refinement.

Arrays are tensors; B counts pictures. Latents of a level have 9 channels 3 * colour + band.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .convolutions import Convolution, Residual, convolve, eight_bit, through, weight_step
from .goal import LEVELS
from .wavelet import (
    Size,
    analysis_weights,
    extended,
    merged,
    reflected,
    synthesis_weights,
)

SHARED_FROM = 4
"""Levels from this one on share their weights."""

STEP = 1 / 32
"""Quantization step of the 8-bit activations of the context network."""

LOG_SCALES = (-4.0, 3.875)
"""Range of the natural logarithm of a scale; the tables have steps of 1/8."""


class Likelihood(NamedTuple):
    """Distributions of the latents of one level.

    Attributes:
        mean: [B, 9, h, w] means.
        log_scale: [B, 9, h, w] natural logarithms of the scales.
    """

    mean: Tensor
    log_scale: Tensor


def squash(x: Tensor) -> Tensor:
    """Signed feature x / (1 + |x| / 4) of a difference or a latent, in -4..4."""
    return x / (1 + x.abs() / 4)


def soft(x: Tensor) -> Tensor:
    """Input x / (1 + |x| / 8) of the synthesis and analysis networks, in -8..8."""
    return x / (1 + x.abs() / 8)


def high_pass(x: Tensor) -> Tensor:
    """Subtracts from planes [B, C, h, w] the mean of 3 x 3 samples around, with edges repeated."""
    return x - F.avg_pool2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), 3, 1)


class Model(nn.Module):
    """Weights of all levels, which are 0 until they are loaded, and colour transforms.

    Args:
        hidden: Width of the hidden layers of synthesis and analysis.
        context: Width of the hidden layers of the context network.

    Attributes:
        levels: Weights of the levels; the last are shared by all coarser levels.
        to_planes: [3, 3] colour transform of the analysis.
        to_colour: [3, 3] colour transform of the synthesis.
    """

    def __init__(self, hidden: int = 32, context: int = 32) -> None:
        super().__init__()
        self.levels = nn.ModuleList(Level(hidden, context) for _ in range(SHARED_FROM))
        colour = torch.tensor([[1.0, 1, 1], [1, 0, -1], [1, -2, 1]])
        colour /= colour.norm(dim=1, keepdim=True)
        self.to_planes = nn.Parameter(colour.clone())
        self.to_colour = nn.Parameter(colour.t().clone())

    @property
    def sizes(self) -> tuple[int, int]:
        """Width of the hidden layers of the synthesis, and of the context network."""
        level = self.level(1)
        return level.synthesis.second.weight.shape[0], level.mix.weight.shape[0]

    def level(self, number: int) -> Level:
        """Weights of a level; 1 is the finest."""
        return self.levels[min(number, SHARED_FROM) - 1]  # type: ignore[return-value]  # torch's stubs

    def set_mode(self, *, integer: bool | None = None, fast: bool | None = None) -> None:
        """Sets modes of all levels; those that are None stay as they are.

        Args:
            integer: Whether to simulate the integers of the decoder: 8-bit weights, and activations
                and outputs of the context network on their grids.
            fast: Whether convolutions of the networks run in bfloat16.
        """
        for level in self.levels:
            assert isinstance(level, Level)
            level.integer = level.integer if integer is None else integer
            level.fast = level.fast if fast is None else fast

    def analyse(self, picture: Tensor, step: Tensor, levels: int = LEVELS) -> list[Tensor]:
        """Finds the latents of pictures, not rounded.

        Args:
            picture: [B, 3, H, W] pictures in 0..255.
            step: [B] quantization steps.
            levels: Number of levels.

        Returns:
            Latents [B, 9, h, w] of levels 1, 2, ..., then the lowest planes [B, 3, h, w]. Where a
            level halves an odd number of samples, those that `Grid.bands` does not have are to be
            replaced by 0.
        """
        scale = step.view(-1, 1, 1, 1)
        q = log_step(step)
        low = torch.einsum("ij,bjhw->bihw", self.to_planes, (picture - 128) / scale)
        latents = []
        for number in range(1, levels + 1):
            level = self.level(number)
            low, high = level.analyse(low, q)
            latents.append(high / level.gains(q))
        return [*latents, low]

    def likelihoods(
        self, latents: list[Tensor], step: Tensor, shifts: Sequence[int] | None = None
    ) -> list[Likelihood]:
        """Finds the distributions of latents, without those of the lowest planes.

        Args:
            latents: Latents [B, 9, h, w] of levels 1, 2, ..., then the lowest planes.
            step: [B] quantization steps.
            shifts: Shifts of the scale index for luma and chroma of level 1, then of level 2, and
                so on; None = 0.

        Returns:
            Distributions of levels 1, 2, ...
        """
        q = log_step(step)
        low = latents[-1]
        parent = torch.zeros_like(low[:, :1, :1, :1]).expand(
            low.shape[0], 9, low.shape[2] // 2 or 1, low.shape[3] // 2 or 1
        )
        found = []
        for number in range(len(latents) - 1, 0, -1):
            y = latents[number - 1]
            likely = self.level(number).likelihood(low, parent, y, q)
            if shifts is not None:
                luma, chroma = shifts[2 * number - 2 : 2 * number]
                by = torch.tensor([luma] * 3 + [chroma] * 6).view(1, 9, 1, 1) / 8
                scale = (likely.log_scale + by).clamp(*LOG_SCALES)
                likely = Likelihood(likely.mean, scale)
            found.append(likely)
            if number > 1:
                low = plain_synthesis(low, y, latents[number - 2].shape[2:])
            parent = y
        return found[::-1]

    def synthesise(self, latents: list[Tensor], step: Tensor, size: Size) -> Tensor:
        """Pictures [B, 3, *size] of latents, in 0..255, neither rounded nor clipped.

        `latents` and `step` are those of `likelihoods`.
        """
        sizes = [size, *(y.shape[2:] for y in latents)]
        q = log_step(step)
        low = latents[-1]
        for number in range(len(latents) - 1, 0, -1):
            level = self.level(number)
            high = latents[number - 1] * level.gains(q)
            low = level.synthesise(low, high, q, sizes[number - 1])
        return torch.einsum("ij,bjhw->bihw", self.to_colour, low) * step.view(-1, 1, 1, 1) + 128


def log_step(step: Tensor) -> Tensor:
    """Input of the networks for the steps [B]: log2(step) / 2 - 293 / 128, [B, 1, 1, 1]."""
    return (torch.log2(step) / 2 - 293 / 128).view(-1, 1, 1, 1)


_PLAIN: dict[torch.dtype, Tensor] = {}


def plain_synthesis(low: Tensor, high: Tensor, size: Size) -> Tensor:
    """Next finer planes [B, 3, *size] by the plain CDF 9/7 wavelet, for the context network.

    Args:
        low: [B, 3, h, w] planes.
        high: [B, 9, h, w] latents.
        size: Rows and columns of the finer planes.
    """
    weights = _PLAIN.setdefault(low.dtype, synthesis_weights().to(low.dtype))
    return merged(F.conv2d(extended(low, high, size), weights), size)


class Level(nn.Module):
    """Weights of one level.

    Args:
        hidden: Width of the hidden layers of synthesis and analysis.
        context: Width of the hidden layers of the context network.

    Attributes:
        integer: Whether the integers of the decoder are simulated; see `Model.set_mode`.
        fast: Whether convolutions of the networks run in bfloat16.
        synthesis_delta: [12, 12, 5, 5] learned difference from the synthesis of the wavelet.
        analysis_delta: [12, 12, 5, 5] learned difference from the analysis of the wavelet.
        gain: [9] natural logarithm of the gain of each band.
        gain_by_step: [9] slope of that by `log_step`.
    """

    synthesis_base: Tensor
    analysis_base: Tensor
    mask: Tensor

    def __init__(self, hidden: int, context: int) -> None:
        super().__init__()
        self.integer = self.fast = False
        self.register_buffer("synthesis_base", synthesis_weights(), persistent=False)
        self.register_buffer("analysis_base", analysis_weights(), persistent=False)
        self.synthesis_delta = nn.Parameter(torch.zeros(12, 12, 5, 5))
        self.analysis_delta = nn.Parameter(torch.zeros(12, 12, 5, 5))
        self.gain = nn.Parameter(torch.zeros(9))
        self.gain_by_step = nn.Parameter(torch.zeros(9))
        self.synthesis = Residual(12, hidden, 12)
        self.analysis = Residual(12, hidden, 12)
        # Context network
        self.first = Convolution(12, context, 3)
        self.first_by_step = nn.Parameter(torch.zeros(context))
        self.second = Convolution(context, context, 3)
        self.causal = nn.Parameter(torch.zeros(context, 18, 3, 5))
        mask = torch.ones(3, 5)
        mask[2, 2:] = 0
        self.register_buffer("mask", mask, persistent=False)
        self.mix = Convolution(context, context, 1)
        self.luma = Convolution(context, 6, 1)
        self.from_luma = Convolution(6, context, 1)
        self.chroma = Convolution(context, 12, 1)

    def gains(self, q: Tensor) -> Tensor:
        """Gains of the bands, [B, 9, 1, 1], for a result of `log_step`."""
        return torch.exp(self.gain.view(1, 9, 1, 1) + self.gain_by_step.view(1, 9, 1, 1) * q)

    def gains_at(self, step: Tensor) -> Tensor:
        """Gains of the bands, [B, 9, 1, 1], for quantization steps [B]."""
        return self.gains(log_step(step))

    def analyse(self, low: Tensor, q: Tensor) -> tuple[Tensor, Tensor]:
        """Splits planes [B, 3, H, W] into coarser planes [B, 3, h, w] and bands [B, 9, h, w]."""
        wide = F.pixel_unshuffle(reflected(low, 4), 2)
        cells = wide[:, :, 2:-2, 2:-2]
        linear = F.conv2d(wide, self.analysis_base + self.analysis_delta)
        parts = cells.view(cells.shape[0], 3, 4, *cells.shape[2:])
        parts = (parts - parts.mean(2, keepdim=True)).flatten(1, 2)
        out = linear + self.analysis(soft(parts), q, self.fast)
        return out[:, :3], out[:, 3:]

    def synthesise(self, low: Tensor, high: Tensor, q: Tensor, size: Size) -> Tensor:
        """Merges planes [B, 3, h, w] and bands [B, 9, h, w] into finer planes [B, 3, *size].

        Bands are latents times gains.
        """
        delta = eight_bit(self.synthesis_delta) if self.integer else self.synthesis_delta
        linear = F.conv2d(extended(low, high, size), self.synthesis_base + delta)
        inputs = torch.cat([soft(high_pass(low)), soft(high)], 1)
        change = self.synthesis(inputs, q, self.fast, self.integer)
        return merged(linear + change, size)

    def likelihood(self, low: Tensor, parent: Tensor, y: Tensor, q: Tensor) -> Likelihood:
        """Finds the distributions of latents by the context network.

        Args:
            low: [B, 3, h, w] planes that the plain wavelet makes of coarser levels.
            parent: [B, 9, h / 2, w / 2] latents of the next coarser level.
            y: [B, 9, h, w] latents; each depends only on those coded before it.
            q: [B, 1, 1, 1] result of `log_step`.
        """
        up = F.interpolate(parent, size=y.shape[2:], mode="nearest")
        inputs = torch.cat([squash(high_pass(low)), torch.log1p(up.abs())], 1)
        z = self._conv(self.first, self._input(inputs), 1)
        z = self._active(z + (self.first_by_step.view(1, -1, 1, 1) * q).to(z.dtype))
        z = self._conv(self.second, z, 1)
        seen = self._input(features(y))
        past = self._conv2d(seen, self.causal * self.mask, None, (2, 2))[:, :, : y.shape[2]]
        z = self._active(z + past)
        z = self._active(self._conv(self.mix, z))
        luma = self._conv(self.luma, z).float()
        z = self._active(z + self._conv(self.from_luma, self._input(features(y[:, :3]))))
        chroma = self._conv(self.chroma, z).float()
        mean = torch.cat([luma[:, :3], chroma[:, :6]], 1)
        log_scale = torch.cat([luma[:, 3:], chroma[:, 6:]], 1).clamp(*LOG_SCALES)
        if self.integer:
            mean = through(mean, 1 / 16, -(1 << 14), 1 << 14)
            log_scale = through(log_scale, 1 / 8, -32, 31)
        return Likelihood(mean, log_scale)

    def _input(self, x: Tensor) -> Tensor:
        return through(x, STEP, -127, 127) if self.integer else x

    def _active(self, z: Tensor) -> Tensor:
        if self.integer:
            return through(z, STEP, 0, 255)
        return z.clamp(0, 255 * STEP)

    def _conv(self, layer: nn.Conv2d, x: Tensor, pad: int = 0) -> Tensor:
        return self._conv2d(x, layer.weight, layer.bias, (pad, pad))

    def _conv2d(self, x: Tensor, w: Tensor, b: Tensor | None, pad: tuple[int, int]) -> Tensor:
        if self.integer:
            w = through(w, weight_step(w), -127, 127)
        return convolve(x, w, b, pad, self.fast)


def features(y: Tensor) -> Tensor:
    """Features [B, 2n, h, w] of latents [B, n, h, w] for the context network."""
    return torch.cat([squash(y), torch.log1p(y.abs())], 1)
