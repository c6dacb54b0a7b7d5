"""Test of any decoder that is a command: ``python -m conformance.runner --decoder "CMD"``."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from .cases import FOLDER, LEVELS, PROFILES, Case, load
from .judge import Decoder, Digester, Result, judge
from .processes import command_decoder, command_digester, expand

_PYTHON = shlex.quote(sys.executable)
OWN_DECODER = f"{_PYTHON} -m proxyimg_codec.cli.decode {{in}} {{out}} {{args}}"
OWN_DIGESTER = f"{_PYTHON} -m conformance.symbols {{in}}"


def run(
    cases: Sequence[Case],
    decoder: Decoder,
    jobs: int = 1,
    suffix: str = ".png",
    digester: Digester | None = None,
) -> list[Result]:
    """Judges a decoder on every render of every case.

    Args:
        cases: The cases.
        decoder: The decoder to test.
        jobs: Number of runs at a time.
        suffix: Suffix of its output: ``.png`` or ``.npy``.
        digester: Function that hashes latents, if that is tested.

    Returns:
        The results, in the order of the cases and their renders.
    """
    runs = [(case, i) for case in cases for i in range(max(len(case.renders), 1))]
    if jobs == 1:
        return [judge(case, i, decoder, suffix, digester) for case, i in runs]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(lambda r: judge(r[0], r[1], decoder, suffix, digester), runs))


def table(results: Sequence[Result]) -> str:
    """Formats results, one a line: case, result, peak, RMS, seconds, and the problem."""
    width = max(len(r.case) for r in results) + 3
    lines = [f"{'case':{width}} result    peak     rms  seconds"]
    for r in results:
        name = f"{r.case} {r.render + 1}" if r.render else r.case
        errors = [f"{'-' if v is None else f'{v:.3f}':>7}" for v in (r.peak, r.rms)]
        verdict = "ok" if r.passed else "FAILED"
        line = f"{name:{width}} {verdict:6} {' '.join(errors)} {r.seconds:8.2f}  {r.problem}"
        lines.append(line.rstrip())
    return "\n".join(lines)


def listing(cases: Sequence[Case]) -> str:
    """Formats cases, one a line: name, kind, profile, level, title, outcome, and statements."""
    width = max(len(case.name) for case in cases)
    kinds = max(len("kind"), *(len(case.kind) for case in cases))
    lines = [f"{'case':{width}} {'kind':{kinds}} profile level  title"]
    lines += [
        f"{case.name:{width}} {case.kind:{kinds}} {case.profile:7} {case.level or '-':>5}  "
        f"{case.title} ({case.outcome}; {', '.join(case.tests)})"
        for case in cases
    ]
    return "\n".join(lines)


def failed_cases(results: Sequence[Result]) -> list[str]:
    """Names of the cases for which at least one run failed."""
    return list(dict.fromkeys(r.case for r in results if not r.passed))


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = argparse.ArgumentParser("conformance.runner", description="Test a decoder of .pxi files.")
    add = p.add_argument
    add("--decoder", metavar="CMD",
        help="command with {in}, {out} and {args}; pxi-decode by default")  # fmt: skip
    add("--latents", metavar="CMD",
        help="command with {in} that prints the SHA-256 of all latents; the package's own "
        "without --decoder")  # fmt: skip
    add("--cases", metavar="DIR", type=Path, default=FOLDER, help="folder of cases")
    add("--only", metavar="PATTERN", default="*", help="names of cases, with * and ?")
    add("--profile", choices=PROFILES, default=PROFILES[-1],
        help="what the decoder can do: cases up to this profile")  # fmt: skip
    add("--level", type=int, choices=LEVELS, default=LEVELS[-1],
        help="how much it can: cases up to this level")  # fmt: skip
    add("--list", action="store_true", help="print the cases instead of running them")
    add("--format", choices=["png", "npy"], default="png", help="type of output to ask for")
    add("-j", "--jobs", type=int, default=os.cpu_count() or 1, help="runs at a time")
    add("--timeout", type=float, default=30, metavar="S", help="seconds a run; 30 by default")
    add("--memory", type=int, default=1024, metavar="MB", help="megabytes a run; 1024 by default")
    add("--json", type=Path, metavar="FILE", help="write the results there too")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns 0 if all cases passed or were listed, and 1 if any failed."""
    parser = arguments()
    args = parser.parse_args(argv)
    if args.jobs < 1 or args.timeout <= 0 or args.memory < 1:
        parser.error("--jobs, --timeout and --memory must be positive")
    cases = load(args.cases, args.only, args.profile, args.level)
    if not cases:
        parser.error(f"no case in {args.cases} matches")
    if args.list:
        print(listing(cases))
        return 0
    template = args.decoder or OWN_DECODER
    hashing = args.latents or ("" if args.decoder else OWN_DIGESTER)
    try:
        program = expand(template, Path("in"), Path("out"), [])[0]
    except ValueError as error:
        parser.error(str(error))
    if shutil.which(program) is None:
        parser.error(f"{program} is not a program")
    started = time.perf_counter()
    decoder = command_decoder(template, args.timeout, args.memory << 20)
    digester = command_digester(hashing, args.timeout, args.memory << 20) if hashing else None
    results = run(cases, decoder, args.jobs, f".{args.format}", digester)
    seconds = time.perf_counter() - started
    failed = failed_cases(results)
    print(table(results))
    print(f"{len(cases) - len(failed)} of {len(cases)} cases passed, "
          f"{len(results)} runs, {seconds:.1f} s")  # fmt: skip
    if args.json:
        report = {
            "decoder": template,
            "cases": len(cases),
            "failed": failed,
            "seconds": seconds,
            "results": [asdict(r) | {"passed": r.passed} for r in results],
        }
        args.json.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n")
    return 1 if failed else 0


def command_line() -> int:
    """Runs `main` as a program: if nobody reads its output any more, the rest is dropped."""
    try:
        try:
            return main()
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 3


if __name__ == "__main__":
    sys.exit(command_line())
