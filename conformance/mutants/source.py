"""Mutants of one file, their names, and a fair choice of them.

DeMillo, Lipton, Sayward 1978, "Hints on Test Data Selection".
"""

from __future__ import annotations

import ast
import random
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

from .operators import changes

LONG = 120
"""Most characters of a statement that are printed."""


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Attributes:
        file: Path within the package.
        function: Qualified name of the function; empty at the level of the module.
        lines: First and last line of the statement, or of the head of a compound one.
        operator: Name of the mutation operator.
        before: Text of the statement.
        after: Text of the changed statement.
        number: Position among all mutants of the file.
        again: Number of mutants before it in the function that have the same texts.
    """

    file: str
    function: str
    lines: tuple[int, int]
    operator: str
    before: str
    after: str
    number: int
    again: int = 0

    @property
    def key(self) -> str:
        """Name that does not depend on changes elsewhere in the file."""
        more = f" #{self.again + 1}" if self.again else ""
        return f"{self.file} {self.function or '(module)'}: {self.before} -> {self.after}{more}"

    def __str__(self) -> str:
        return (
            f"{self.file}:{self.lines[0]} {self.function or '(module)'}: "
            f"{self.before}  ->  {self.after}"
        )


def mutants(file: str, source: str) -> list[Mutant]:
    """All mutants of a file, in the order of its text."""
    out: list[Mutant] = []
    seen: Counter[str] = Counter()
    for number, change in enumerate(changes(ast.parse(source))):
        before = _text(change.statement)
        change.swap()
        after = "pass" if change.operator == "drop" else _text(change.statement)
        change.swap()
        before, after = _shortened(before, after)
        found = Mutant(
            file, change.function, _lines(change.statement), change.operator, before, after, number
        )
        out.append(replace(found, again=seen[found.key]))
        seen[found.key] += 1
    return out


def mutated(source: str, number: int) -> ast.Module:
    """Syntax tree of a source with mutant `number`."""
    tree = ast.parse(source)
    changes(tree)[number].swap()
    return ast.fix_missing_locations(tree)


def choose(found: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """Chooses mutants, evenly from all functions, and within a function from all operators.

    Args:
        found: The mutants to choose from.
        count: Number of mutants to choose.
        seed: Seed of the choice; the choice within a function does not depend on other functions.
    """
    functions: dict[tuple[str, str], dict[str, list[Mutant]]] = {}
    for m in found:
        functions.setdefault((m.file, m.function), {}).setdefault(m.operator, []).append(m)
    queues = []
    for name in sorted(functions, key=lambda n: _shuffling(seed, *n).random()):
        kinds = functions[name]
        order = sorted(kinds)
        _shuffling(seed, *name, "kinds").shuffle(order)
        for kind in order:
            _shuffling(seed, *name, kind).shuffle(kinds[kind])
        queues.append(_in_turn([kinds[kind] for kind in order]))
    return _in_turn(queues)[:count]


def _shuffling(*seed: object) -> random.Random:
    """Random numbers for a seed."""
    return random.Random("/".join(map(str, seed)))


def _in_turn(queues: Sequence[Sequence[Mutant]]) -> list[Mutant]:
    """First items of all queues, then the second ones, and so on."""
    rounds = chain.from_iterable(zip_longest(*queues))
    return [m for m in rounds if m is not None]


def _text(statement: ast.stmt) -> str:
    """Text of a statement, or of the head of a compound one, in one line."""
    if isinstance(statement, ast.If | ast.While):
        return f"{type(statement).__name__.lower()} {ast.unparse(statement.test)}:"
    if isinstance(statement, ast.For):
        return f"for {ast.unparse(statement.target)} in {ast.unparse(statement.iter)}:"
    return " ".join(ast.unparse(statement).split())


def _shortened(before: str, after: str) -> tuple[str, str]:
    """Shortens two long texts by most of their common beginning and end."""
    if max(len(before), len(after)) <= LONG or after == "pass":
        return before[:LONG], after
    start, end = _alike(before, after), _alike(before[::-1], after[::-1])
    first, last = max(start - LONG // 2, 0), max(end - LONG // 4, 0)
    return before[first : len(before) - last], after[first : len(after) - last]


def _alike(one: str, other: str) -> int:
    """Number of characters in the common beginning of two texts."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((i for i, (a, b) in pairs if a != b), min(len(one), len(other)))


def _lines(statement: ast.stmt) -> tuple[int, int]:
    """First and last line of a statement, or of the head of a compound one."""
    body = getattr(statement, "body", None)
    last = body[0].lineno - 1 if body else statement.end_lineno or statement.lineno
    return statement.lineno, max(last, statement.lineno)
