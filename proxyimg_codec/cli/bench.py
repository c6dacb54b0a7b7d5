"""pxi-bench: measures this codec beside others."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, UsageError
from . import bench_paper
from .common import EXIT_CODES, Bar, parser, printable, processes_of, run

if TYPE_CHECKING:
    from ..bench.peers import Codec
    from ..bench.rd import Failure
    from ..bench.rows import Row

RD = """Rate-distortion of every picture of a folder by every codec, in one run: whole files, the
same 8-bit pixels, PSNR and MS-SSIM over RGB, CPU seconds of each call on one thread. DIR receives
rd.csv (all measurements), summary.csv and summary.md (BD-rates), and a plot for each measure as
.png and .svg. Pictures with transparency are judged on black and on white; codecs without it leave
them out."""


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser("pxi-bench", "Measure the codec beside others.")
    tools = p.add_subparsers(dest="benchmark", required=True, metavar="BENCHMARK")
    bench_paper.add(tools)
    rd = tools.add_parser(
        "rd", prog="pxi-bench", usage="pxi-bench rd [options] FOLDER", allow_abbrev=False,
        help="rate-distortion: BD-rates and plots", description=RD, epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    add = rd.add_argument
    add("folder", metavar="FOLDER", nargs="?", help="folder of pictures")
    add("--dataset", metavar="FOLDER", help="the same, by name")
    add("-o", "--out", metavar="DIR", default="rd", help="where the results go; default rd")
    add("--codecs", metavar="A,B", help="default jpeg,webp,jp2,jxl,avif420,avif444,pxi-fast,pxi; "
        "more are avif420-s0, avif444-s0 to -s3, svt, pxi-masks, pxi-implicit")  # fmt: skip
    add("--speed0", action="store_true", help="also AVIF 4:2:0 and 4:4:4 at speed 0, which is slow")
    add("--equal-time", action="store_true", help="also AVIF 4:4:4 at the speed that takes about "
        "as long as pxi; it is tried on the first picture")  # fmt: skip
    add("--perceptual", action="store_true", help="also SSIMULACRA 2, about half a second a file")
    add("--masks", metavar="FOLDER", help="label maps NAME.png, or folders NAME of masks: also "
        "pxi-masks, with their layers, on the pictures that have one")  # fmt: skip
    add("--images", metavar="N|A,B", help="only the first N pictures, or these names")
    add("--qualities", metavar="CODEC=Q,Q", action="append", default=[],
        help="other qualities for one codec; repeatable")  # fmt: skip
    add("-e", "--effort", type=int, metavar="1-9", help="effort of pxi; default 5")
    add("--range", metavar="LOW,HIGH", default="0.15,1.2", help="bits a pixel that BD-rates look "
        "at; default 0.15,1.2")  # fmt: skip
    add("--reuse", metavar="CSV", help="take what still holds from an earlier rd.csv: same pixels, "
        "codec, settings, versions and quality")  # fmt: skip
    add("--published", action="store_true", help="draw the published curves of the Kodak pictures "
        "(as if FOLDER held kodim01 to kodim24)")  # fmt: skip
    add("-j", "--jobs", type=int, metavar="N", help="cores to use, by as many processes; all by "
        "default")  # fmt: skip
    add("-f", "--force", action="store_true", help="replace the results in DIR")
    add("--quiet", action="store_true", help="print nothing but errors")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    words = sys.argv[1:] if argv is None else argv
    work = bench_paper.work if args.benchmark == "paper" else rate_distortion
    return run("pxi-bench", lambda: work(args, shlex.join(["pxi-bench", *words])))


def rate_distortion(args: argparse.Namespace, command: str) -> None:
    """Runs the benchmark ``rd``.

    Args:
        args: The parsed command line.
        command: The command line as text, for the report.

    Raises:
        UsageError: Arguments contradict each other or are out of range.
        InputError: Some measurements failed, or results cannot be read or written.
    """
    from ..bench import rd, report
    from ..bench.rows import read_csv

    folder = folder_of(args)
    rates = parse_range(args.range)
    chosen = choose(args)
    jobs = processes_of(args)
    old = [] if args.reuse is None else read_csv(args.reuse)
    out = Path(args.out)
    check_out(out, args)
    sources = rd.find(folder, args.images, None if args.masks is None else Path(args.masks))
    if args.equal_time:
        chosen = list(dict.fromkeys([*chosen, rd.as_slow(sources[0], args.effort)]))
    tasks = rd.plan(sources, chosen, args.perceptual)
    if not tasks:
        raise UsageError("nothing to do: no chosen codec can code these pictures")

    say = (lambda text: None) if args.quiet else print
    say(report.header(command, tasks, sources, chosen, jobs))
    out.mkdir(exist_ok=True)
    log = report.Log(out / "rd.csv", tasks, old)
    if args.reuse is not None:
        say(log.reuse_note(args.reuse))
    bar = Bar(len(log.open_tasks), "measuring", args.quiet)

    def finished(result: Row | Failure) -> None:
        log.add(result)
        bar.advance(1)

    try:
        if log.open_tasks:
            rd.run(log.open_tasks, jobs, finished)
    finally:
        bar.close()
        log.close()
        if not log.complete:
            say(f"{len(log.rows)} of {len(tasks)} measurements are in {log.path}; "
                f"--reuse {log.path} goes on from there")  # fmt: skip
    if log.rows:
        published = args.published or report.is_kodak(sources)
        name = printable(folder.resolve().name)
        say(report.write(out, log.rows, chosen, name, rates, published))
    if log.failures:
        raise InputError(f"{len(log.failures)} of {len(tasks)} measurements failed, "
                         f"the first: {log.failures[0].message}")  # fmt: skip


def folder_of(args: argparse.Namespace) -> Path:
    """Folder of the pictures, given by position or as --dataset.

    Raises:
        UsageError: It is given twice, or not at all.
    """
    given = [f for f in (args.folder, args.dataset) if f is not None]
    if len(given) != 1:
        raise UsageError("one folder of pictures is needed")
    return Path(given[0])


def check_out(out: Path, args: argparse.Namespace) -> None:
    """Refuses to replace pictures, and earlier results except those that --reuse continues.

    Raises:
        UsageError: The folder is that of the pictures or masks.
        InputError: The folder holds other results, or cannot be made.
    """
    for place in (args.folder, args.dataset, args.masks):
        if place is not None and out.exists() and Path(place).exists() and out.samefile(place):
            raise UsageError(f"--out {out}: the results need a folder of their own")
    path = out / "rd.csv"
    if path.exists() and not args.force:
        if args.reuse is None or not path.samefile(args.reuse):
            raise InputError(f"{path}: exists already; --reuse it, use --force to replace it, or "
                             "choose another folder with --out")  # fmt: skip
    elif out.exists() and not out.is_dir():
        raise InputError(f"{out}: is not a folder")
    elif not out.absolute().parent.is_dir():
        raise InputError(f"{out}: its folder does not exist")


def choose(args: argparse.Namespace) -> list[Codec]:
    """Codecs that the flags ask for, with their qualities.

    Raises:
        UsageError: A codec is unknown, an effort or quality is out of range, or --masks is missing.
    """
    from dataclasses import replace

    from ..bench.peers import EFFORT, codecs

    effort = EFFORT if args.effort is None else args.effort
    if not 1 <= effort <= 9:
        raise UsageError(f"--effort {effort}: must be 1..9")
    table = codecs(effort)
    names = [n for n, c in table.items() if c.default]
    if args.codecs is not None:
        names = args.codecs.split(",")
    names += ["avif420-s0", "avif444-s0"] * args.speed0 + ["pxi-masks"] * (args.masks is not None)
    unknown = [n for n in names if n not in table]
    if unknown:
        raise UsageError(f"unknown codec {unknown[0]!r}; there are {', '.join(table)}")
    if args.masks is None and any(table[n].masks for n in names):
        raise UsageError("pxi-masks needs --masks FOLDER")
    for text in args.qualities:
        name, _, values = text.partition("=")
        if name not in names:
            raise UsageError(f"--qualities {text}: {name!r} is not a codec of this run")
        try:
            numbers = sorted({float(v) for v in values.split(",")})
        except ValueError:
            raise UsageError(f"--qualities {text}: must be CODEC=Q,Q,...") from None
        codec = table[name]
        table[name] = replace(codec, qualities=tuple(codec.checked(q) for q in numbers))
    return [table[n] for n in dict.fromkeys(names)]


def parse_range(text: str) -> tuple[float, float]:
    """Parses --range: the lower and the upper bound in bits a pixel.

    Raises:
        UsageError: The text is not LOW,HIGH with 0 <= LOW < HIGH.
    """
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        low = high = 0.0
    if not 0 <= low < high:
        raise UsageError(f"--range {text}: must be LOW,HIGH in bits a pixel")
    return low, high


if __name__ == "__main__":
    sys.exit(main())
