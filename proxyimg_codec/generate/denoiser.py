"""A small denoiser of pictures in pixel space, told a class; `training.denoiser` trains it.

A picture x in -1..1 at time t in 0..1 is seen as cos(pi t / 2) x + sin(pi t / 2) e, with noise e of
variance 1. The network predicts v = cos e - sin x (Salimans and Ho 2022, "Progressive Distillation
for Fast Sampling of Diffusion Models", appendix D), which is well scaled at all times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError

KIND = "proxyimg denoiser 1"
"""Mark of a file that holds a denoiser."""

GROUPS = 8
"""Groups of channels that are normalized together."""

FREQUENCIES = 16
"""Number of frequencies that tell the network the time."""


@dataclass(frozen=True)
class Shape:
    """Sizes of a denoiser.

    Attributes:
        side: Rows and columns of its pictures.
        widths: Channels at full resolution, at half of it, and so on.
        classes: Names of the classes.
    """

    side: int
    widths: tuple[int, ...]
    classes: tuple[str, ...]


class Block(nn.Module):
    """Two convolutions with what time and class say between them, and a way around both."""

    def __init__(self, inputs: int, outputs: int, told: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.second = nn.Conv2d(outputs, outputs, 3, padding=1)
        self.around = nn.Conv2d(inputs, outputs, 1) if inputs != outputs else nn.Identity()
        self.norms = nn.ModuleList(nn.GroupNorm(GROUPS, n) for n in (inputs, outputs))
        self.told = nn.Linear(told, 2 * outputs)

    def forward(self, x: Tensor, told: Tensor) -> Tensor:
        """Output [B, outputs, h, w] of planes [B, inputs, h, w] and words [B, told]."""
        scale, shift = self.told(told)[:, :, None, None].chunk(2, 1)
        y = self.first(F.silu(self.norms[0](x)))
        y = self.second(F.silu(self.norms[1](y) * (1 + scale) + shift))
        return self.around(x) + y  # type: ignore[no-any-return] # torch's modules are untyped


class Denoiser(nn.Module):
    """U-shaped network (Ronneberger 2015) that predicts v; see the module.

    Args:
        shape: Its sizes.
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        widths, told = shape.widths, 4 * shape.widths[0]
        # The class after the last one stands for none.
        self.of_class = nn.Embedding(len(shape.classes) + 1, told)
        self.of_time = nn.Sequential(
            nn.Linear(2 * FREQUENCIES, told), nn.SiLU(), nn.Linear(told, told)
        )
        self.enter = nn.Conv2d(3, widths[0], 3, padding=1)
        before = (widths[0], *widths[:-1])
        self.down = nn.ModuleList(Block(i, o, told) for i, o in zip(before, widths, strict=True))
        self.middle = Block(widths[-1], widths[-1], told)
        self.up = nn.ModuleList(Block(o + o, i, told) for i, o in zip(before, widths, strict=True))
        self.leave = nn.Sequential(
            nn.GroupNorm(GROUPS, widths[0]), nn.SiLU(), nn.Conv2d(widths[0], 3, 3, padding=1)
        )

    def forward(self, x: Tensor, t: Tensor, label: Tensor) -> Tensor:
        """Predictions of v, [B, 3, side, side].

        Args:
            x: [B, 3, side, side] noisy pictures.
            t: [B] times in 0..1.
            label: int64 [B] numbers of classes; the number of classes stands for none.
        """
        told = F.silu(self.of_time(waves(t)) + self.of_class(label))
        y, kept = self.enter(x), []
        for k, block in enumerate(self.down):
            y = block(F.avg_pool2d(y, 2) if k else y, told)
            kept.append(y)
        y = self.middle(y, told)
        for k in range(len(self.up) - 1, -1, -1):
            y = self.up[k](torch.cat([y, kept[k]], 1), told)
            y = F.interpolate(y, scale_factor=2.0) if k else y
        return self.leave(y)  # type: ignore[no-any-return] # torch's modules are untyped


def waves(t: Tensor) -> Tensor:
    """Sines and cosines [B, 2 * `FREQUENCIES`] of times t [B]."""
    rates = torch.exp(torch.linspace(0, math.log(64), FREQUENCIES, device=t.device, dtype=t.dtype))
    angles = t[:, None] * rates * math.pi / 2
    return torch.cat([angles.sin(), angles.cos()], 1)


def save(path: Path, model: Denoiser) -> None:
    """Writes a denoiser with weights of 16 bits."""
    shape = model.shape
    state = {k: v.detach().cpu().half() for k, v in model.state_dict().items()}
    values = {"kind": KIND, "side": shape.side, "widths": list(shape.widths),
              "classes": list(shape.classes), "weights": state}  # fmt: skip
    torch.save(values, path)


def load(path: Path) -> Denoiser:
    """Reads a denoiser that `save` wrote; no code of the file is run.

    Raises:
        InputError: The file cannot be read, or is no denoiser.
    """
    wrong = InputError(f"{path}: is not a denoiser that training.denoiser wrote")
    try:
        values: Any = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception:  # torch tells a file that it cannot read by errors of many kinds
        raise wrong from None
    if not isinstance(values, dict) or values.get("kind") != KIND:
        raise wrong
    try:
        shape = Shape(
            int(values["side"]), tuple(map(int, values["widths"])), tuple(values["classes"])
        )
        model = Denoiser(shape)
        model.load_state_dict({k: v.float() for k, v in values["weights"].items()})
    except (KeyError, TypeError, ValueError, AttributeError, RuntimeError):
        raise wrong from None
    return model.eval().requires_grad_(False)
