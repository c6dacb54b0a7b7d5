"""Errors as the page gets them: an HTTP status, a kind, and a message for people."""

from __future__ import annotations

from ..errors import (
    FormatError,
    InputError,
    LimitError,
    PxiError,
    UnsupportedError,
    UsageError,
)
from .jobs import CancelledError


class StaleError(PxiError):
    """The request was made for a state that is no longer the present one."""


class MissingError(PxiError):
    """There is nothing of that name."""


KINDS: tuple[tuple[type[Exception], int, str], ...] = (
    (StaleError, 409, "stale"),
    (CancelledError, 409, "cancelled"),
    (MissingError, 404, "missing"),
    (LimitError, 413, "limit"),
    (MemoryError, 413, "limit"),
    (UsageError, 422, "usage"),
    (InputError, 422, "input"),
    (FormatError, 422, "format"),
    (UnsupportedError, 422, "unsupported"),
    (ModuleNotFoundError, 422, "unsupported"),
)
"""Class, status and kind of errors, of which the first that fits counts."""


def described(error: Exception) -> tuple[int, dict[str, str]]:
    """HTTP status of an error, and its kind and message."""
    for known, status, kind in KINDS:
        if isinstance(error, known):
            return status, {"kind": kind, "message": _message(error)}
    return 500, {"kind": "error", "message": "something went wrong in pxi-studio; its terminal "
                 "says what"}  # fmt: skip


def _message(error: Exception) -> str:
    if isinstance(error, MemoryError):
        return "there is not enough memory; ask for a smaller picture"
    if isinstance(error, ModuleNotFoundError):
        return f"this needs {error.name}: pip install 'proxyimg-codec[all]'"
    return str(error)
