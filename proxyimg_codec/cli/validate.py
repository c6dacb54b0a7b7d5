"""pxi-validate: checks whether .pxi files are valid, and warns of oddities.

Errors have the id of the statement of the specification that is broken, such as CON-6; SEC-2 stands
for a limit of this program. Warnings and notes have the codes VAL-1, VAL-2 and so on;
`warnings.CODES` lists them.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict
from typing import Any

from ..errors import FormatError, InputError, LimitError, PxiError, UnsupportedError
from ..io.files import read_bytes
from ..limits import Limits
from ..validation import validate
from ..validation.warnings import CODES, ERROR, WARNING, Issue
from .common import add_limits, limits_of, parser, printable, run

RESULTS: dict[str, type[PxiError] | None] = {
    "invalid": FormatError,
    "unsupported": UnsupportedError,
    "limit": LimitError,
    "unreadable": InputError,
    "valid": None,
}
"""Results of a check, the worst first, with the error that each raises."""

EPILOG = "of several files the worst counts: 4, 5, 6, 3\n\nwarnings and notes:\n" + "\n".join(
    f"  {code:6} {meaning}" for code, meaning in CODES.items()
)


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser("pxi-validate", "Check .pxi files completely.")
    p.epilog = f"{p.epilog}{EPILOG}"
    p.add_argument("input", metavar="IN", nargs="+", help=".pxi file, or - for standard input")
    add_limits(p)
    p.add_argument("--json", action="store_true", help="print JSON")
    p.add_argument("--strict", action="store_true", help="warnings count as errors: exit code 4")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    return run("pxi-validate", lambda: check(args))


def check(args: argparse.Namespace) -> None:
    """Checks the files and prints the issues that were found.

    Raises:
        PxiError: A file is not valid; the class is that of the worst result. With --strict,
            warnings raise FormatError.
    """
    limits = limits_of(args)
    reports = [report(path, limits) for path in args.input]
    if args.json:
        print(json.dumps({"files": reports}, indent=2))
    else:
        print("\n".join(map(text, reports)))
    bad = [r for r in reports if r["result"] != "valid"]
    for result, error in RESULTS.items():
        if error and any(r["result"] == result for r in bad):
            raise error(f"not valid: {len(bad)} of {len(reports)}")
    doubtful = sum(any(v["severity"] == WARNING for v in r["issues"]) for r in reports)
    if args.strict and doubtful:
        raise FormatError(f"valid, but with warnings: {doubtful} of {len(reports)}")


def report(path: str, limits: Limits) -> dict[str, Any]:
    """Checks a file; returns the result and its issues, ready for JSON."""
    try:
        issues, profile, level = validate.report(read_bytes(path), limits)
    except InputError as error:
        issues = [Issue("", ERROR, str(error), exit_code=error.exit_code)]
        profile = level = None
    found = {v.exit_code for v in issues}
    result = next(name for name, error in RESULTS.items() if not error or error.exit_code in found)
    return {
        "file": path,
        "result": result,
        "profile": profile,
        "level": level,
        "issues": [{k: v for k, v in asdict(i).items() if k != "exit_code"} for i in issues],
    }


def text(report: dict[str, Any]) -> str:
    """Formats the report on a file as text."""
    counts = Counter(v["severity"] for v in report["issues"])
    total = ", ".join(f"{n} {name}{'s' * (n > 1)}" for name, n in counts.items())
    fits = f", {report['profile']}, level {report['level']}" if report["level"] else ""
    lines = [f"{report['file']}: {report['result']}{fits}{f' ({total})' * bool(total)}"]
    for v in report["issues"]:
        chunk = f"chunk {v['chunk']}" if v["chunk"] else ""
        place = " ".join(p for p in (chunk, _at(v["offset"])) if p)
        lines.append(
            "  "
            + ": ".join(
                p for p in (f"{v['severity']} {v['code']}".strip(), place, v["message"]) if p
            )
        )
    return "\n".join(map(printable, lines))


def _at(offset: int | None) -> str:
    return "" if offset is None else f"at byte {offset}"


if __name__ == "__main__":
    sys.exit(main())
