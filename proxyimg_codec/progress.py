"""Progress of long work: whoever waits for it hears of it, and can stop it by an exception."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[int], None] | None] = ContextVar("_listener", default=None)


@contextmanager
def heard(by: Callable[[int], None]) -> Iterator[None]:
    """Context in which a function hears of work.

    Args:
        by: Called with amounts of work that was done. What it raises stops the work.
    """
    token = _listener.set(by)
    try:
        yield
    finally:
        _listener.reset(token)


def listener() -> Callable[[int], None] | None:
    """Function that hears of work in this context, or None."""
    return _listener.get()


def worked(amount: int) -> None:
    """Tells that an amount of work is done; raises what the listener raises."""
    told = _listener.get()
    if told is not None:
        told(amount)
