"""Decoding of a file to a picture."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

from ..container.chunks import Chunk
from ..container.file import assemble, parse_within
from ..io.files import Name, naming, read_bytes
from ..io.streams import Readable, bytes_of
from ..limits import DEFAULT_LIMITS, Budget, Limits, enough_memory
from ..model import Picture
from .unpack import unpack

if TYPE_CHECKING:
    from typing_extensions import Buffer

_END = Chunk("TAIL", b"")


def from_bytes(data: Buffer, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False) -> Picture:
    """Decodes a `.pxi` file held in memory.

    Args:
        data: Bytes of the file: bytes, or any buffer of them, such as a memoryview or mmap.
        limits: Bounds on what decoding the file may cost.
        tolerant: Whether to decode as much as possible of a truncated or damaged file. The damage
            is logged as a warning, and described in `Picture.damage`.

    Raises:
        FormatError: The file breaks the format; or, if `tolerant`, too little of it is left.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `limits`.
        UsageError: `data` is no buffer of bytes.
    """
    data = bytes_of(data)
    damage: tuple[str, ...] = ()
    with enough_memory("for the file"):
        if tolerant:
            from . import salvage

            content, damage = salvage.parse(data, limits)
            picture = unpack(content, Budget(limits), damage)
        else:
            budget = Budget(limits)
            picture = unpack(parse_within(data, budget), budget)
    if damage:
        logging.getLogger(__name__).warning("the file is damaged: %s", "; ".join(damage))
    return picture


def from_file(
    path: Name | Readable, limits: Limits = DEFAULT_LIMITS, *, tolerant: bool = False
) -> Picture:
    """Reads and decodes a `.pxi` file.

    Args:
        path: Path of the file, ``-`` for standard input; a URL; or a file that is open in binary.
        limits: Bounds on what decoding the file may cost.
        tolerant: As for `from_bytes`.

    Raises:
        InputError: The file cannot be read.
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    with naming(path):
        return from_bytes(read_bytes(path), limits, tolerant=tolerant)


def from_own_bytes(data: bytes) -> Picture:
    """Decodes bytes that `write.serialized` made, without any limits.

    Raises:
        FormatError: The bytes are not such a file.
    """
    budget = Budget(Limits(**{f.name: 1 << 62 for f in fields(Limits)}))
    return unpack(parse_within(data, budget), budget)


def from_state(chunks: Sequence[Chunk]) -> Picture:
    """Decodes a state of a history, within the default limits.

    Args:
        chunks: All chunks of the state but uNDO and TAIL.

    Raises:
        FormatError, UnsupportedError, LimitError: As `from_bytes`.
    """
    budget = Budget()
    return unpack(assemble([*chunks, _END], budget), budget)
