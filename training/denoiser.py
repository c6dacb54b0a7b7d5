"""Trains the small denoiser of emoji: python -m training.denoiser EMOJI ... --out denoiser.pt."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import torch
from torch import Tensor
from torch.nn import functional as F

from proxyimg_codec.generate.denoiser import Denoiser, Shape, save

from .emoji import Emoji, read, samples
from .emoji_groups import CLASSES

SIDE, WIDTHS = 32, (24, 48, 96)
BATCH = 32
RATE, WARM_UP = 2e-3, 100
AVERAGE = 0.995
"""Decay of the running average of the weights, which is what is saved."""

UNTOLD = 0.15
"""Share of the samples whose class the network is not told."""


def loss(model: Denoiser, picture: Tensor, label: Tensor, random: torch.Generator) -> Tensor:
    """Mean squared error of v at random times.

    Args:
        model: The network.
        picture: float32 [B, 3, h, w] in 0..1.
        label: int64 [B] classes.
        random: Generator of times, noise and of who is not told the class.
    """
    count = len(picture)
    x = 2 * picture - 1
    # Times are spread evenly over the batch, which makes its loss less noisy.
    t = (torch.arange(count) + torch.rand(count, generator=random)) / count
    t = t.to(x.device)
    noise = torch.randn(x.shape, generator=random).to(x.device)
    cos, sin = ((angle := t[:, None, None, None] * math.pi / 2).cos(), angle.sin())
    untold = torch.rand(count, generator=random).to(x.device) < UNTOLD
    told = torch.where(untold, len(CLASSES), label)
    found = model(cos * x + sin * noise, t, told)
    return F.mse_loss(found, cos * noise - sin * x)


def train(emoji: Emoji, steps: int, seed: int, device: str) -> Denoiser:
    """Trains a denoiser; says every minute how far it is.

    Args:
        emoji: The emoji.
        steps: Number of steps of the optimizer.
        seed: Seed of weights and samples.
        device: Where the network runs, ``cpu`` or ``cuda``.
    """
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    model = Denoiser(Shape(SIDE, WIDTHS, CLASSES)).to(device)
    average = Denoiser(model.shape).to(device)
    average.load_state_dict(model.state_dict())
    optimizer = torch.optim.AdamW(model.parameters(), RATE, weight_decay=1e-3)
    said, total = time.perf_counter(), 0.0
    for step in range(steps):
        warm = min(1, (step + 1) / WARM_UP)
        for group in optimizer.param_groups:
            group["lr"] = RATE * warm * (0.5 + 0.5 * math.cos(math.pi * step / steps)) + 1e-5
        picture, label = (v.to(device) for v in samples(emoji, BATCH, SIDE, random))
        found = loss(model, picture, label, random)
        optimizer.zero_grad()
        found.backward()  # type: ignore[no-untyped-call] # torch's
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        total = 0.98 * total + 0.02 * float(found.detach())
        keep = min(AVERAGE, (step + 1) / (step + 11))
        with torch.no_grad():
            for slow, fast in zip(average.parameters(), model.parameters(), strict=True):
                slow.lerp_(fast, 1 - keep)
        if time.perf_counter() - said > 60:
            said = time.perf_counter()
            print(f"step {step + 1} of {steps}, loss {total:.4f}", flush=True)
    return average


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("emoji", type=Path, nargs="+", help="folder of pictures, or font in colour")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=2400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    emoji = read(args.emoji)
    print(f"{len(emoji.labels)} emoji, half of them to learn from", flush=True)
    # The other half is for the classifier that judges what the denoiser makes.
    save(args.out, train(emoji.part(0), args.steps, args.seed, args.device))


if __name__ == "__main__":
    main()
