"""Signals that end a tool: it removes what is unfinished, as after Ctrl-C."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals of `kill`, `timeout` and job schedulers, and of a terminal that is closed."""


@contextlib.contextmanager
def ending() -> Iterator[None]:
    """Lets signals that would kill the process raise `SystemExit` of 128 + their number instead.

    Signals that somebody else ignores or handles, such as `nohup`, stay as they are.
    """
    ours = []
    if threading.current_thread() is threading.main_thread():  # no other can have handlers
        ours = [number for number in ENDING if signal.getsignal(number) == signal.SIG_DFL]

    def end(number: int, frame: FrameType | None) -> None:
        for other in ours:
            signal.signal(other, signal.SIG_IGN)  # what tidies up is not ended in its turn
        raise SystemExit(128 + number)

    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
