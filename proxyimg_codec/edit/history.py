"""Undo: returns to earlier states, which the history of a picture holds."""

from __future__ import annotations

from dataclasses import replace

from ..codec.read import from_state
from ..errors import UsageError
from ..model import Picture


def undone(picture: Picture, steps: int = 1) -> Picture:
    """Picture before its last `steps` edits.

    Raises:
        UsageError: The history has fewer edits, or `steps` is less than 1.
        FormatError, UnsupportedError, LimitError: The state in the history of a file is not valid,
            needs a newer reader or exceeds the limits.
    """
    history = picture.history
    if not 1 <= steps <= len(history):
        raise UsageError(f"cannot undo {steps} edits: the picture has {len(history)}")
    kept = len(history) - steps
    return replace(from_state(history[kept].chunks), history=history[:kept])
