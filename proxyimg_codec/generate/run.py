"""Circumstances of making a texture, on which it does not depend: the place, and who watches."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Run:
    """Circumstances of making a texture, beside its settings.

    Attributes:
        device: ``cpu`` or ``cuda``.
        offload: Whether parts of the guide wait in the memory of the CPU until they are needed.
        progress: Called with the numbers of steps done and in all, then with those of the encoder.
        previews: Folder for a picture every `every` steps; None for none.
        every: Steps between previews.
        resume: File that keeps the state every `SAVE_EVERY` steps and is gone on from if it exists;
            None for none.
    """

    device: str = "cpu"
    offload: bool = False
    progress: Callable[[str, int, int], None] | None = None
    previews: Path | None = None
    every: int = 50
    resume: Path | None = None

    def report(self, stage: str, done: int, total: int) -> None:
        """Calls `progress`, if there is one."""
        if self.progress is not None:
            self.progress(stage, done, total)


SAVE_EVERY = 50
"""Steps after which the state is kept."""

_PRESENT: ContextVar[Run] = ContextVar("run", default=Run())  # noqa: B039 # it is frozen


def present() -> Run:
    """The run that `running` has set."""
    return _PRESENT.get()


@contextlib.contextmanager
def running(run: Run) -> Iterator[None]:
    """Lets operations that generate textures use `run` while it lasts."""
    token = _PRESENT.set(run)
    try:
        yield
    finally:
        _PRESENT.reset(token)
