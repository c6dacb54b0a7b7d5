"""Trains the layers network: python -m training.layers DATA --out STATE.pt ...; see README.md."""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from .layers_data import cut_outs, shots, sprites, teach
from .layers_network import LayersNetwork
from .layers_samples import Sampler

BATCH = 8
SIZES = ((0.45, 192), (1.0, 256))
"""Side of samples, in pixels, up to a share of the steps."""

RATE, WARM_UP, DECAY = 2e-3, 200, 1e-3
AVERAGE = 0.998
"""Decay of the running average of the weights, which is what is exported."""

SAVE_EVERY = 250


class Samples(Dataset[tuple[Tensor, ...]]):
    """Samples of the steps from `first` on."""

    def __init__(self, sampler: Sampler, first: int, steps: int) -> None:
        self.sampler, self.first, self.steps = sampler, first, steps

    def __len__(self) -> int:
        return (self.steps - self.first) * BATCH

    def __getitem__(self, index: int) -> tuple[Tensor, ...]:
        number = self.first * BATCH + index
        share = number / (self.steps * BATCH)
        size = next(side for end, side in SIZES if share < end)
        s = self.sampler.sample(number, size)
        planes = (s.rgb.transpose(2, 0, 1), s.figure, s.edge, s.owner.transpose(2, 0, 1), s.known)
        return tuple(torch.from_numpy(np.ascontiguousarray(plane)) for plane in planes)


def loss(found: Tensor, figure: Tensor, edge: Tensor, owner: Tensor, known: Tensor) -> list[Tensor]:
    """Losses of figure, boundary and ownership of a batch.

    Args:
        found: float32 [B, 4, H, W], output of the network.
        figure: float32 [B, H, W] in 0..1.
        edge: float32 [B, H, W], share of people who drew an edge, or -1.
        owner: float32 [B, 2, H, W], unit vectors.
        known: float32 [B, H, W], 1 where `owner` counts.
    """
    shown = torch.sigmoid(found[:, 0])
    both, either = (
        (shown * figure).sum((1, 2)) + 1,
        (shown + figure - shown * figure).sum((1, 2)) + 1,
    )
    of_figure = (
        F.binary_cross_entropy_with_logits(found[:, 0], figure) + 0.5 * (1 - both / either).mean()
    )
    there, sure = edge.clamp(0, 1), (edge >= 0).float()
    # Edges are rare, and those that few people drew say little.
    weight = torch.where(there > 0.15, 2.5 * there.clamp_min(0.3) + 0.5, 0.5) * sure
    aim = (there > 0.3).float() * there.clamp_min(0.6)
    of_edge = F.binary_cross_entropy_with_logits(found[:, 1], aim, weight, reduction="sum") / (
        sure.sum() + 1
    )
    away = ((found[:, 2:] - owner) ** 2).sum(1)
    of_owner = 0.3 * (away * known).sum() / (known.sum() + 1)
    return [of_figure, of_edge, of_owner]


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with layers/bsds, layers/coco and train")
    parser.add_argument("--sprites", type=Path, nargs="+", required=True, metavar="DIR")
    parser.add_argument("--teacher", type=Path, required=True, metavar="NET.onnx")
    parser.add_argument("--cache", type=Path, help="folder of the teacher's maps")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--from", dest="start", type=Path, help="state to start from")
    parser.add_argument("--steps", type=int, default=12000)
    parser.add_argument("--rate", type=float, default=1.0, help="multiplies the learning rate")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    cv2.setNumThreads(1)
    torch.manual_seed(args.seed)
    cache = args.cache or args.out.with_suffix(".maps")
    teach(args.data, args.teacher, cache, args.threads)
    pictures = shots(args.data, cache)
    drawn = sprites(args.sprites, cache)
    things = cut_outs(args.data)
    print(
        f"{sum(map(len, pictures.values()))} pictures, {len(drawn)} sprites, {len(things)} things"
    )
    sampler = Sampler(pictures, ((0.55, drawn), (0.45, things)), args.seed)
    train(sampler, args)


def train(sampler: Sampler, args: argparse.Namespace) -> None:
    """Trains, or goes on from what `args.out` holds."""
    model = LayersNetwork().to(args.device, memory_format=torch.channels_last)  # type: ignore[call-overload] # stubs lack it
    optimizer = torch.optim.AdamW(model.parameters(), RATE, weight_decay=DECAY)
    first = 0
    state: dict[str, Any] = {}
    if args.out.exists():
        state = torch.load(args.out)
        optimizer.load_state_dict(state["optimizer"])
        first = state["step"]
    elif args.start:
        state = torch.load(args.start)
        state["model"] = state["average"]
    if state:
        model.load_state_dict(state["model"])
    average = state.get("average") or {k: v.clone() for k, v in model.state_dict().items()}
    loader = DataLoader(
        Samples(sampler, first, args.steps), BATCH, num_workers=1, prefetch_factor=4
    )
    sums, start = torch.zeros(3), time.time()
    for step, batch in enumerate(loader, first):
        rgb, *aims = (plane.to(args.device) for plane in batch)
        rate = RATE * args.rate * min(1, (step + 1) / WARM_UP)
        rate *= 0.5 + 0.5 * math.cos(math.pi * step / args.steps)
        for group in optimizer.param_groups:
            group["lr"] = rate
        losses = loss(model(rgb.contiguous(memory_format=torch.channels_last)), *aims)
        optimizer.zero_grad(set_to_none=True)
        sum(losses, torch.zeros(())).backward()  # type: ignore[no-untyped-call] # torch has no types here
        torch.nn.utils.clip_grad_norm_(model.parameters(), 2.0)
        optimizer.step()
        keep = min(AVERAGE, step / (step + 10))
        for name, value in model.state_dict().items():
            if value.is_floating_point():
                average[name].lerp_(value, 1 - keep)
            else:
                average[name].copy_(value)
        sums += torch.stack(losses).detach().cpu()
        if (step + 1) % SAVE_EVERY == 0 or step + 1 == args.steps:
            shown = " ".join(f"{v:.4f}" for v in sums / SAVE_EVERY)
            print(
                f"{step + 1}: {shown}, {(time.time() - start) / (step + 1 - first):.2f} s",
                flush=True,
            )
            sums.zero_()
            save(args.out, {"model": model.state_dict(), "average": average,
                            "optimizer": optimizer.state_dict(), "step": step + 1})  # fmt: skip


def save(path: Path, state: dict[str, Any]) -> None:
    """Writes a state under a temporary name first."""
    staged = path.with_suffix(".part")
    torch.save(state, staged)
    staged.replace(path)


if __name__ == "__main__":
    main()
