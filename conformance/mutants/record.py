"""Recording of the lines of the decoder that each case runs."""

from __future__ import annotations

import contextlib
import io
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from ..cases import Case
from .runs import ROOT, Decoder, forked

Lines = set[tuple[str, int]]

SLOWER, LEAST = 5, 1.0
"""Limits on the processor time of a case.

The first is a factor of the time that the case takes while its lines are recorded, which is twice
its usual time. The second is the least limit in seconds.
"""


@dataclass
class Record:
    """Behaviour of the decoder without a fault.

    Attributes:
        seconds: Processor time of each case while its lines are recorded.
        caps: Processor time that each case may take.
        cases: Names of the cases that run a line, by file within the package and line number.
        importing: Lines that run when modules are imported.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    caps: dict[str, float] = field(default_factory=dict)
    cases: dict[tuple[str, int], set[str]] = field(default_factory=dict)
    importing: Lines = field(default_factory=set)

    def of(self, file: str, first: int, last: int) -> set[str]:
        """Names of the cases that run a line in `first`..`last`; all if one runs at import."""
        lines = [(file, n) for n in range(first, last + 1)]
        if not self.importing.isdisjoint(lines):
            return {*self.seconds}
        return set().union(*(self.cases.get(line, set()) for line in lines))


def recorded(cases: Sequence[Case]) -> Record:
    """Runs all cases; records their lines and times.

    Raises:
        RuntimeError: The decoder without a fault fails a case.
    """
    record = Record()
    said, status = forked(lambda out: _record_all(cases, out))
    for line in map(json.loads, said):
        if line["problem"]:
            raise RuntimeError(f"{line['case']}: the decoder itself fails: {line['problem']}")
        lines = {(file, n) for file, numbers in line["lines"].items() for n in numbers}
        if not line["case"]:
            record.importing = lines
            continue
        record.seconds[line["case"]] = line["seconds"]
        record.caps[line["case"]] = max(SLOWER * line["seconds"], LEAST)
        for at in lines:
            record.cases.setdefault(at, set()).add(line["case"])
    if status or len(record.seconds) != len(cases):
        raise RuntimeError(f"the decoder itself ends with status {status}")
    return record


def _record_all(cases: Sequence[Case], out: io.TextIOBase) -> None:
    """Writes the record of the import and of each case as lines of JSON."""
    with _traced() as lines:
        decode = Decoder(None)
    print(json.dumps({"case": "", "problem": "", "lines": _listed(lines)}), file=out)
    for case in cases:
        # Each case has a process of its own, so that caches of others do not hide lines.
        said, status = forked(partial(_record_one, case, decode))
        end = {"case": case.name, "problem": f"status {status}"}
        print("\n".join(said) if said and not status else json.dumps(end), file=out)


def _record_one(case: Case, decode: Decoder, out: io.TextIOBase) -> None:
    """Writes the record of one case as a line of JSON."""
    before = time.process_time()
    with _traced() as lines:
        problem = decode.problem(case)
    seconds = time.process_time() - before
    end = {"case": case.name, "problem": problem, "seconds": seconds, "lines": _listed(lines)}
    print(json.dumps(end), file=out)


def _listed(lines: Lines) -> Mapping[str, list[int]]:
    """Line numbers by file."""
    found: dict[str, list[int]] = {}
    for file, number in sorted(lines):
        found.setdefault(file, []).append(number)
    return found


@contextlib.contextmanager
def _traced() -> Iterator[Lines]:
    """Context that yields a set of the lines of the package that run, filled as they do."""
    lines: Lines = set()
    files: dict[str, str | None] = {}

    def called(frame: FrameType, event: str, argument: object) -> Any:
        name = frame.f_code.co_filename
        if name not in files:
            path = Path(name)
            inside = path.is_relative_to(ROOT)
            files[name] = path.relative_to(ROOT).as_posix() if inside else None
        file = files[name]
        if file is None:
            return None

        def stepped(frame: FrameType, event: str, argument: object) -> Any:
            lines.add((file, frame.f_lineno))
            return stepped

        return stepped(frame, event, argument)

    sys.settrace(called)
    try:
        yield lines
    finally:
        sys.settrace(None)
