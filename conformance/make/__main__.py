"""Generates all cases: ``python -m conformance.make``; with --check only compares them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from . import generator


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser("conformance.make", description="Make all cases anew.")
    parser.add_argument("--check", action="store_true", help="write nothing, compare with the disk")
    if not parser.parse_args(argv).check:
        generator.write()
        return 0
    wrong = generator.differences()
    for place in wrong:
        print(f"{place}: differs from what the generator makes", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
