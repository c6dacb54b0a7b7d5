"""Results on disk: a JSON file an item."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ...errors import PxiError
from ...io.files import write_atomically
from ..rd import Failure, machine
from .items import Item, Row


def path_of(out: Path, item: Item) -> Path:
    """Path of the file of an item in the folder of the results."""
    name = quote(f"{item.picture} {item.name}", safe=" ,")  # no two names become the same
    return out / "items" / item.section / f"{name}.json"


def load(out: Path, item: Item) -> list[Row] | None:
    """Rows of an item from an earlier run; None if there are none that still hold."""
    try:
        held = json.loads(path_of(out, item).read_bytes())
        rows = held["rows"] if held["key"] == item.key else None
    except (OSError, ValueError, TypeError, KeyError):
        return None  # not measured, or cut short by whoever copied it: it is measured again
    return rows if isinstance(rows, list) else None


def save(out: Path, item: Item, rows: Sequence[Row]) -> None:
    """Writes the rows of an item.

    Raises:
        InputError: The file cannot be written.
    """
    path = path_of(out, item)
    path.parent.mkdir(parents=True, exist_ok=True)
    held = {"key": item.key, "machine": machine(), "rows": rows}
    write_atomically(path, json.dumps(held, indent=1).encode() + b"\n")


@dataclass(frozen=True)
class Group:
    """Items of one section and picture, measured in their order because some need others.

    Attributes:
        out: Folder of the results.
        items: The items.
    """

    out: Path
    items: tuple[Item, ...]


def measure(group: Group) -> Failure | None:
    """Measures the items of a group that have no rows yet, and saves them; or says what failed."""
    done: dict[str, list[Row]] = {}
    for item in group.items:
        rows = load(group.out, item)
        if rows is None:
            try:
                rows = [{"picture": item.picture, **r} for r in item.measure(item.pixels, done)]
                save(group.out, item, rows)
            except PxiError as error:
                return Failure(f"{item.section}, {item.picture}, {item.name}: {error}")
        done[item.name] = rows
    return None


def groups(out: Path, items: Sequence[Item]) -> list[Group]:
    """Items as groups of section and picture, in order."""
    found: dict[tuple[str, str], list[Item]] = {}
    for item in items:
        found.setdefault((item.section, item.picture), []).append(item)
    return [Group(out, tuple(group)) for group in found.values()]
