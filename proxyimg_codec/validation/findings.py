"""Collection of the issues of a file, with the names and offsets of its chunks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..container import layr, mesh, netw, plan, pose, texr, undo
from ..errors import FormatError, LimitError, PxiError, UnsupportedError
from .warnings import ERROR, Issue

REFUSED = (FormatError, UnsupportedError, LimitError)
"""Errors that are raised if a file is refused."""

NO_MEMORY = LimitError("there is not enough memory for it")

_NUMBERED = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, plan.TYPE, texr.TYPE)


class Findings:
    """Issues of one file, as they are found.

    Attributes:
        issues: The issues, in the order in which they were found.
        state: Name of the state of the history that is being checked; empty for the file itself.
        offsets: Offset in bytes of each chunk, by type and number; None if it is not known.
    """

    def __init__(self) -> None:
        self.issues: list[Issue] = []
        self.state = ""
        self.offsets: dict[tuple[str, int], int | None] = {}

    @property
    def failed(self) -> bool:
        """Whether an error was found."""
        return any(issue.severity == ERROR for issue in self.issues)

    def place(self, type_: str, number: int) -> tuple[str, int | None]:
        """Name of a chunk in issues, and its offset in bytes or None.

        Args:
            type_: Type of the chunk.
            number: Its number among the chunks of that type.
        """
        name = f"{type_} {number}" if type_ in _NUMBERED else type_
        return name, self.offsets.get((type_, number))

    def report(self, error: PxiError, type_: str = "", number: int = 0) -> None:
        """Adds an error.

        Args:
            error: The error.
            type_: Type of the chunk that it is about; by default the chunk that the error names.
            number: Number of the chunk among those of its type.
        """
        code, message = error.rule, getattr(error, "problem", str(error))
        if type_:
            name, offset = self.place(type_, number)
        else:
            name = getattr(error, "where", "").removeprefix("chunk ")
            offset = getattr(error, "offset", None)
            if offset is None and (name, 1) not in self.offsets:
                offset = self.offsets.get((name, 0))
        if self.state:
            message = f"{self.state}: {f'chunk {name}: ' if name else ''}{message}"
            name, offset = self.place(undo.TYPE, 0)
        self.issues.append(Issue(code, ERROR, message, name, offset, error.exit_code))

    def attempt(self, work: Callable[[], Any], type_: str = "", number: int = 0) -> Any:
        """Calls `work`, and reports its error.

        Args:
            work: The function to call.
            type_: Type of the chunk that it is about; by default the chunk that the error names.
            number: Number of the chunk among those of its type.

        Returns:
            The result of `work`; None if it fails.
        """
        try:
            return work()
        except REFUSED as error:
            self.report(error, type_, number)
        except MemoryError:
            self.report(NO_MEMORY, type_, number)
        return None
