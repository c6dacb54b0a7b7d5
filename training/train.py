"""Trains the pyramid model: python -m training.train FOLDER --out STATE.pt; see README.md."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from proxyimg_codec.encoder.pyramid.convolutions import Residual
from proxyimg_codec.encoder.pyramid.goal import RATE_WEIGHT
from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.encoder.pyramid.load import native_bfloat16
from proxyimg_codec.encoder.pyramid.model import Level, Model
from proxyimg_codec.encoder.pyramid.rate import bits_of_integers
from proxyimg_codec.encoder.pyramid.refine import Target, after, cost, moves

from .latents import KEPT_APART, unrefined
from .pictures import Pixels, crop, load
from .wider import WiderModel

STEPS = (3.0, 160.0)
"""Range of quantization steps, which are drawn log-uniformly."""

ROUNDS = 10
"""Rounds of refinement of the latents of a batch in the second phase."""

USUAL = 0.6
"""Bits a pixel of a crop that counts once in relative training."""

AVERAGED = 0.01
"""Share of the present weights in their running average."""


def drawn(model: Model) -> Model:
    """Draws the initial weights of a model; the residual networks give 0 at first."""
    for part in model.modules():
        if isinstance(part, nn.Conv2d):
            nn.Conv2d.reset_parameters(part)
        elif isinstance(part, Level):
            nn.init.normal_(part.causal, std=0.02)
    for part in model.modules():
        if isinstance(part, Residual):
            part.third.reset_parameters()
    return model


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--phase", type=int, choices=(1, 2), default=1)
    parser.add_argument("--from", dest="start", type=Path, help="model to start from")
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--rate", type=float, default=1.0, help="multiplies the learning rates")
    parser.add_argument("--range", type=float, nargs=2, default=STEPS, metavar=("LOW", "HIGH"),
                        help="range of quantization steps")  # fmt: skip
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--batch", type=int, default=4, help="crops a step")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument(
        "--wider",
        action="store_true",
        help="train the next model, which starts from model 2, in phase 2: crops "
        "count by the inverse of their bits, and some pictures are kept apart",
    )
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.set_default_device(args.device)
    torch.manual_seed(args.seed)
    model = WiderModel(load_model(2)) if args.wider else drawn(Model())
    model.set_mode(fast=native_bfloat16())
    model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs
    state: dict[str, Any] = {}
    if args.out.exists():
        state = torch.load(args.out, map_location=args.device)
    elif args.start:
        state = {"model": torch.load(args.start, map_location=args.device)["average"]}
    if state:
        model.load_state_dict(state["model"])
    pictures = load(args.folder)
    if args.wider:
        pictures = [p for i, p in enumerate(pictures) if i % KEPT_APART]
    run = analysed if args.phase == 1 else refined
    try:
        run(model, pictures, state, args)
    finally:
        torch.set_default_device(None)


def batch(
    pictures: list[Pixels], rng: np.random.Generator, args: argparse.Namespace
) -> tuple[Tensor, Tensor]:
    """Draws a batch.

    Args:
        pictures: Pictures as RGB, uint8 [H, W, 3].
        rng: Generator of all random choices.
        args: Arguments of the command line.

    Returns:
        float32 [B, 3, S, S] crops in 0..255, and float32 [B] their quantization steps.
    """
    crops = np.stack([crop(pictures, rng) for _ in range(args.batch)]).transpose(0, 3, 1, 2)
    step = np.exp(rng.uniform(math.log(args.range[0]), math.log(args.range[1]), args.batch))
    x = torch.tensor(crops.astype(np.float32)).contiguous(memory_format=torch.channels_last)
    return x, torch.tensor(step.astype(np.float32))


def groups_of(model: Model, *, analysis: bool, rate: float) -> list[dict[str, Any]]:
    """Makes the parameter groups of the optimizer.

    Linear transforms, which start from the wavelet, have a lower learning rate than networks.

    Args:
        model: The model.
        analysis: Whether to train the analysis; if not, its gradients are switched off.
        rate: Learning rate of the networks.
    """
    slow: list[Tensor] = []
    fast: list[Tensor] = []
    for name, parameter in model.named_parameters():
        if not analysis and ("analysis" in name or name == "to_planes"):
            parameter.requires_grad_(False)
            continue
        linear = "_delta" in name or name in ("to_planes", "to_colour")
        (slow if linear else fast).append(parameter)
    return [
        {"params": fast, "lr": rate, "base": rate},
        {"params": slow, "lr": rate * 0.05, "base": rate * 0.05},
    ]


class Journal:
    """Journal of a run: it counts steps, prints means, and saves the state.

    Args:
        model: The model.
        opt: The optimizer; its state is restored from `state`, if there is any.
        state: State of an earlier run, or an empty dictionary.
        args: Arguments of the command line.

    Attributes:
        done: Number of finished steps.
        average: Running average of the weights, which is better than those of any one step.
    """

    def __init__(self, model: Model, opt: torch.optim.Optimizer, state: dict[str, Any], args: Any):
        self.model, self.opt, self.args = model, opt, args
        self.done = state.get("done", 0)
        if "optimizer" in state:
            opt.load_state_dict(state["optimizer"])
        kept = model.state_dict() if "average" not in state else state["average"]
        self.average = {k: v.detach().clone() for k, v in kept.items()}
        self.start = time.time()
        self.rows: list[tuple[float, float]] = []

    def rng(self) -> np.random.Generator:
        """Returns the generator of the present step, and seeds torch.

        So a resumed run draws the same numbers as an unbroken one.
        """
        torch.manual_seed(self.args.seed * 1_000_003 + self.done)
        return np.random.default_rng((self.args.seed, self.done))

    def set_rates(self) -> None:
        """Sets the learning rates of the present step: a warm-up, then a cosine."""
        share = self.done / self.args.steps
        scale = min(1, (self.done + 1) / 100) * (0.5 + 0.5 * math.cos(math.pi * share))
        for group in self.opt.param_groups:
            group["lr"] = group["base"] * (scale * 0.99 + 0.01)

    def add(self, distortion: Tensor, rate: Tensor) -> None:
        """Records distortion [B] and rate [B] of a step; saves every 100 steps, and at the end."""
        self.done += 1
        for name, value in self.model.state_dict().items():
            self.average[name].lerp_(value, AVERAGED)
        self.rows.append((distortion.mean().item(), rate.mean().item()))
        if self.done % 100 == 0 or self.done >= self.args.steps:
            d, r = np.mean(self.rows, 0)
            spent = time.time() - self.start
            print(f"{self.done} {spent:.0f}s D {d:.4f} R {r:.4f} J {d + RATE_WEIGHT * r:.4f}",
                  flush=True)  # fmt: skip
            self.rows = []
            state = {"model": self.model.state_dict(), "average": self.average,
                     "optimizer": self.opt.state_dict()}  # fmt: skip
            temporary = self.args.out.with_suffix(".part")
            torch.save({**state, "done": self.done}, temporary)
            temporary.rename(self.args.out)


def analysed(model: Model, pictures: list[Pixels], state: dict[str, Any], args: Any) -> None:
    """Runs phase 1, which trains all weights; analysed latents are rounded straight through."""
    rate = 2e-3 * args.rate
    opt = torch.optim.Adam(groups_of(model, analysis=True, rate=rate), betas=(0.9, 0.99))
    journal = Journal(model, opt, state, args)
    while journal.done < args.steps:
        journal.set_rates()
        x, step = batch(pictures, journal.rng(), args)
        latents = [y + (torch.round(y) - y).detach() for y in model.analyse(x, step)]
        likely = model.likelihoods(latents, step)
        pixels = x.shape[2] * x.shape[3]
        distortion = (
            ((model.synthesise(latents, step, x.shape[2:]) - x) ** 2).sum((1, 2, 3))
            / step**2
            / pixels
        )
        coded = zip(latents, likely, strict=False)
        spent = torch.zeros(args.batch)
        for y, p in coded:
            spent = spent + bits_of_integers(y, *p).sum((1, 2, 3)) / pixels
        opt.zero_grad(set_to_none=True)
        (distortion + RATE_WEIGHT * spent).mean().backward()  # type: ignore[no-untyped-call]  # torch's stubs
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        opt.step()
        journal.add(distortion, spent)


def refined(model: Model, pictures: list[Pixels], state: dict[str, Any], args: Any) -> None:
    """Runs phase 2, which trains synthesis and context in simulated integers on refined latents."""
    model.set_mode(integer=True)
    opt = torch.optim.Adam(groups_of(model, analysis=False, rate=6e-4 * args.rate),
                           betas=(0.9, 0.99))  # fmt: skip
    kept = [p for g in opt.param_groups for p in g["params"]]
    journal = Journal(model, opt, state, args)
    while journal.done < args.steps:
        x, step = batch(pictures, journal.rng(), args)
        target = Target(x, None, None, None, step)
        now = unrefined(model, x, step)
        last = [torch.zeros_like(y) for y in now]
        for turn in range(ROUNDS):
            ys = [y.contiguous(memory_format=torch.channels_last).requires_grad_() for y in now]
            spent = cost(model, target, ys, smooth=False)
            opt.zero_grad(set_to_none=True)
            pixels = x.shape[2] * x.shape[3]
            share = torch.ones(args.batch)
            if args.wider:
                share = USUAL / (spent.spent.detach() / pixels + USUAL / 20)
            loss = (share * (spent.error + spent.price * spent.spent)).sum()
            loss.backward()  # type: ignore[no-untyped-call]  # torch's stubs
            slopes = [y.grad / share.view(-1, 1, 1, 1) for y in ys if y.grad is not None]
            ys = [y.detach() for y in ys]
            changes = moves(model, target, ys, spent.likely, slopes, turn, last)
            now, last = after(ys, changes, last)
            if turn > 0:  # latents of the first round are not refined, unlike those of a file
                journal.set_rates()
                torch.nn.utils.clip_grad_norm_(kept, 2e5)
                opt.step()
                journal.add(spent.error.detach() / pixels, spent.spent.detach() / pixels)
            if journal.done >= args.steps:
                return


if __name__ == "__main__":
    main()
