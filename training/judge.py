"""Judges a model on pictures kept apart: python -m training.judge PICTURES STATE.pt ..."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from proxyimg_codec.encoder.pyramid.goal import RATE_WEIGHT
from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.encoder.pyramid.model import Model
from proxyimg_codec.encoder.pyramid.refine import Target, cost

from .latents import KEPT_APART, STEPS, plain, refined
from .pictures import load
from .wider import WiderModel

BATCH = 4


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("states", type=Path, nargs="*", help="states of `training.train --wider`")
    parser.add_argument("--batches", type=int, default=6, help="of 4 crops")
    parser.add_argument("--rounds", type=int, default=12)
    args = parser.parse_args()
    torch.set_num_threads(1)
    pictures = load(args.folder)[::KEPT_APART]
    base = load_model(2)
    base.set_mode(integer=True)
    before = found(base, pictures, args)
    for path in args.states:
        model = WiderModel(base)
        model.load_state_dict(torch.load(path)["average"])
        model.requires_grad_(False)
        model.set_mode(integer=True)
        change = (found(model, pictures, args) - before) / (RATE_WEIGHT * before[:, 2:])
        mean, error = change[:, 0].mean() * 100, change[:, 0].std() / math.sqrt(len(change)) * 100
        bits = (change[:, 2] * RATE_WEIGHT).mean() * 100
        print(f"{path}: {mean:+.2f} % of the bits at equal quality, standard error {error:.2f}; "
              f"bits alone {bits:+.2f} %", flush=True)  # fmt: skip


def found(model: Model, pictures: list[np.ndarray], args: argparse.Namespace) -> Tensor:
    """Costs, errors in squares of the step, and bits of all crops, [crops, 3]."""
    rng, out = np.random.default_rng(5), []
    for _ in range(args.batches):
        x = np.stack([plain(pictures, rng) for _ in range(BATCH)]).transpose(0, 3, 1, 2)
        step = np.exp(rng.uniform(math.log(STEPS[0]), math.log(STEPS[1]), BATCH))
        target = Target(torch.from_numpy(x.astype(np.float32)), None, None, None,
                        torch.from_numpy(step.astype(np.float32)))  # fmt: skip
        latents = refined(model, target.picture, target.step, args.rounds)
        with torch.no_grad():
            spent = cost(model, target, latents, smooth=False)
        total = spent.error + RATE_WEIGHT * spent.spent
        out.append(torch.stack([total, spent.error, spent.spent], 1))
    return torch.cat(out)


if __name__ == "__main__":
    main()
