"""From a picture to the bytes of a file."""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

from ..container.check import check
from ..container.chunks import Chunk
from ..container.file import present, serialize
from ..limits import SMALL_FILE, Budget
from ..model import Picture, Pictured
from .pack import pack

PADDING = "paDD"
"""A chunk that lengthens a file too small for what it holds (SEC-3); readers drop it."""

_CHUNKS: WeakKeyDictionary[Picture, tuple[Chunk, ...]] = WeakKeyDictionary()


def to_bytes(image: Pictured) -> bytes:
    """The `.pxi` file of a picture.

    Raises:
        LimitError: It is larger than readers accept by default.
    """
    content, budget = pack(image.picture), Budget()
    check(content, budget)
    data = serialize(content)
    if len(data) > SMALL_FILE or budget.fits_small():
        return data
    padding = Chunk(PADDING, bytes(SMALL_FILE - len(data)))
    return serialize(replace(content, extra=(*content.extra, padding)))


def serialized(image: Pictured) -> bytes:
    """The file of a picture, also of one larger than readers accept: for `read.from_own_bytes`."""
    return serialize(pack(image.picture))


def state(image: Pictured) -> tuple[Chunk, ...]:
    """The chunks of a picture's file but uNDO and TAIL: what an edit leads from, or back to."""
    picture = image.picture
    if picture not in _CHUNKS:
        _CHUNKS[picture] = tuple(present(pack(picture)))
    return _CHUNKS[picture]
