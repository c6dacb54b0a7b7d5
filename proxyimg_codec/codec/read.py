"""From the bytes of a file to the picture."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import fields

from ..container.chunks import Chunk
from ..container.file import assemble, parse_within
from ..errors import LimitError, PxiError
from ..io.files import read_bytes
from ..limits import DEFAULT_LIMITS, Budget, Limits
from ..model import Picture
from . import salvage
from .unpack import unpack

_END = Chunk("TAIL", b"")


def from_bytes(data: bytes, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False) -> Picture:
    """Decodes a `.pxi` file held in memory.

    Args:
        data: The file.
        limits: Bounds what is spent on it.
        tolerant: Whether to make do with what can be decoded of a file that is cut off or damaged.
            What is wrong is logged as a warning, and stands in `Picture.damage`.

    Raises:
        FormatError: The file breaks the format; or, if `tolerant`, too little of it is left.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    damage: tuple[str, ...] = ()
    try:
        if tolerant:
            content, damage = salvage.parse(data, limits)
            picture = unpack(content, Budget(limits), damage)
        else:
            budget = Budget(limits)
            picture = unpack(parse_within(data, budget), budget)
    except MemoryError:
        raise LimitError("there is not enough memory for the file") from None
    if damage:
        logging.getLogger(__name__).warning("the file is damaged: %s", "; ".join(damage))
    return picture


def from_file(
    path: str | os.PathLike[str], limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False
) -> Picture:
    """Decodes a `.pxi` file; see `from_bytes`.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    data = read_bytes(path)
    try:
        return from_bytes(data, limits, tolerant=tolerant)
    except PxiError as error:
        error.args = (f"{os.fspath(path)}: {error}",)
        raise


def from_own_bytes(data: bytes) -> Picture:
    """The picture that `write.serialized` gave, which may be of any size.

    Raises:
        FormatError: The bytes are not those.
    """
    budget = Budget(Limits(**{f.name: 1 << 62 for f in fields(Limits)}))
    return unpack(parse_within(data, budget), budget)


def from_state(chunks: Sequence[Chunk]) -> Picture:
    """The picture of a state that a history holds: all chunks of its file but uNDO and TAIL.

    Raises:
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    budget = Budget()
    return unpack(assemble([*chunks, _END], budget), budget)
