"""Progress of long work: whoever waits for it hears of it, and can stop it by an exception."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[int], None] | None] = ContextVar("_listener", default=None)


@contextmanager
def heard(listener: Callable[[int], None]) -> Iterator[None]:
    """Context in which a function hears of work.

    Args:
        listener: Called with amounts of work that was done. What it raises stops the work.
    """
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def worked(amount: int) -> None:
    """Tells that an amount of work is done; raises what the listener raises."""
    listener = _listener.get()
    if listener is not None:
        listener(amount)
