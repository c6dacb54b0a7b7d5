"""Structures of the context network of one level, to be compared; they start from those of model 2.

Arrays are tensors; B counts pictures. Latents of a level have 9 channels 3 * colour + band.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from proxyimg_codec.encoder.pyramid.convolutions import convolve, eight_bit, through, weight_step
from proxyimg_codec.encoder.pyramid.model import (
    LOG_SCALES,
    STEP,
    Level,
    features,
    high_pass,
    squash,
)

TOP = 255 * STEP
"""Largest activation."""

ODDS = (-3, 4)
"""Range of what is added to the logarithm of the odds of the wide part of the mixture."""


class Structure(NamedTuple):
    """Structure of a context network.

    Attributes:
        width: Units of the hidden layers.
        ahead: Units of the layers that see coarser levels only; 0 = `width`.
        view: Side of the first kernel on coarser levels.
        deeper: Number of residual 3 x 3 layers more on coarser levels.
        grand: Whether the level two above is visible.
        signed: Whether the parent is visible with its signs.
        turns: In how many turns luma is coded: 1, or 3 for band after band.
        chroma_turns: The same for chroma: 1, or 2 for colour after colour, or 6.
        shaped: Whether the network chooses the share of the wide part of the mixture.
        mixes: Number of 1 x 1 layers after causal features came in.
        reach: Columns on each side of causal features.
        rows: Rows above of causal features.
        passes: Passes over the level: 0 = wavefront, 2 = checkerboard, 4 = one a position of 2 x 2.
    """

    width: int = 32
    ahead: int = 0
    view: int = 3
    deeper: int = 0
    grand: bool = False
    signed: bool = False
    turns: int = 1
    chroma_turns: int = 1
    shaped: bool = False
    mixes: int = 1
    reach: int = 2
    rows: int = 2
    passes: int = 0

    @property
    def operations(self) -> int:
        """Multiplications a position."""
        a, c, taps = (
            self.ahead or self.width,
            self.width,
            self.rows * (2 * self.reach + 1) + self.reach,
        )
        ahead = self.inputs * self.view**2 * a + 9 * a * a * self.deeper + 9 * a * c
        if self.passes:
            taps = {2: 12, 4: 14}[self.passes]  # on average, of a square of 5 x 5
        each = 2 + self.shaped
        after = c * c * self.mixes + 18 * taps * c + 9 * each * c
        between = sum(2 * g[0] * c for g in groups(self)[1:])
        return ahead + after + between

    @property
    def inputs(self) -> int:
        """Channels of the first layer."""
        return 12 + 9 * self.grand + 9 * self.signed


def groups(structure: Structure) -> list[list[int]]:
    """Finds which latents of a position are coded at once, in their order."""
    luma = [[0, 1, 2]] if structure.turns == 1 else [[0], [1], [2]]
    if structure.chroma_turns == 1:
        chroma = [[3, 4, 5, 6, 7, 8]]
    elif structure.chroma_turns == 2:
        chroma = [[3, 4, 5], [6, 7, 8]]
    else:
        chroma = [[3], [4], [5], [6], [7], [8]]
    return luma + chroma


class Likely(NamedTuple):
    """Distributions of latents [B, 9, h, w], as arguments of `rate.bits_of_integers`.

    Attributes:
        mean: Means.
        log_scale: Natural logarithms of the scales.
        odds: What is added to the logarithm of the odds of the wide part of the mixture; None = 0.
    """

    mean: Tensor
    log_scale: Tensor
    odds: Tensor | None


class Layer(nn.Module):
    """Convolution with drawn weights, of which a part may be set to those of a smaller one.

    Args:
        inputs: Input channels.
        outputs: Output channels.
        side: Side of the kernel.
    """

    def __init__(self, inputs: int, outputs: int, side: int = 1) -> None:
        super().__init__()
        bound = (inputs * side**2) ** -0.5
        self.weight = nn.Parameter((2 * torch.rand(outputs, inputs, side, side) - 1) * bound)
        self.bias = nn.Parameter(torch.zeros(outputs))

    @torch.no_grad()
    def start(self, weight: Tensor, bias: Tensor | None) -> None:
        """Takes the weights of a smaller layer, whose outputs the first ones then are.

        Args:
            weight: [out, in, k, k] weights; no other inputs count for these outputs.
            bias: [out] biases.
        """
        outputs, inputs, side = weight.shape[:3]
        margin = (self.weight.shape[2] - side) // 2
        inside = slice(margin, margin + side)
        self.weight[:outputs] = 0
        self.weight[:outputs, :inputs, inside, inside] = weight
        self.bias[:outputs] = 0 if bias is None else bias

    @torch.no_grad()
    def clear(self) -> None:
        """Sets all weights to 0."""
        self.weight.zero_()
        self.bias.zero_()


def layers(found: nn.Module) -> list[Layer]:
    """Layers of a list."""
    return [layer for layer in found.children() if isinstance(layer, Layer)]


class Context(nn.Module):
    """Context network of one level.

    Args:
        structure: Its structure.
        start: Level of a model with a context network to start from: at first the new network
            does the same, but for contexts of passes.
    """

    mask: Tensor

    def __init__(self, structure: Structure, start: Level) -> None:
        super().__init__()
        s = self.structure = structure
        self.integer = self.fast = False
        c, a = s.width, s.ahead or s.width
        self.first = Layer(s.inputs, a, s.view)
        self.first_by_step = nn.Parameter(torch.zeros(a))
        self.more = nn.ModuleList(Layer(a, a, 3) for _ in range(s.deeper))
        self.second = Layer(a, c, 3)
        side = (5, 5) if s.passes else (s.rows + 1, 2 * s.reach + 1)
        self.causal = nn.ParameterList(
            torch.randn(c, 18, *side) * 0.01 for _ in range(max(s.passes, 1))
        )
        mask = torch.ones(side)
        mask[-1, s.reach :] = 0
        self.register_buffer("mask", mask, persistent=False)
        self.mixes = nn.ModuleList(Layer(c, c) for _ in range(s.mixes))
        self.groups = groups(s)
        each = 3 if s.shaped else 2
        self.out = nn.ModuleList(Layer(c, each * len(g)) for g in self.groups)
        self.back = nn.ModuleList(Layer(2 * g[0], c) for g in self.groups[1:])
        self._start(start)
        self._start_outputs(start)

    @torch.no_grad()
    def _start(self, start: Level) -> None:
        s, old = self.structure, start.mix.weight.shape[0]
        self.first.start(start.first.weight, start.first.bias)
        self.first_by_step[:old] = start.first_by_step
        self.second.start(start.second.weight, start.second.bias)
        for past in self.causal:
            past[:old] = 0
            if s.passes:
                past[:old, :, :3] = start.causal * start.mask
            else:
                past[:old, :, s.rows - 2 :, s.reach - 2 : s.reach + 3] = start.causal
        for layer in layers(self.more) + layers(self.mixes)[1:]:
            layer.clear()
        layers(self.mixes)[0].start(start.mix.weight, start.mix.bias)

    @torch.no_grad()
    def _start_outputs(self, start: Level) -> None:
        old = start.mix.weight.shape[0]
        for group, out in zip(self.groups, layers(self.out), strict=True):
            out.clear()
            source, n = (start.luma, 3) if group[0] < 3 else (start.chroma, 6)
            for part in range(2):  # means, then scales
                for i, k in enumerate(group):
                    at = part * n + k % 3 if n == 3 else part * n + k - 3
                    out.weight[part * len(group) + i, :old] = source.weight[at]
                    out.bias[part * len(group) + i] = _bias(source)[at]
        for group, back in zip(self.groups[1:], layers(self.back), strict=True):
            back.clear()
            before = group[0]
            if before >= 3:
                for part in range(2):  # features of luma; see `features`
                    back.weight[:old, part * before : part * before + 3] = start.from_luma.weight[
                        :, 3 * part : 3 * part + 3
                    ]
                back.bias[:old] = _bias(start.from_luma)

    def forward(self, low: Tensor, parent: Tensor, grand: Tensor, y: Tensor, q: Tensor) -> Likely:
        """Finds the distributions of latents.

        Args:
            low: [B, 3, h, w] planes that the plain wavelet makes of coarser levels.
            parent: [B, 9, h / 2, w / 2] latents of the next coarser level.
            grand: [B, 9, h / 4, w / 4] latents of the one after it.
            y: [B, 9, h, w] latents.
            q: [B, 1, 1, 1] result of `log_step`.
        """
        s = self.structure
        up = F.interpolate(parent, size=y.shape[2:], mode="nearest")
        inputs = [squash(high_pass(low)), torch.log1p(up.abs())]
        if s.grand:
            inputs.append(torch.log1p(F.interpolate(grand, size=y.shape[2:], mode="nearest").abs()))
        if s.signed:
            inputs.append(squash(up))
        z = self._layer(self.first, self._input(torch.cat(inputs, 1)))
        z = self._active(z + (self.first_by_step.view(1, -1, 1, 1) * q).to(z.dtype))
        for layer in layers(self.more):
            z = self._active(z + self._layer(layer, z))
        z = self._layer(self.second, z)
        z = self._active(z + self._past(self._input(features(y))))
        for i, layer in enumerate(layers(self.mixes)):
            z = self._active(self._layer(layer, z) + (z if i else 0))
        found: list[list[Tensor]] = [[], [], []]
        back = layers(self.back)
        for i, (group, out) in enumerate(zip(self.groups, layers(self.out), strict=True)):
            seen = z
            if i:
                before = self._input(features(y[:, : group[0]]))
                seen = self._active(z + self._layer(back[i - 1], before))
            parts = self._layer(out, seen).float().chunk(3 if s.shaped else 2, 1)
            for kept, part in zip(found, parts, strict=False):
                kept.append(part)
        mean, scale = torch.cat(found[0], 1), torch.cat(found[1], 1).clamp(*LOG_SCALES)
        odds = torch.cat(found[2], 1).clamp(*ODDS) if s.shaped else None
        if self.integer:
            mean = through(mean, 1 / 16, -(1 << 14), 1 << 14)
            scale = through(scale, 1 / 8, -32, 31)
            odds = None if odds is None else through(odds, 1, *ODDS)
        return Likely(mean, scale, odds)

    def _past(self, seen: Tensor) -> Tensor:
        s = self.structure
        h, w = seen.shape[2:]
        if not s.passes:
            kernel = self.causal[0] * self.mask
            return self._conv(seen, kernel, None, (s.rows, s.reach))[:, :, :h]
        rows, columns = torch.arange(h)[:, None], torch.arange(w)[None]
        if s.passes == 2:
            turn = (rows + columns) % 2
        else:
            turn = torch.tensor([[0, 2], [3, 1]])[rows % 2, columns % 2]
        past = torch.zeros(())
        for number in range(1, s.passes):
            part = self._conv(seen * (turn < number), self.causal[number], None, (2, 2))
            past = past + part * (turn == number)
        return past

    def _input(self, x: Tensor) -> Tensor:
        return through(x, STEP, -127, 127) if self.integer else x

    def _active(self, z: Tensor) -> Tensor:
        return through(z, STEP, 0, 255) if self.integer else z.clamp(0, TOP)

    def _layer(self, layer: Layer, x: Tensor) -> Tensor:
        pad = layer.weight.shape[2] // 2
        return self._conv(x, layer.weight, layer.bias, (pad, pad))

    def _conv(self, x: Tensor, w: Tensor, b: Tensor | None, pad: tuple[int, int]) -> Tensor:
        if self.integer:
            w = through(w, weight_step(w), -127, 127)
        return convolve(x, w, b, pad, self.fast)


class Synthesis(nn.Module):
    """Network of the synthesis, of three convolutions; at first it does what that of a level does.

    Args:
        hidden: Width of the hidden layers.
        start: The level to start from; None for a network that gives 0.
        middle: Side of the kernel of the second layer.
    """

    def __init__(self, hidden: int, start: Level | None, middle: int = 3) -> None:
        super().__init__()
        self.first = Layer(12, hidden, 3)
        self.by_step = nn.Parameter(torch.zeros(hidden))
        self.second = Layer(hidden, hidden, middle)
        self.third = Layer(hidden, 12, 3)
        self.third.clear()
        if start is not None:
            self._start(start)

    @torch.no_grad()
    def _start(self, start: Level) -> None:
        old = start.synthesis
        self.first.start(old.first.weight, old.first.bias)
        self.by_step[: len(old.by_step)] = old.by_step
        self.second.start(old.second.weight, old.second.bias)
        self.third.start(old.third.weight, old.third.bias)

    def forward(self, x: Tensor, q: Tensor, fast: bool = False, quantized: bool = False) -> Tensor:
        """Runs the network; arguments and result are those of `convolutions.Residual.forward`."""
        z = x
        for layer in (self.first, self.second, self.third):
            weight = eight_bit(layer.weight) if quantized else layer.weight
            pad = weight.shape[2] // 2
            z = convolve(z, weight, layer.bias, (pad, pad), fast)
            if layer is self.first:
                z = z + (self.by_step.view(1, -1, 1, 1) * q).to(z.dtype)
            if layer is not self.third:
                z = F.relu(z)
        return z.float()


def _bias(layer: nn.Conv2d) -> Tensor:
    assert layer.bias is not None
    return layer.bias
