"""Verdicts on mutants: whether the suite detects decoders with small faults.

This is mutation testing of the suite. The source of the decoder is changed in one place, and the
cases that run that place must notice. A mutant that survives then decodes other files. If it
differs from the decoder without a fault on one of these, the suite has a gap.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from ..cases import Case
from .record import Record, recorded
from .runs import ROOT, Caught, Fault, run
from .source import Mutant, mutants, mutated

FILES = (
    "container/[!_]*.py", "entropy/[!_]*.py", "geometry/[!_]*.py", "texture/[!_]*.py",
    "render/compose.py", "render/view.py", "render/pixels.py", "render/moment.py",
    "render/neighbours.py", "codec/read.py", "codec/unpack.py", "model.py",
)  # fmt: skip
"""Files of the package that decode; mutants are made of the lines in them that the suite runs."""

NOT_DRAWN = {
    "container/tree.py", "container/undo.py", "texture/context_native.py",
    "texture/synthesis_native.py",
}  # fmt: skip
"""Files that the plain decoder does not need: chunks that it may ignore [CON-9], the kernel."""

EQUIVALENT = Path(__file__).with_name("equivalent.json")
"""File of mutants that were examined and found to be no fault, each with the reason."""

WANTED = 0.9
"""Share of faults that the suite must detect."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on a mutant.

    Attributes:
        mutant: The mutant.
        kind: ``caught``; ``equivalent`` if `EQUIVALENT` says so; ``changes`` if a file outside the
            suite shows the fault; or ``unknown``.
        why: The case that failed and its problem, or the reason.
    """

    mutant: Mutant
    kind: str
    why: str


class Suite:
    """Cases, and a record of the decoder without a fault."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self.cases = cases
        self.record: Record = recorded(cases)

    def runs(self, mutant: Mutant) -> bool:
        """Whether a case runs the place of a mutant."""
        return bool(self.record.of(mutant.file, *mutant.lines))

    def catches(self, mutant: Mutant) -> Caught | None:
        """First case that a mutant fails, of those that run its place; quick ones come first."""
        names = self.record.of(mutant.file, *mutant.lines)
        concerned = sorted(
            (case for case in self.cases if case.name in names),
            key=lambda case: self.record.seconds[case.name],
        )
        return run(concerned, fault(mutant), self.record.caps)


def fault(mutant: Mutant) -> Fault:
    """Module of a mutant."""
    path = ROOT / mutant.file
    tree = mutated(path.read_text("utf-8"), mutant.number)
    return Fault(mutant.file, compile(tree, str(path), "exec"))


def all_mutants(pattern: str = "*") -> list[Mutant]:
    """All mutants of `FILES` whose path matches a pattern."""
    paths = sorted({path for name in FILES for path in ROOT.glob(name)})
    names = [path.relative_to(ROOT).as_posix() for path in paths]
    return [
        mutant
        for name in names
        if name not in NOT_DRAWN and fnmatchcase(name, pattern)
        for mutant in mutants(name, (ROOT / name).read_text("utf-8"))
    ]


def judged(
    chosen: Iterable[Mutant], suite: Suite, more: Callable[[], Suite], say: Callable[[str], None]
) -> list[Verdict]:
    """Judges mutants.

    Args:
        chosen: The mutants.
        suite: The suite.
        more: Function that makes files outside the suite; called if they are needed.
        say: Function that prints a verdict.
    """
    known: dict[str, str] = json.loads(EQUIVALENT.read_text("utf-8"))
    others: Suite | None = None
    verdicts = []
    for mutant in chosen:
        caught = suite.catches(mutant)
        if caught is not None:
            verdict = Verdict(mutant, "caught", f"{caught.case}: {caught.problem}")
        elif mutant.key in known:
            verdict = Verdict(mutant, "equivalent", known[mutant.key])
        else:
            others = others or more()
            caught = others.catches(mutant)
            verdict = (
                Verdict(mutant, "changes", f"{caught.case}: {caught.problem}")
                if caught
                else Verdict(mutant, "unknown", "no file shows a difference")
            )
        say(f"{verdict.kind:10} {mutant}\n{'':11}{verdict.why}")
        verdicts.append(verdict)
    return verdicts


def summary(verdicts: Sequence[Verdict], missed: int, places: int) -> tuple[str, float]:
    """Text with the numbers of verdicts, and the share of mutants caught.

    The share is of the mutants that are not known to be equivalent.

    Args:
        verdicts: The verdicts.
        missed: Number of mutants that the suite does not run, in functions that it runs.
        places: Number of all mutants in these functions.
    """
    count = Counter(verdict.kind for verdict in verdicts)
    faults = len(verdicts) - count["equivalent"]
    share = count["caught"] / faults if faults else 1.0
    return (
        f"{len(verdicts)} mutants: {count['caught']} caught, {count['changes']} survive though "
        f"they change what is decoded, {count['unknown']} survive and nobody knows whether they "
        f"do, {count['equivalent']} are equivalent\n"
        f"{share:.1%} of those that are not equivalent are caught; {WANTED:.0%} are wanted\n"
        f"not reached: {missed} of {places} places in functions that the suite runs",
        share,
    )
