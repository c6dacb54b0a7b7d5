"""pxi-bench paper: the paper's tables, made again."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..bench.paper import SECTIONS
from ..errors import InputError, UsageError
from .common import EXIT_CODES, Bar, processes_of

if TYPE_CHECKING:
    from ..bench.rd import Failure

PAPER = f"""The paper's tables on open pictures, with its figures beside ours and rivals that are
fitted in the same run. DIR receives report.md and report.html, a CSV file and plots of each
section, and the measurements as JSON files in items/.

sections:
{chr(10).join(f"  {name:12}{title}" for name, title in SECTIONS.items())}"""


def add(tools: Any) -> None:
    """Adds the subcommand to those of the argument parser."""
    p = tools.add_parser(
        "paper", prog="pxi-bench", usage="pxi-bench paper [options] --data DIR",
        allow_abbrev=False, help="the paper's tables, made again", description=PAPER,
        epilog=EXIT_CODES, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    p.add_argument(
        "--data",
        metavar="DIR",
        required=True,
        help="folder with kodak/, kodak_masks/, photo2k/, "
        "emoji/ and clipart/; sections without pictures are left out. It may have humanedit/ and "
        "oir-bench/",
    )
    p.add_argument("-o", "--out", metavar="DIR", default="paper", help="where the results go; "
                   "default paper")  # fmt: skip
    p.add_argument("--only", metavar="A,B", help="only these sections")
    p.add_argument("--photos", metavar="DIR", action="append", default=[], help="folder of "
                   "photographs to compress instead of photo2k/, such as DIV2K; may be given "
                   "several times")  # fmt: skip
    p.add_argument("--weights", metavar="NAME=PATH", action="append", default=[], help="networks "
                   "that judge edits: clip=FOLDER, dino=FOLDER (of transformers), lpips=FILE.onnx;"
                   " may be given several times")  # fmt: skip
    p.add_argument("--quick", action="store_true", help="two crops of 256x256 a section and short "
                   "fits: minutes instead of a night")  # fmt: skip
    p.add_argument("--resume", action="store_true", help="go on from the measurements in DIR that "
                   "still hold: same pictures, settings, code and versions")  # fmt: skip
    p.add_argument("--report", action="store_true", help="measure nothing more; report what is "
                   "in DIR and still holds")  # fmt: skip
    p.add_argument("-j", "--jobs", type=int, metavar="N", help="cores to use, by as many "
                   "processes; all by default")  # fmt: skip
    p.add_argument("-f", "--force", action="store_true", help="replace the results in DIR")
    p.add_argument("--quiet", action="store_true", help="print nothing but errors")


def work(args: argparse.Namespace, command: str) -> None:
    """Runs the benchmark ``paper``.

    Args:
        args: The parsed command line.
        command: The command line as text, for the report.

    Raises:
        UsageError: Arguments contradict each other or are out of range.
        InputError: Some measurements failed, or results cannot be read or written.
    """
    from ..bench.paper import report, run
    from ..bench.paper.items import FULL, QUICK, Given

    names = list(SECTIONS) if args.only is None else args.only.split(",")
    unknown = [n for n in names if n not in SECTIONS]
    if unknown:
        raise UsageError(f"--only: unknown section {unknown[0]!r}; there are {', '.join(SECTIONS)}")
    jobs = processes_of(args)
    data, out = Path(args.data), Path(args.out)
    check_out(out, args)
    given = Given(data, tuple(Path(p) for p in args.photos), weights_of(args.weights))
    plan = run.plan(given, names, QUICK if args.quick else FULL)
    out.mkdir(exist_ok=True)
    if not (args.resume or args.report):
        run.forget(out, plan)
    groups = [] if args.report else plan.groups(out)

    def say(text: str) -> None:
        if not args.quiet:
            print(text, flush=True)  # what waits in a buffer is dropped when a run is interrupted

    head = report.header(command)
    say("\n".join(head))
    for name, why in plan.absent.items():
        say(f"{name} is left out: {why}")
    bar = Bar(len(groups), "measuring", args.quiet)
    done: list[Failure | None] = []

    def finished(result: Failure | None) -> None:
        done.append(result)
        bar.advance(1)

    try:
        run.measure(groups, jobs, finished)
    finally:
        bar.close()
        if len(done) < len(groups):
            say(f"what was measured is in {out / 'items'}; --resume goes on from there")
    run.write(out, plan, head)
    say(f"{out / 'report.md'}, {out / 'report.html'}")
    failures = [result.message for result in done if result is not None]
    if failures:
        raise InputError(f"{len(failures)} of {len(groups)} pictures failed, the first: "
                         f"{failures[0]}")  # fmt: skip


def weights_of(words: Sequence[str]) -> dict[str, Path]:
    """Weights by name, of words ``NAME=PATH``.

    Raises:
        UsageError: A word is something else, or its name is unknown.
        InputError: There is no such file.
    """
    from ..bench.paper.judges import NAMES

    found = {}
    for word in words:
        name, _, path = word.partition("=")
        if name not in NAMES or not path:
            raise UsageError(f"--weights {word}: give NAME=PATH with {', '.join(NAMES)} as NAME")
        if not Path(path).exists():
            raise InputError(f"--weights {word}: does not exist")
        found[name] = Path(path).absolute()
    return found


def check_out(out: Path, args: argparse.Namespace) -> None:
    """Refuses to replace earlier results except those that --resume continues.

    Raises:
        UsageError: The folder is that of the pictures, or flags contradict each other.
        InputError: The folder holds other results, or cannot be made.
    """
    if args.report:
        args.resume = True
    if args.resume and args.force:
        raise UsageError("--resume keeps the results that --force would replace")
    if out.exists() and Path(args.data).exists() and out.samefile(args.data):
        raise UsageError(f"--out {out}: the results need a folder of their own")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is not a folder")
    if not out.absolute().parent.is_dir():
        raise InputError(f"{out}: its folder does not exist")
    if any((out / n).exists() for n in ("items", "report.md")) and not args.resume | args.force:
        raise InputError(f"{out}: holds results already; --resume goes on from them, --force "
                         "replaces them, or choose another folder with --out")  # fmt: skip
