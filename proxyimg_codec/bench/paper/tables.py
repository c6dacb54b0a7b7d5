"""Tables: which rows of a section belong together, which columns they have, what the paper says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from .items import Row

NOTHING = "–"


@dataclass(frozen=True)
class Column:
    """Column of figures.

    Attributes:
        key: Key of the rows.
        head: Head of the column.
        form: Format of a figure.
    """

    key: str
    head: str
    form: str

    def text(self, value: Any) -> str:
        """Text of a value; None is a dash."""
        return NOTHING if value is None else self.form.format(value)


@dataclass(frozen=True)
class Table:
    """Form of the table of a section.

    Attributes:
        rows: Keys whose values name a line; measurements of equal values are averaged.
        columns: Columns of figures.
        charted: Key of the column that is drawn.
        notes: Notes under the table, each a paragraph of Markdown without links.
        paper: Lines with the paper's own figures; the keys of a `Row`.
        conclusions: Function from all rows to sentences on what they show.
    """

    rows: tuple[str, ...]
    columns: tuple[Column, ...]
    charted: str
    notes: tuple[str, ...]
    paper: tuple[Row, ...] = ()
    conclusions: Callable[[Sequence[Row]], list[str]] = lambda rows: []

    def grouped(self, rows: Sequence[Row]) -> dict[tuple[str, ...], list[Row]]:
        """Rows by their names, in order of first appearance."""
        found: dict[tuple[str, ...], list[Row]] = {}
        for row in rows:
            found.setdefault(tuple(str(row[k]) for k in self.rows), []).append(row)
        return found

    def lines(self, rows: Sequence[Row]) -> list[list[str]]:
        """Lines of text: heads, the means of all groups, then the paper's figures."""
        out = [[*self.rows, *(c.head for c in self.columns), "pictures"]]
        for names, group in self.grouped(rows).items():
            means = [c.text(mean(group, c.key)) for c in self.columns]
            out.append([*names, *means, str(len({r["picture"] for r in group}))])
        for row in self.paper:
            names = tuple(str(row.get(k, "")) for k in self.rows)
            out.append([*names, *(c.text(row.get(c.key)) for c in self.columns), NOTHING])
        return out


def mean(rows: Sequence[Row], key: str) -> float | None:
    """Mean of the values of a key that are not None; None if there are none."""
    values = [float(row[key]) for row in rows if row.get(key) is not None]
    return fmean(values) if values else None
