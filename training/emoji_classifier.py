"""Trains the judge of emoji: python -m training.emoji_classifier EMOJI ... --out judge.pt.

It never sees the emoji that the denoiser learns from, nor anything that the denoiser says.
"""

from __future__ import annotations

import argparse
import math
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .emoji import Emoji, read, samples
from .emoji_groups import CLASSES

SIDE, BATCH, RATE = 32, 64, 2e-3


class Classifier(nn.Sequential):
    """Convolutional network from pictures [B, 3, 32, 32] in 0..1 to logits of `CLASSES`."""

    def __init__(self) -> None:
        widths = (3, 32, 64, 128)
        layers: list[nn.Module] = []
        for i, o in pairwise(widths):
            layers += [nn.Conv2d(i, o, 3, padding=1), nn.GroupNorm(8, o), nn.SiLU(),
                       nn.Conv2d(o, o, 3, 2, 1), nn.GroupNorm(8, o), nn.SiLU()]  # fmt: skip
        super().__init__(
            *layers, nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(128, len(CLASSES))
        )


def train(emoji: Emoji, steps: int, seed: int) -> Classifier:
    """Trains a classifier."""
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    model = Classifier()
    optimizer = torch.optim.AdamW(model.parameters(), RATE, weight_decay=1e-2)
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = RATE * (0.5 + 0.5 * math.cos(math.pi * step / steps)) + 1e-5
        picture, label = samples(emoji, BATCH, SIDE, random)
        # Grain, so that it does not look at what is hardly there.
        picture = picture + 0.05 * torch.randn(picture.shape, generator=random)
        loss = F.cross_entropy(model(picture), label, label_smoothing=0.05)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call] # torch's
        optimizer.step()
        if step % 200 == 199:
            print(f"step {step + 1} of {steps}, loss {float(loss.detach()):.3f}", flush=True)
    return model.eval()


@torch.no_grad()
def accuracy(model: Classifier, emoji: Emoji, seed: int) -> float:
    """Share of 1000 samples of emoji that a classifier names right."""
    picture, label = samples(emoji, 1000, SIDE, torch.Generator().manual_seed(seed))
    return float((model(picture).argmax(1) == label).float().mean())


def load(path: Path) -> Classifier:
    """Reads a classifier."""
    model = Classifier()
    state: dict[str, Tensor] = torch.load(path, weights_only=True)
    model.load_state_dict(state)
    return model.eval()


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("emoji", type=Path, nargs="+", help="folder of pictures, or font in colour")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=1600)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    emoji = read(args.emoji)
    model = train(emoji.part(1), args.steps, args.seed)
    print(f"of emoji that it has not seen, {accuracy(model, emoji.part(0), 1):.0%} are right")
    torch.save(model.state_dict(), args.out)


if __name__ == "__main__":
    main()
