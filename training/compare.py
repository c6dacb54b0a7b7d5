"""Compares context structures: python -m training.compare DATA --level 2 width=64,turns=3 ..."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from proxyimg_codec.encoder.pyramid.goal import LEVELS
from proxyimg_codec.encoder.pyramid.load import load as load_model
from proxyimg_codec.encoder.pyramid.model import log_step, plain_synthesis
from proxyimg_codec.encoder.pyramid.rate import bits_of_integers

from .latents import stored
from .structures import Context, Structure


class Place(NamedTuple):
    """Latents of a level of several crops, and what their context sees; see `Context.forward`.

    Attributes:
        weight: [B] weight of a bit: 1 over all bits of the crop, of all levels, with model 2.
        before: [B] bits of the level with model 2.
    """

    low: Tensor
    parent: Tensor
    grand: Tensor
    y: Tensor
    q: Tensor
    weight: Tensor
    before: Tensor


@torch.no_grad()
def places(paths: list[Path], wanted: int) -> list[Place]:
    """Reads a level of files of `training.latents`; 4 is level 4 and all that are coarser."""
    model, out = load_model(2), []
    for path in paths:
        _, ys, step, spent = stored(path, model)
        weight, q = 1 / (torch.stack(spent).sum(0) + 200), log_step(step)
        low = ys[-1]
        none = torch.zeros(len(step), 9, 1, 1)
        above = [*ys[:-1], none, none]
        for number in range(LEVELS, 0, -1):
            y = ys[number - 1]
            if min(number, 4) == wanted:
                own = spent[number - 1]
                out.append(Place(low, above[number], above[number + 1], y, q, weight, own))
            if number > 1:
                low = plain_synthesis(low, y, ys[number - 2].shape[2:])
    return out


def batches(found: list[Place], size: int, rng: np.random.Generator) -> Iterator[Place]:
    """Yields batches of crops in random order; a batch is of one file."""
    parts = [(p, i) for p in found for i in range(0, len(p.q), size)]
    for k in rng.permutation(len(parts)):
        place, i = parts[k]
        yield Place(*(v[i : i + size] for v in place))


def judged(net: Context, found: list[Place]) -> float:
    """Mean change of the bits of all levels in percent, if this level is coded by `net`."""
    total = [0.0, 0.0]
    with torch.no_grad():
        for p in found:
            own = bits_of_integers(p.y, *net(p.low, p.parent, p.grand, p.y, p.q)).sum((1, 2, 3))
            total[0] += float(((own - p.before) * p.weight).sum())
            total[1] += float((p.before * p.weight).sum())
    return 100 * total[0] / total[1]


def learnt(net: Context, found: list[Place], epochs: float, rate: float, size: int) -> None:
    """Trains a network."""
    rng = np.random.default_rng(1)
    opt = torch.optim.Adam(net.parameters(), lr=rate, betas=(0.9, 0.99))
    steps = int(epochs * sum(-(-len(p.q) // size) for p in found))
    done = 0
    while done < steps:
        for p in batches(found, size, rng):
            if done >= steps:
                return
            opt.param_groups[0]["lr"] = rate * min(1, (done + 1) / 50) * (
                0.51 + 0.49 * math.cos(math.pi * done / steps))  # fmt: skip
            own = bits_of_integers(p.y, *net(p.low, p.parent, p.grand, p.y, p.q)).sum((1, 2, 3))
            opt.zero_grad(set_to_none=True)
            (own * p.weight).mean().backward()  # type: ignore[no-untyped-call]  # torch's stubs
            torch.nn.utils.clip_grad_norm_(net.parameters(), 0.1)
            opt.step()
            done += 1


def parsed(text: str) -> Structure:
    """Reads a structure: attributes as name=value, joined by commas; `-` is that of model 2."""
    pairs = [word.split("=") for word in text.split(",") if word != "-"]
    return Structure(**{k: int(v) for k, v in pairs})  # type: ignore[arg-type]  # flags are read as numbers


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("structures", nargs="+", type=parsed, metavar="STRUCTURE")
    parser.add_argument("--level", type=int, default=2, help="1, 2, 3, or 4 for all from there on")
    parser.add_argument("--epochs", type=float, default=6)
    parser.add_argument("--files", type=int, default=40, help="number of files to learn from")
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--size", type=int, default=4, help="crops a step")
    args = parser.parse_args()
    torch.set_num_threads(1)
    learning = places(sorted(args.data.glob("learning-*.npz"))[: args.files], args.level)
    judging = places(sorted(args.data.glob("judging-*.npz")), args.level)
    print(
        f"level {args.level}: {len(learning)} files, share of all bits in percent: "
        f"{100 * np.mean([float((p.before * p.weight).mean()) for p in judging]):.1f}",
        flush=True,
    )
    for s in args.structures:
        torch.manual_seed(1)
        net = Context(s, load_model(2).level(args.level)).to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # torch's stubs
        changed = {k: v for k, v in s._asdict().items() if v != Structure._field_defaults[k]}
        before, start = judged(net, judging), time.process_time()
        learnt(net, learning, args.epochs, args.rate, args.size)
        spent = time.process_time() - start
        after, own = judged(net, judging), judged(net, learning[:8])
        print(
            f"{changed} operations {s.operations} before {before:+.2f} % judged {after:+.2f} % "
            f"learnt {own:+.2f} % CPU {spent:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
