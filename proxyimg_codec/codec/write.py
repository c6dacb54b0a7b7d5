"""Encoding of a picture to the bytes of a file."""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

from ..container.check import check
from ..container.chunks import PADDING, Chunk
from ..container.file import present, serialize
from ..limits import SMALL_FILE, Budget
from ..model import Picture, Pictured
from .pack import pack

_CHUNKS: WeakKeyDictionary[Picture, tuple[Chunk, ...]] = WeakKeyDictionary()


def to_bytes(image: Pictured) -> bytes:
    """Encodes a picture as a `.pxi` file.

    Raises:
        FormatError: The picture breaks a rule between chunks.
        LimitError: The file would exceed what readers accept by default.
    """
    content, budget = pack(image.picture), Budget()
    check(content, budget)
    data = serialize(content)
    if len(data) > SMALL_FILE or budget.fits_small():
        return data
    padding = Chunk(PADDING, bytes(SMALL_FILE - len(data)))
    return serialize(replace(content, extra=(*content.extra, padding)))


def serialized(image: Pictured) -> bytes:
    """Encodes a picture of any size, even beyond the limits, for `read.from_own_bytes`."""
    return serialize(pack(image.picture))


def state(image: Pictured) -> tuple[Chunk, ...]:
    """Chunks of the file of a picture but uNDO and TAIL: a state as the history stores it."""
    picture = image.picture
    if picture not in _CHUNKS:
        _CHUNKS[picture] = tuple(present(pack(picture)))
    return _CHUNKS[picture]
