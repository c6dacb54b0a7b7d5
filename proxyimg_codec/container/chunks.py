"""Chunk framing: signature, version, and a run of checked chunks without gaps.

A chunk consists of its type (4 ASCII letters), a u32 length, the payload, and a u32 CRC-32 over
type, length and payload. Integers are little-endian. As in PNG, the case of each letter of the type
carries a bit: a lower-case first letter means ancillary (a reader may ignore the chunk), a
lower-case second letter private, the third is always upper case, and a lower-case fourth letter
means that a program that does not know the chunk may copy it into an edited file.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import FormatError, UnsupportedError
from ..limits import Budget

SIGNATURE = b"\x89PXI\r\n\x1a\n"
VERSION = (0, 12)
"""Version of the format, major and minor, that is written."""

READABLE = ((0, 1), (0, 2), (0, 3), (0, 9), (0, 10), (0, 11), VERSION)
"""Versions of the format that are read; chapter 16 of the specification says how they differ."""

MAPS_UNTIL = (0, 3)
"""Last version whose payloads may be maps, and whose history hash also covers a file prefix."""

PREFIX = struct.Struct("<8sBBH")
"""File prefix: signature, major version, minor version, reserved (0)."""

FRAME = struct.Struct("<4sI")
"""Chunk header: type, length of the payload."""

CHUNK_MAX = (1 << 31) - 1
"""Most bytes of a payload."""


PADDING = "paDD"
"""Type of a chunk that pads a file which is too small for the limits that it needs [SEC-3].

Readers drop it.
"""


@dataclass(frozen=True)
class Chunk:
    """A typed piece of a file, without its CRC.

    Attributes:
        type: Four ASCII letters.
        payload: Content in bytes.
        offset: Byte offset in the file it was read from; None if it was made in memory.
        version: Format version, major and minor, that the payload is written in.
    """

    type: str
    payload: bytes
    offset: int | None = None
    version: tuple[int, int] = VERSION

    @property
    def critical(self) -> bool:
        """Whether a reader that does not know the type must refuse the file."""
        return self.type[0].isupper()

    @property
    def safe_to_copy(self) -> bool:
        """Whether an editor that does not know the type may keep the chunk."""
        return self.type[3].islower()

    @property
    def old(self) -> bool:
        """Whether the payload may be in the form that was given up after version `MAPS_UNTIL`."""
        return self.version <= MAPS_UNTIL

    @property
    def size(self) -> int:
        """Number of bytes in the file, framing included."""
        return FRAME.size + len(self.payload) + 4


def write(chunks: Iterable[Chunk], version: tuple[int, int] = VERSION) -> bytes:
    """Returns the file that consists of `chunks`, in their order."""
    parts = [PREFIX.pack(SIGNATURE, *version, 0)]
    for chunk in chunks:
        body = FRAME.pack(chunk.type.encode("ascii"), len(chunk.payload)) + chunk.payload
        parts += (body, struct.pack("<I", zlib.crc32(body)))
    return b"".join(parts)


def _version(data: bytes) -> tuple[int, int]:
    """Checks the prefix of a file, and returns the format version that it states."""
    if not data:
        raise FormatError("the file is empty", rule="CON-2")
    if data[: len(SIGNATURE)] != SIGNATURE[: len(data)]:
        raise FormatError("not a .pxi file: the signature is missing", offset=0, rule="CON-2")
    if len(data) < PREFIX.size:
        raise FormatError("truncated in the signature", offset=len(data), rule="CON-2")
    _, major, minor, reserved = PREFIX.unpack_from(data)
    if (major, minor) not in READABLE:
        raise UnsupportedError(
            f"the file has format version {major}.{minor}, this program reads "
            f"{', '.join(f'{a}.{b}' for a, b in READABLE)}; update proxyimg-codec",
            rule="CON-3",
        )
    if reserved:
        raise FormatError("reserved field is not zero", offset=10, rule="CON-2")
    return major, minor


def _valid_type(raw: bytes) -> bool:
    return raw.isalpha() and raw[2:3].isupper()


def read(data: bytes, budget: Budget | None = None) -> list[Chunk]:
    """Reads all chunks of a file, in order, and checks the CRC of each.

    Args:
        data: The file.
        budget: Running budget of this file; by default a new one with the default limits.

    Raises:
        FormatError: Wrong signature, truncation, bad CRC, bad type, or bytes after the last chunk.
        UnsupportedError: The file has a format version that is not in `READABLE`.
        LimitError: The file is too large, or has too many chunks.
    """
    budget = budget or Budget()
    budget.spend("file_bytes", len(data))
    version = _version(data)
    chunks: list[Chunk] = []
    at = PREFIX.size
    while at < len(data):
        if chunks and chunks[-1].type == "TAIL":
            raise FormatError("bytes follow the last chunk", offset=at, rule="CON-13")
        budget.check("chunks", len(chunks) + 1)
        if len(data) - at < FRAME.size + 4:
            raise FormatError("truncated in a chunk header", offset=at, rule="CON-7")
        raw, length = FRAME.unpack_from(data, at)
        if not _valid_type(raw):
            raise FormatError(
                "chunk type is not four letters with the third upper case", offset=at, rule="CON-8"
            )
        name = f"chunk {raw.decode()}"
        end = at + FRAME.size + length
        if length > CHUNK_MAX or end + 4 > len(data):
            raise FormatError(
                "truncated: the chunk runs past the end of the file", name, at, rule="CON-7"
            )
        if zlib.crc32(data[at:end]) != int.from_bytes(data[end : end + 4], "little"):
            raise FormatError("CRC mismatch: the file is damaged", name, at, rule="CON-6")
        chunks.append(Chunk(raw.decode(), data[at + FRAME.size : end], at, version))
        at = end + 4
    if not chunks or chunks[-1].type != "TAIL":
        raise FormatError("truncated: the TAIL chunk is missing", offset=at, rule="CON-13")
    return chunks


def read_damaged(data: bytes, budget: Budget | None = None) -> tuple[list[Chunk], dict[int, bool]]:
    """Reads the chunks of a file that may be truncated or damaged, up to the first bad header.

    Args:
        data: The file.
        budget: Running budget of this file; by default a new one with the default limits.

    Returns:
        The chunks, and the bad ones among them: a map from an index in the list to True if that
        chunk is truncated, or False if it is complete but fails its CRC.

    Raises:
        FormatError: The data does not begin like a .pxi file.
        UnsupportedError: The file has a format version that is not in `READABLE`.
        LimitError: The file is too large, or has too many chunks.
    """
    budget = budget or Budget()
    budget.spend("file_bytes", len(data))
    version = _version(data)
    chunks: list[Chunk] = []
    wrong: dict[int, bool] = {}
    at = PREFIX.size
    while len(data) - at >= FRAME.size and not (chunks and chunks[-1].type == "TAIL"):
        budget.check("chunks", len(chunks) + 1)
        raw, length = FRAME.unpack_from(data, at)
        if not _valid_type(raw):
            break
        end = at + FRAME.size + length
        crc = int.from_bytes(data[end : end + 4], "little")
        if end + 4 > len(data) or zlib.crc32(data[at:end]) != crc:
            wrong[len(chunks)] = end + 4 > len(data)
        chunks.append(Chunk(raw.decode(), data[at + FRAME.size : end], at, version))
        at = end + 4
    return chunks, wrong
