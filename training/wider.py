"""The next pyramid model in training: wider networks, which start from those of model 2.

Arrays are tensors; B counts pictures. Latents of a level have 9 channels 3 * colour + band.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from proxyimg_codec.encoder.pyramid.convolutions import eight_bit
from proxyimg_codec.encoder.pyramid.model import (
    LOG_SCALES,
    SHARED_FROM,
    Level,
    Model,
    high_pass,
    log_step,
    plain_synthesis,
    soft,
)
from proxyimg_codec.encoder.pyramid.wavelet import Size, extended, merged

from .structures import Context, Likely, Structure, Synthesis

STRUCTURES = (
    Structure(width=40, ahead=32, shaped=True),
    *[Structure(width=64, shaped=True)] * (SHARED_FROM - 1),
)
"""Structures of the context networks of levels 1, 2, 3, and of all coarser levels."""

HIDDEN = (32, 48, 48, 48)
"""Units of the hidden layers of the synthesis of the same levels."""


class WiderLevel(Level):
    """Weights of one level, which at first does what another does.

    Args:
        structure: Structure of the context network.
        hidden: Width of the hidden layers of the synthesis.
        start: The level to start from.

    Attributes:
        context: The context network.
        wider: Network of the synthesis.
    """

    def __init__(self, structure: Structure, hidden: int, start: Level) -> None:
        width, old = start.synthesis.second.weight.shape[0], start.mix.weight.shape[0]
        super().__init__(width, old)
        self.load_state_dict(start.state_dict())
        self.context, self.wider = Context(structure, start), Synthesis(hidden, start)
        for name in ("synthesis", "first", "second", "mix", "luma", "from_luma", "chroma"):
            delattr(self, name)
        for name in ("causal", "first_by_step"):
            delattr(self, name)

    def synthesise(self, low: Tensor, high: Tensor, q: Tensor, size: Size) -> Tensor:
        """Merges planes and bands into finer planes; see `Level.synthesise`."""
        delta = eight_bit(self.synthesis_delta) if self.integer else self.synthesis_delta
        linear = F.conv2d(extended(low, high, size), self.synthesis_base + delta)
        inputs = torch.cat([soft(high_pass(low)), soft(high)], 1)
        return merged(linear + self.wider(inputs, q, self.fast, self.integer), size)


class WiderModel(Model):
    """Model with `WiderLevel`s.

    Args:
        start: Model to start from.
        structures: Structures of the context networks.
        hidden: Widths of the hidden layers of the synthesis.
    """

    def __init__(
        self, start: Model, structures: Sequence[Structure] = STRUCTURES,
        hidden: Sequence[int] = HIDDEN,
    ) -> None:  # fmt: skip
        super().__init__(*start.sizes)
        with torch.no_grad():
            self.to_planes.copy_(start.to_planes)
            self.to_colour.copy_(start.to_colour)
        self.levels = nn.ModuleList(
            WiderLevel(s, h, start.level(k + 1))
            for k, (s, h) in enumerate(zip(structures, hidden, strict=True))
        )

    def set_mode(self, *, integer: bool | None = None, fast: bool | None = None) -> None:
        """Sets modes of all levels; see `Model.set_mode`."""
        super().set_mode(integer=integer, fast=fast)
        for level in self.levels:
            assert isinstance(level, WiderLevel)
            level.context.integer, level.context.fast = level.integer, level.fast

    def likelihoods(  # type: ignore[override]  # these have odds too
        self, latents: list[Tensor], step: Tensor, shifts: Sequence[int] | None = None
    ) -> list[Likely]:
        """Finds the distributions of latents; see `Model.likelihoods`."""
        q, low = log_step(step), latents[-1]
        none = torch.zeros_like(low[:, :1, :1, :1]).expand(
            low.shape[0], 9, low.shape[2] // 2 or 1, low.shape[3] // 2 or 1
        )
        above, found = [*latents[:-1], none, none], []
        for number in range(len(latents) - 1, 0, -1):
            y, level = latents[number - 1], self.level(number)
            assert isinstance(level, WiderLevel)
            likely = level.context(low, above[number], above[number + 1], y, q)
            if shifts is not None:
                luma, chroma = shifts[2 * number - 2 : 2 * number]
                by = torch.tensor([luma] * 3 + [chroma] * 6).view(1, 9, 1, 1) / 8
                likely = likely._replace(log_scale=(likely.log_scale + by).clamp(*LOG_SCALES))
            found.append(likely)
            if number > 1:
                low = plain_synthesis(low, y, latents[number - 2].shape[2:])
        return found[::-1]

    @property
    def operations(self) -> float:
        """Multiplications a pixel of decoding, the linear part of the synthesis among them."""
        total = 0.0
        for number in range(1, 7):
            level = self.level(number)
            assert isinstance(level, WiderLevel)
            h = level.wider.second.weight.shape[0]
            own = level.context.structure.operations + 3600 + 9 * h * (24 + h)
            total += own / 4**number
        return total

    @property
    def bytes(self) -> int:
        """Weights of the decoder; each is a byte in a file."""
        return sum(p.numel() for n, p in self.named_parameters() if "analysis" not in n)
