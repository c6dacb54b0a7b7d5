"""What is found wrong with a file, and how the place of it is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..container import layr, mesh, netw, plan, pose, texr, undo
from ..errors import FormatError, LimitError, PxiError, UnsupportedError
from .warnings import ERROR, Issue

REFUSED = (FormatError, UnsupportedError, LimitError)
"""What is raised where a file is refused."""

NO_MEMORY = LimitError("there is not enough memory for it")

_NUMBERED = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, plan.TYPE, texr.TYPE)


class Findings:
    """Issues of one file, gathered.

    Attributes:
        issues: What was found, in that order.
        state: Which state of the history is looked at; empty for the file itself.
        offsets: Where the chunks are, by type and number; None if that is not known.
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
        """How a chunk is called, and where it is."""
        name = f"{type_} {number}" if type_ in _NUMBERED else type_
        return name, self.offsets.get((type_, number))

    def report(self, error: PxiError, type_: str = "", number: int = 0) -> None:
        """Adds an error of a chunk, or of what the error itself names."""
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
        """What `work` gives; None if it fails, which is reported."""
        try:
            return work()
        except REFUSED as error:
            self.report(error, type_, number)
        except MemoryError:
            self.report(NO_MEMORY, type_, number)
        return None
