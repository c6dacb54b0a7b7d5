"""Measures whether the suite detects small faults: ``python -m conformance.mutants``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# Set before numpy starts threads, from which the small matrix products here gain nothing.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from ..cases import load
from . import inputs
from .source import choose
from .verdicts import WANTED, Suite, all_mutants, judged, summary


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = argparse.ArgumentParser(
        "conformance.mutants", description="Test the suite with decoders that have small faults."
    )
    add = p.add_argument
    add("--count", type=int, default=200, help="mutants to try; 200 by default")
    add("--seed", type=int, default=0, help="which ones; 0 by default")
    add("--only", metavar="FILE", default="*", help="files of the package, with * and ?")
    add("--json", type=Path, metavar="FILE", help="write the verdicts there too")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns 0 if enough mutants are caught, otherwise 1."""
    parser = arguments()
    args = parser.parse_args(argv)
    suite = Suite(load())
    found = all_mutants(args.only)
    if args.count < 1 or not found:
        parser.error(f"no mutant of {args.only}")
    reached = [mutant for mutant in found if suite.runs(mutant)]
    functions = {(mutant.file, mutant.function) for mutant in reached}
    beside = [m for m in found if (m.file, m.function) in functions and not suite.runs(m)]
    verdicts = judged(
        choose(reached, args.count, args.seed),
        suite,
        lambda: Suite(inputs.cases()),
        lambda text: print(text, flush=True),
    )
    text, share = summary(verdicts, len(beside), len(beside) + len(reached))
    print(text)
    if args.json:
        report: dict[str, Any] = {
            "seed": args.seed,
            "share": share,
            "mutants": [
                {"mutant": v.mutant.key, "operator": v.mutant.operator, "line": v.mutant.lines[0],
                 "verdict": v.kind, "why": v.why}
                for v in verdicts
            ],
            "not_reached": [m.key for m in beside],
        }  # fmt: skip
        args.json.write_text(json.dumps(report, indent=1) + "\n")
    return 0 if share >= WANTED else 1


if __name__ == "__main__":
    sys.exit(main())
