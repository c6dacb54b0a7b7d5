"""What lines of the decoder each case runs."""

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
"""A case may take so many times the processor time that it takes while its lines are recorded,
which is twice what it takes alone; and at least these seconds."""


@dataclass
class Record:
    """What the right decoder does.

    Attributes:
        seconds: Processor time of each case while its lines are recorded.
        caps: Processor time that each may take.
        cases: Names of the cases that run a line, by file within the package and number.
        importing: Lines that run when modules are imported.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    caps: dict[str, float] = field(default_factory=dict)
    cases: dict[tuple[str, int], set[str]] = field(default_factory=dict)
    importing: Lines = field(default_factory=set)

    def of(self, file: str, first: int, last: int) -> set[str]:
        """The cases that run one of some lines; all if they run at import."""
        lines = [(file, n) for n in range(first, last + 1)]
        if not self.importing.isdisjoint(lines):
            return {*self.seconds}
        return set().union(*(self.cases.get(line, set()) for line in lines))


def recorded(cases: Sequence[Case]) -> Record:
    """What lines the cases run, and how long they take.

    Raises:
        RuntimeError: The decoder fails a case as it is.
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
    with _traced() as lines:
        decode = Decoder(None)
    print(json.dumps({"case": "", "problem": "", "lines": _listed(lines)}), file=out)
    for case in cases:
        # What is computed once and kept must be seen in every case.
        said, status = forked(partial(_record_one, case, decode))
        end = {"case": case.name, "problem": f"status {status}"}
        print("\n".join(said) if said and not status else json.dumps(end), file=out)


def _record_one(case: Case, decode: Decoder, out: io.TextIOBase) -> None:
    before = time.process_time()
    with _traced() as lines:
        problem = decode.problem(case)
    seconds = time.process_time() - before
    end = {"case": case.name, "problem": problem, "seconds": seconds, "lines": _listed(lines)}
    print(json.dumps(end), file=out)


def _listed(lines: Lines) -> Mapping[str, list[int]]:
    found: dict[str, list[int]] = {}
    for file, number in sorted(lines):
        found.setdefault(file, []).append(number)
    return found


@contextlib.contextmanager
def _traced() -> Iterator[Lines]:
    """The lines of the package that run, by file within it."""
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
