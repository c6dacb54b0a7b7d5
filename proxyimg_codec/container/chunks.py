"""Chunk framing: signature, version, and a run of checked chunks without gaps.

A chunk is type (4 ASCII letters), u32 length, payload, u32 CRC-32 over type, length and payload;
integers are little-endian. As in PNG, letter case carries bits: first letter lower case = ancillary
(a reader may ignore the chunk), second lower = private, third is upper, fourth lower = safe to copy
into an edited file by a program that does not know the chunk.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import FormatError, UnsupportedError
from ..limits import Budget

SIGNATURE = b"\x89PXI\r\n\x1a\n"
VERSION = (0, 9)
"""What is written."""

READABLE = ((0, 1), (0, 2), (0, 3), VERSION)
"""What is read; what has changed between them is in chapter 16 of the specification."""

MAPS_UNTIL = (0, 3)
"""Last version whose payloads may be maps, and whose histories are bound in another way."""

PREFIX = struct.Struct("<8sBBH")
"""Signature, major version, minor version, reserved (0)."""

FRAME = struct.Struct("<4sI")
CHUNK_MAX = (1 << 31) - 1


@dataclass(frozen=True)
class Chunk:
    """A chunk.

    Attributes:
        type: Four letters.
        payload: What it holds.
        offset: Its place in the file it was read from.
        version: Of the format of that file, which says how the payload is written.
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
        """Whether it may hold what was given up with `MAPS_UNTIL`."""
        return self.version <= MAPS_UNTIL

    @property
    def size(self) -> int:
        """Bytes in the file, framing included."""
        return FRAME.size + len(self.payload) + 4


def write(chunks: Iterable[Chunk], version: tuple[int, int] = VERSION) -> bytes:
    """The file made of `chunks`."""
    parts = [PREFIX.pack(SIGNATURE, *version, 0)]
    for chunk in chunks:
        body = FRAME.pack(chunk.type.encode("ascii"), len(chunk.payload)) + chunk.payload
        parts += (body, struct.pack("<I", zlib.crc32(body)))
    return b"".join(parts)


def _version(data: bytes) -> tuple[int, int]:
    """The version that the prefix states, which is checked."""
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
    """All chunks of a file, in order, each CRC checked.

    Raises:
        FormatError: Wrong signature, truncation, bad CRC, bad type, or bytes after the last chunk.
        UnsupportedError: Another format version.
        LimitError: Too large or too many chunks.
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
    """The chunks of a file that may be cut off or damaged, as far as chunks can be told.

    Returns:
        The chunks, and the places in this list of those that are not right, with whether one is
        cut off. Otherwise it fails its CRC.

    Raises:
        FormatError: Not the beginning of a .pxi file.
        UnsupportedError: Another format version.
        LimitError: Too large or too many chunks.
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
