"""Going back: the states that the history of a picture holds."""

from __future__ import annotations

from dataclasses import replace

from ..codec.read import from_state
from ..errors import UsageError
from ..model import Picture


def undone(picture: Picture, steps: int = 1) -> Picture:
    """The picture before its last `steps` edits.

    Raises:
        UsageError: There are not as many.
        FormatError, UnsupportedError, LimitError: The history of a file holds a state that is
            not right.
    """
    history = picture.history
    if not 1 <= steps <= len(history):
        raise UsageError(f"cannot undo {steps} edits: the picture has {len(history)}")
    kept = len(history) - steps
    return replace(from_state(history[kept].chunks), history=history[:kept])
