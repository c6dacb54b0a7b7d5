"""Flags of pxi-edit that say how textures are generated."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path

from ..errors import UsageError
from .common import Bar
from .edit_flags import Values

SETTINGS = ("guide", "negative", "guidance", "steps", "seed", "resolution", "times", "weighting",
            "clip", "precision", "keep_structure")  # fmt: skip
"""Flags that are parameters of the operation."""

RUN = ("device", "offload", "previews", "every", "resume")
"""Flags that change how it is done, but not what is made."""


def add_generate(p: argparse.ArgumentParser) -> None:
    """Adds the flags to a parser; each is None where it is not given."""
    group = p.add_argument_group("with --generate")
    group.add_argument("--guide", metavar="PATH|NAME", help="folder of a diffusers pipeline, file "
                       "of a denoiser, a picture, or the name of a plug-in")  # fmt: skip
    group.add_argument("--negative", metavar="PROMPT", help="what the texture does not show")
    group.add_argument("--guidance", type=float, metavar="F", help="how many times the difference "
                       "counts that the prompt makes; default 15, diffusers 30")  # fmt: skip
    group.add_argument("--steps", type=int, metavar="N", help="steps of the optimizer; default 400")
    group.add_argument(
        "--seed", type=int, metavar="N", help="seed of all random numbers; default 0"
    )
    group.add_argument("--resolution", type=int, metavar="PX", help="rows and columns of what the "
                       "guide sees; by default as it likes it")  # fmt: skip
    group.add_argument("--times", metavar="LEAST,MOST", help="shares of the timesteps; default "
                       "0.02,0.98")  # fmt: skip
    group.add_argument("--weighting", choices=["sds", "uniform"], help="weight of timesteps: the "
                       "variance of their noise (default), or 1")  # fmt: skip
    group.add_argument("--clip", type=float, metavar="F", help="greatest gradient of a picture, "
                       "root mean square")  # fmt: skip
    group.add_argument("--precision", choices=["full", "half", "bfloat"], help="numbers that the "
                       "guide computes with; default full")  # fmt: skip
    group.add_argument("--keep-structure", type=float, metavar="F", help="how strongly edges of "
                       "the old texture stay; default 0")  # fmt: skip
    group.add_argument("--device", choices=["cpu", "cuda"], help="where it is computed")
    group.add_argument("--offload", action="store_const", const=True, help="keep parts of the "
                       "guide in the memory of the CPU until they are needed")  # fmt: skip
    group.add_argument("--previews", metavar="DIR", help="folder for pictures of what it is like")
    group.add_argument("--every", type=int, metavar="N", help="steps between previews; default 50")
    group.add_argument("--resume", metavar="FILE", help="keeps the state in a file, and goes on "
                       "from it if it is there")  # fmt: skip


def with_settings(args: argparse.Namespace, operations: list[Values]) -> list[Values]:
    """Operations of a command line, with the flags added to those that generate textures.

    Raises:
        UsageError: A flag cannot be understood, is given for nothing, or --guide is missing.
    """
    given = {k: v for k in (*SETTINGS, *RUN) if (v := getattr(args, k)) is not None}
    mine = [v for v in operations if v.get("op") == "generate"]
    scripts = any("script" in v for v in operations)
    if given and not mine and not (scripts and not set(given) - set(RUN)):
        raise UsageError(f"--{next(iter(given)).replace('_', '-')} belongs to --generate")
    if args.every is not None and not (args.previews and args.every > 0):
        raise UsageError("--every is a number of steps, at least 1, between --previews")
    if args.resume is not None and len(mine) > 1:
        raise UsageError("--resume keeps the state of one --generate, not of several")
    if not mine:
        return operations
    if "guide" not in given:
        raise UsageError("--generate needs --guide: a model, a picture or the name of a plug-in")
    settings = {k: v for k, v in given.items() if k in SETTINGS}
    if "times" in settings:
        try:
            low, high = (float(v) for v in settings["times"].split(","))
        except ValueError:
            raise UsageError(f"--times {settings['times']}: must be LEAST,MOST") from None
        settings["times"] = [low, high]
    return [v | settings if v.get("op") == "generate" else v for v in operations]


@contextlib.contextmanager
def watched(args: argparse.Namespace) -> Iterator[None]:
    """Lets textures be generated as the flags say while it lasts, with a progress bar."""
    from ..generate.run import Run, running

    bars: dict[str, tuple[Bar, int]] = {}

    def progress(stage: str, done: int, total: int) -> None:
        bar, before = bars.get(stage) or (Bar(total, stage, args.quiet), 0)
        bar.advance(done - before)
        bars[stage] = bar, done
        if done == total:
            bar.close()
            del bars[stage]

    run = Run(
        args.device or "cpu", bool(args.offload), progress,
        Path(args.previews) if args.previews else None, args.every or 50,
        Path(args.resume) if args.resume else None,
    )  # fmt: skip
    try:
        with running(run):
            yield
    finally:
        for bar, _ in bars.values():
            bar.close()
