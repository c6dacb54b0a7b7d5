"""A run of `pxi-bench paper`: plans, measures what is not measured yet, and reports."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from ...errors import InputError
from .. import workers
from ..rd import Failure
from . import SECTIONS, report, store
from .items import Effort, Given, Item
from .tables import Table


class _Section(Protocol):
    """Module of a section."""

    TABLE: Table

    @staticmethod
    def items(given: Given, effort: Effort) -> list[Item]:
        """Items of the section."""


@dataclass
class Plan:
    """Plan of a run.

    Attributes:
        items: Items of each section.
        absent: Why sections cannot be measured.
    """

    items: dict[str, list[Item]] = field(default_factory=dict)
    absent: dict[str, str] = field(default_factory=dict)

    def groups(self, out: Path) -> list[store.Group]:
        """All groups of items that have something left to measure."""
        found = store.groups(out, [i for items in self.items.values() for i in items])
        return [g for g in found if any(store.load(out, i) is None for i in g.items)]


def plan(given: Given, names: Sequence[str], effort: Effort) -> Plan:
    """Plans sections.

    Args:
        given: Pictures and networks that the user has.
        names: Names of the sections.
        effort: Amount of work.

    Raises:
        InputError: Pictures of all sections are missing.
    """
    made = Plan()
    for name in names:
        try:
            made.items[name] = _module(name).items(given, effort)
        except InputError as error:
            made.absent[name] = str(error)
    if not made.items:
        raise InputError(next(iter(made.absent.values())))
    return made


def forget(out: Path, made: Plan) -> None:
    """Removes the measurements of all items of a plan."""
    for items in made.items.values():
        for item in items:
            store.path_of(out, item).unlink(missing_ok=True)


def measure(
    groups: Sequence[store.Group], jobs: int, finished: Callable[[Failure | None], None]
) -> None:
    """Measures groups in worker processes; calls `finished` after each."""
    if groups:
        workers.run(store.measure, groups, jobs, finished)


def write(out: Path, made: Plan, head: Sequence[str]) -> None:
    """Writes the report of everything that is measured."""
    parts = []
    for name, title in SECTIONS.items():
        if name in made.items or name in made.absent:
            items = made.items.get(name, [])
            loaded = [rows for item in items if (rows := store.load(out, item)) is not None]
            rows = [row for measured in loaded for row in measured]
            why = made.absent.get(name, "" if rows else "every measurement failed, or is to come")
            count = (len(loaded), len(items))
            parts.append(report.Part(name, title, _module(name).TABLE, rows, why, count))
    report.write(out, parts, head)


def _module(name: str) -> _Section:
    return cast(_Section, import_module(f"{__package__}.{name}"))
