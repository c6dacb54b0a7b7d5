"""Makes refined latents to compare structures on: python -m training.latents OUT FOLDER."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from proxyimg_codec.encoder.pyramid.goal import DEAD_ZONE, LEVELS
from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.encoder.pyramid.model import Model
from proxyimg_codec.encoder.pyramid.rate import bits_of_integers
from proxyimg_codec.encoder.pyramid.refine import Target, after, cost, moves

from .pictures import SIZE, Pixels, crop, load

KEPT_APART = 8
"""One picture of so many is kept apart, to judge."""

SHARD, BATCH, ROUNDS = 16, 4, 10
"""Crops a file, crops refined at a time, and rounds of refinement."""

STEPS = (7.0, 110.0)
"""Range of quantization steps, about 2 to 0.1 bits a pixel."""


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--judging", type=int, default=4, help="files of pictures kept apart")
    parser.add_argument("--learning", type=int, default=40, help="files of the other pictures")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    model = load_model(2)
    pictures = load(args.folder)
    for kind, count in (("judging", args.judging), ("learning", args.learning)):
        own = [p for i, p in enumerate(pictures) if (i % KEPT_APART == 0) == (kind == "judging")]
        for number in range(count):
            path = args.out / f"{kind}-{number:03}.npz"
            if not path.exists():
                temporary = path.with_suffix(".part")
                with temporary.open("wb") as file:
                    np.savez(file, **shard(model, own, number, kind == "learning"))  # type: ignore[arg-type]  # numpy's stubs
                temporary.rename(path)
                print(path.name, flush=True)


def shard(model: Model, pictures: list[Pixels], number: int, flawed: bool) -> dict[str, np.ndarray]:
    """Makes the arrays of a file.

    Args:
        model: Model that the latents are made for.
        pictures: Pictures to cut crops from.
        number: Number of the file, which seeds its random choices.
        flawed: Whether crops have the flaws that training wants; otherwise they are cut as is.

    Returns:
        `pictures` uint8 [N, 3, S, S], `steps` float32 [N], and latents int16 [N, 9, h, w] of
        `level1`, `level2`, ...; `lowest` int16 [N, 3, h, w].
    """
    rng = np.random.default_rng((number, flawed))
    parts: dict[str, list[np.ndarray]] = {}
    for _ in range(SHARD // BATCH):
        cut = crop if flawed else plain
        x = np.stack([cut(pictures, rng) for _ in range(BATCH)]).transpose(0, 3, 1, 2)
        step = np.exp(rng.uniform(math.log(STEPS[0]), math.log(STEPS[1]), BATCH))
        latents = refined(
            model, torch.from_numpy(x.astype(np.float32)),
            torch.from_numpy(step.astype(np.float32)), ROUNDS,
        )  # fmt: skip
        names = [*(f"level{i}" for i in range(1, len(latents))), "lowest"]
        found: dict[str, np.ndarray] = {"pictures": x, "steps": step.astype(np.float32)}
        found |= {n: y.numpy().astype(np.int16) for n, y in zip(names, latents, strict=True)}
        for name, value in found.items():
            parts.setdefault(name, []).append(value)
    return {name: np.concatenate(values) for name, values in parts.items()}


def plain(pictures: list[Pixels], rng: np.random.Generator) -> Pixels:
    """Cuts a random part of a random picture, uint8 [SIZE, SIZE, 3]."""
    picture = pictures[rng.integers(len(pictures))]
    y, x = (rng.integers(n - SIZE + 1) for n in picture.shape[:2])
    return picture[y : y + SIZE, x : x + SIZE]


@torch.no_grad()
def unrefined(model: Model, x: Tensor, step: Tensor) -> list[Tensor]:
    """Integer latents of pictures [B, 3, H, W] that refinement begins with."""
    *found, lowest = model.analyse(x, step)
    small = [y - y.clamp(-DEAD_ZONE, DEAD_ZONE) for y in found]
    return [torch.round(y) for y in (*small, lowest)]


class Stored(NamedTuple):
    """A file of crops.

    Attributes:
        pictures: [B, 3, H, W] in 0..255.
        latents: Latents of levels 1, 2, ..., then the lowest planes.
        step: [B] quantization steps.
        spent: For each level, [B] bits with the model.
    """

    pictures: Tensor
    latents: list[Tensor]
    step: Tensor
    spent: list[Tensor]


def stored(path: Path, model: Model) -> Stored:
    """Reads a file of crops."""
    data = np.load(path)
    names = [*(f"level{i}" for i in range(1, LEVELS + 1)), "lowest"]
    x, *ys = (torch.from_numpy(data[n].astype(np.float32)) for n in ("pictures", *names))
    step = torch.from_numpy(data["steps"])
    likely = model.likelihoods(ys, step)
    spent = [bits_of_integers(y, *p).sum((1, 2, 3)) for y, p in zip(ys, likely, strict=False)]
    return Stored(x, ys, step, spent)


def refined(model: Model, x: Tensor, step: Tensor, rounds: int) -> list[Tensor]:
    """Finds refined integer latents of pictures [B, 3, H, W] for a model, as training does."""
    target = Target(x, None, None, None, step)
    now = unrefined(model, x, step)
    last = [torch.zeros_like(y) for y in now]
    for turn in range(rounds):
        ys = [y.detach().requires_grad_() for y in now]
        spent = cost(model, target, ys, smooth=False)
        slopes = torch.autograd.grad(spent.total, ys)
        ys = [y.detach() for y in ys]
        changes = moves(model, target, ys, spent.likely, slopes, turn, last)
        now, last = after(ys, changes, last)
    return now


if __name__ == "__main__":
    main()
