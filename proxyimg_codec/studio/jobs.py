"""Work that is done in threads: it tells how far it is, and can be cancelled."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

from ..errors import PxiError

EVERY = 0.1
"""Seconds between two reports of progress, at least."""

_numbers = itertools.count(1)


class CancelledError(PxiError):
    """Work was cancelled by the user."""


class Job:
    """Work that is going on.

    Args:
        kind: Name of what is done, such as ``encode``.
        tell: Called, in the thread of the work, when there is progress.

    Attributes:
        number: Number of the job, unique in the process.
        kind: Name of what is done.
        stage: Name of the present stage.
        done: Number of finished units of the stage.
        total: Number of units of the stage.
    """

    def __init__(self, kind: str, tell: Callable[[Job], None] = lambda job: None) -> None:
        self.number, self.kind = next(_numbers), kind
        self.stage, self.done, self.total = kind, 0, 0
        self._tell, self._told = tell, 0.0
        self._stopped = threading.Event()

    def cancel(self) -> None:
        """Lets the work end at its next report."""
        self._stopped.set()

    def check(self) -> None:
        """Raises `CancelledError` if the work is to end."""
        if self._stopped.is_set():
            raise CancelledError(f"{self.kind}: cancelled")

    def report(self, stage: str, done: int, total: int) -> None:
        """Reports that `done` of `total` units of a stage are finished.

        Raises:
            CancelledError: The work is to end.
        """
        self.check()
        fresh = stage != self.stage
        self.stage, self.done, self.total = stage, done, total
        if fresh or done >= total or time.monotonic() - self._told > EVERY:
            self._told = time.monotonic()
            self._tell(self)

    def advance(self, amount: int) -> None:
        """Reports that `amount` more units are finished, as drawing does.

        Raises:
            CancelledError: The work is to end.
        """
        self.report(self.stage, self.done + amount, self.total)

    def described(self) -> dict[str, Any]:
        """The job as JSON values."""
        return {
            "id": self.number, "kind": self.kind, "stage": self.stage, "done": self.done,
            "total": self.total,
        }  # fmt: skip
