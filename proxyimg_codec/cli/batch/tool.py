"""Tools that take several inputs, and their flags for these."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .work import Work


@dataclass(frozen=True)
class Tool:
    """Differences between tools that make an output of each input.

    Attributes:
        prog: Name of the tool.
        suffix: Suffix of outputs in a folder.
        takes: Whether a file that is found in a folder is an input.
        check: Raises an error if the command line makes no sense for any input.
        work: Does the work for one input: the command line then has `input` and `output`, which may
            be None, and the `inputs` that must not be replaced. It can be pickled.
        tell: Tells of what was made, given the report, the command line, and a function that
            prints a line.
        hush: Whether the flag --quiet silences warnings.
    """

    prog: str
    suffix: str
    takes: Callable[[str], bool]
    check: Callable[[argparse.Namespace], None]
    work: Work
    tell: Callable[[dict[str, Any], argparse.Namespace, Callable[[str], None]], None]
    hush: bool


def add_batch(p: argparse.ArgumentParser) -> None:
    """Adds the flags for several inputs."""
    add = p.add_argument_group("several pictures").add_argument
    add("--resume", action="store_true", help="leave what an earlier batch made of the same input "
        "with the same settings; make anew what it made of others or did not finish")  # fmt: skip
    add("--report", metavar="FILE", help="write a line of JSON for each input")
    add("--dask", metavar="ADDRESS", help="on a Dask cluster, whose workers see the same folders; "
        "such as tcp://10.0.0.1:8786")  # fmt: skip
    add("--ray", action="store_true", help="on a Ray cluster, that of RAY_ADDRESS or of this "
        "machine")  # fmt: skip
    p.set_defaults(batch=False)
