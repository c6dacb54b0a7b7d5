"""Compares syntheses of level 1: python -m training.compare_synthesis DATA hidden=48 ..."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from proxyimg_codec.encoder.pyramid.goal import LEVELS, RATE_WEIGHT
from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.encoder.pyramid.model import Level, high_pass, log_step, soft
from proxyimg_codec.encoder.pyramid.wavelet import extended, merged

from .latents import stored
from .structures import Synthesis


class Shape(NamedTuple):
    """Structure of the synthesis of a level.

    Attributes:
        hidden: Units of the hidden layers.
        middle: Side of the kernel of the middle layer.
        filter: Units of a second network, which corrects the result; 0 = none.
        filter_middle: As `middle`, of that network.
    """

    hidden: int = 32
    middle: int = 1
    filter: int = 0
    filter_middle: int = 1

    @property
    def operations(self) -> int:
        """Multiplications a position of 2 x 2 samples."""
        own = self.hidden * (9 * 24 + self.hidden * self.middle**2)
        return 3600 + own + self.filter * (9 * 24 + self.filter * self.filter_middle**2)


class Finest(nn.Module):
    """Synthesis of the finest level, which at first does what that of model 2 does."""

    def __init__(self, shape: Shape, start: Level) -> None:
        super().__init__()
        self.level = start
        self.delta = nn.Parameter(start.synthesis_delta.detach().clone())
        self.net = Synthesis(shape.hidden, start, shape.middle)
        self.filter = Synthesis(shape.filter, None, shape.filter_middle) if shape.filter else None

    def forward(self, low: Tensor, high: Tensor, q: Tensor) -> Tensor:
        """Merges planes [B, 3, h, w] and bands [B, 9, h, w] into planes [B, 3, 2 h, 2 w]."""
        size = torch.Size((2 * low.shape[2], 2 * low.shape[3]))
        linear = F.conv2d(extended(low, high, size), self.level.synthesis_base + self.delta)
        cells = linear + self.net(torch.cat([soft(high_pass(low)), soft(high)], 1), q)
        planes = merged(cells, size)
        if self.filter is None:
            return planes
        seen = F.pixel_unshuffle(soft(high_pass(planes)), 2)
        return planes + F.pixel_shuffle(self.filter(seen, q), 2)


class Case(NamedTuple):
    """Inputs [B, ...] of the synthesis, and weights [B] of squared errors as shares of all bits."""

    low: Tensor
    high: Tensor
    q: Tensor
    target: Tensor
    scale: Tensor
    weight: Tensor


@torch.no_grad()
def cases(paths: list[Path]) -> list[Case]:
    """Reads files of `training.latents`."""
    model, out = load_model(2), []
    for path in paths:
        x, ys, step, bits = stored(path, model)
        spent = sum(bits)
        q, low = log_step(step), ys[-1]
        for number in range(LEVELS, 1, -1):
            level = model.level(number)
            low = level.synthesise(
                low, ys[number - 1] * level.gains(q), q, ys[number - 2].shape[2:]
            )
        high = ys[0] * model.level(1).gains(q)
        weight = 1 / (step**2 * RATE_WEIGHT * (spent + 200))
        out.append(Case(low.contiguous(memory_format=torch.channels_last),
                        high.contiguous(memory_format=torch.channels_last), q, x,
                        step.view(-1, 1, 1, 1), weight))  # fmt: skip
    return out


def losses(net: Finest, colour: Tensor, c: Case) -> tuple[Tensor, Tensor]:
    """Squared errors [B], and the same as shares of bits."""
    shown = torch.einsum("ij,bjhw->bihw", colour, net(c.low, c.high, c.q)) * c.scale + 128
    error = ((shown - c.target) ** 2).sum((1, 2, 3))
    return error, error * c.weight


def judged(net: Finest, colour: Tensor, found: list[Case]) -> tuple[float, float]:
    """Mean logarithmic error in dB (less is better), and mean error as percent of bits."""
    with torch.no_grad():
        both = [losses(net, colour, c) for c in found]
    errors, shares = (torch.cat([b[i] for b in both]) for i in range(2))
    return float(10 * torch.log10(errors).mean()), float(100 * shares.mean())


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("shapes", nargs="+", metavar="SHAPE")
    parser.add_argument("--epochs", type=float, default=6)
    parser.add_argument("--files", type=int, default=40)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--size", type=int, default=2)
    args = parser.parse_args()
    torch.set_num_threads(1)
    learning = cases(sorted(args.data.glob("learning-*.npz"))[: args.files])
    judging = cases(sorted(args.data.glob("judging-*.npz")))
    model = load_model(2)
    for text in args.shapes:
        pairs = [word.split("=") for word in text.split(",") if word != "-"]
        shape = Shape(**{k: int(v) for k, v in pairs})
        torch.manual_seed(1)
        net = Finest(shape, model.level(1)).to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs
        before, start = judged(net, model.to_colour, judging), time.process_time()
        learnt(net, model.to_colour, learning, args)
        spent = time.process_time() - start
        after, own = (judged(net, model.to_colour, c) for c in (judging, learning[:4]))
        print(
            f"{text} operations {shape.operations} judged {after[0] - before[0]:+.3f} dB, worth "
            f"{after[1] - before[1]:+.2f} % of bits; learnt {own[1]:.2f} CPU {spent:.0f} s",
            flush=True,
        )


def learnt(net: Finest, colour: Tensor, found: list[Case], args: argparse.Namespace) -> None:
    """Trains a network."""
    rng, done = np.random.default_rng(1), 0
    networks = [p for n in (net.net, net.filter) if n is not None for p in n.parameters()]
    groups = [
        {"params": [net.delta], "base": args.rate * 0.05},
        {"params": networks, "base": args.rate},
    ]
    opt = torch.optim.Adam(groups, betas=(0.9, 0.99))
    parts = [(c, i) for c in found for i in range(0, len(c.q), args.size)]
    steps = int(args.epochs * len(parts))
    while done < steps:
        for k in rng.permutation(len(parts)):
            if done >= steps:
                return
            case, i = parts[k]
            for group in opt.param_groups:
                group["lr"] = group["base"] * min(1, (done + 1) / 50) * (
                    0.51 + 0.49 * math.cos(math.pi * done / steps))  # fmt: skip
            c = Case(*(v[i : i + args.size] for v in case))
            opt.zero_grad(set_to_none=True)
            losses(net, colour, c)[1].mean().backward()  # type: ignore[no-untyped-call]  # torch's stubs
            torch.nn.utils.clip_grad_norm_(net.parameters(), 0.1)
            opt.step()
            done += 1


if __name__ == "__main__":
    main()
