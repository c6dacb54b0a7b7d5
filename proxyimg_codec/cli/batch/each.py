"""Inputs of a command line, one or a batch, and what becomes of them."""

from __future__ import annotations

import argparse
import os
import sys

from ...errors import UsageError
from ..common import run, warnings_shown
from .inputs import is_folder, is_many, pairs
from .run import run_batch
from .tool import Tool


def each(tool: Tool, args: argparse.Namespace) -> int:
    """Runs a tool on its inputs; several, a folder or a pattern are a batch.

    What fails with one input does not stop the others; each failure is one line on stderr.

    Args:
        tool: The tool.
        args: The command line, as of `places.add_files` and `tool.add_batch`.

    Returns:
        The exit code: that of the first input that failed; of an interruption, which ends all.
    """
    found: list[tuple[str, str | None]] = []
    first = 0

    def prepare() -> None:
        found.extend(pairs(args.files, args.out, tool.suffix, tool.takes, _stacks(args)))
        args.inputs = [source for source, _ in found]
        tool.check(args)
        _check_batch(args)
        if args.out is not None and args.out.endswith("/"):
            os.makedirs(args.out, exist_ok=True)

    def all_of_them() -> None:
        nonlocal first
        first = run_batch(tool, args, [(source, str(output)) for source, output in found])

    def only() -> None:
        (source, output), *_ = found
        one = argparse.Namespace(**vars(args), input=source, output=output)
        with warnings_shown(tool.prog, args.quiet and tool.hush):
            tool.tell(tool.work(one), args, _say)

    code = run(tool.prog, prepare)
    if code:
        return code
    return run(tool.prog, all_of_them if _is_batch(args) else only) or first


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def _stacks(args: argparse.Namespace) -> bool:
    """Whether a folder is one input."""
    return bool(getattr(args, "stack", False))


def _is_batch(args: argparse.Namespace) -> bool:
    """Whether several inputs are meant, even if there is only one."""
    if not is_folder(args.out):
        return False
    many = any(is_many(name, _stacks(args)) for name in args.files)
    return many or len(args.inputs) > 1 or bool(_flags(args))


def _flags(args: argparse.Namespace) -> list[str]:
    """Flags that only a batch has."""
    return [f"--{name}" for name in ("resume", "report", "dask", "ray") if getattr(args, name)]


def _check_batch(args: argparse.Namespace) -> None:
    """Refuses flags for several pictures that cannot be.

    Raises:
        UsageError: They contradict each other, or there is no folder for outputs.
    """
    if args.jobs is not None and args.jobs < 1:
        raise UsageError(f"--jobs {args.jobs}: must be at least 1")
    given = _flags(args)
    if "--dask" in given and "--ray" in given:
        raise UsageError("--dask and --ray contradict each other")
    if given and not is_folder(args.out):
        raise UsageError(f"{given[0]}: needs a folder for the outputs: -o FOLDER/")
