"""Document that is edited: a picture with its history, and how much of that is done."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..codec.read import from_bytes
from ..codec.write import to_bytes
from ..edit.history import undone
from ..errors import UsageError
from ..limits import Limits
from ..model import Picture
from .edits import applied


@dataclass(frozen=True, eq=False)
class Document:
    """Picture in all states of its history. It never changes: edits make other documents.

    Attributes:
        last: Picture after all edits, also those that are undone.
        at: Number of edits that are done.
        known: Pictures of states that were needed so far, by the number of edits done.
    """

    last: Picture
    at: int
    known: dict[int, Picture] = field(default_factory=dict)

    @classmethod
    def of(cls, picture: Picture) -> Document:
        """Document of a picture, with all its edits done."""
        return cls(picture, len(picture.history))

    @classmethod
    def parsed(cls, data: bytes, limits: Limits, at: int | None = None) -> Document:
        """Document of the bytes of a `.pxi` file, with `at` edits done, by default all.

        Raises:
            PxiError: As `codec.read.from_bytes`, or there are not so many edits.
        """
        document = cls.of(from_bytes(data, limits))
        return document if at is None else document.jumped(at)

    @property
    def count(self) -> int:
        """Number of edits, done or undone."""
        return len(self.last.history)

    @property
    def picture(self) -> Picture:
        """Picture as it is now."""
        if self.at == self.count:
            return self.last
        if self.at not in self.known:
            self.known[self.at] = undone(self.last, self.count - self.at)
        return self.known[self.at]

    @property
    def edits(self) -> list[Any]:
        """Edits, done or undone; None for one that is not JSON."""
        return [_parsed(step.operation) for step in self.last.history]

    def jumped(self, to: int) -> Document:
        """Returns the document with `to` of its edits done.

        Raises:
            UsageError: There are not so many.
        """
        if not 0 <= to <= self.count:
            raise UsageError(f"history: {to} is not within 0..{self.count}")
        document = replace(self, at=to)
        document.picture  # noqa: B018 - a state that cannot be read is refused here
        return document

    def edited(
        self, edits: Iterable[Mapping[str, Any]], folder: Path, files: Collection[str]
    ) -> Document:
        """Returns the document after more edits; those that were undone are gone then.

        Raises:
            PxiError: As `edits.applied`.
        """
        before = self.picture
        after = applied(before, edits, folder, files)
        if after is before:
            return self
        known = {k: v for k, v in self.known.items() if k < self.at}
        return Document(after, len(after.history), {**known, self.at: before})

    def to_bytes(self) -> bytes:
        """Bytes of the file, without what is undone."""
        return to_bytes(self.picture)


def _parsed(operation: str) -> Any:
    try:
        return json.loads(operation)
    except (ValueError, RecursionError):
        return None
