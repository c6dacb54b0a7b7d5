"""Builder of Zstandard frames (RFC 8878), valid or not, independent of any library's version."""

from __future__ import annotations

from typing import Any

import msgpack
import zstandard

from proxyimg_codec.container.chunks import Chunk
from proxyimg_codec.container.meta import BLOCKS

MAGIC = b"\x28\xb5\x2f\xfd"
BLOCK_MAX = 1 << 17
RAW, REPEATED = 0, 1

Run = tuple[int, int]
"""A byte and the number of its repetitions."""


def frame(
    *parts: bytes | Run,
    size: int | None = None,
    window: int | None = None,
    checksum: bytes = b"",
    flags: int = 0,
) -> bytes:
    """Frame of blocks that are raw or repeat a byte.

    Args:
        parts: Its content: bytes, or runs.
        size: Size of the content that it announces; the true one by default.
        window: Byte that gives the size of the window, for a frame that announces no size.
        checksum: Four bytes at its end, or none.
        flags: Additional bits of its descriptor.
    """
    total = sum(p[1] if isinstance(p, tuple) else len(p) for p in parts) if size is None else size
    flags |= 4 if checksum else 0
    head = bytes([flags, window]) if window is not None else bytes([flags | 0xA0])
    head += total.to_bytes(4, "little") if window is None else b""
    blocks = [block for part in parts for block in _blocks(part)] or [(RAW, 0, b"")]
    body = b"".join(
        (count << 3 | kind << 1 | (i == len(blocks))).to_bytes(3, "little") + content
        for i, (kind, count, content) in enumerate(blocks, 1)
    )
    return MAGIC + head + body + checksum


def _blocks(part: bytes | Run) -> list[tuple[int, int, bytes]]:
    """Kind, size and content of the blocks of a part."""
    if isinstance(part, tuple):
        byte, count = part
        sizes = [min(BLOCK_MAX, count - at) for at in range(0, count, BLOCK_MAX)]
        return [(REPEATED, size, bytes([byte])) for size in sizes]
    pieces = [part[at : at + BLOCK_MAX] for at in range(0, len(part), BLOCK_MAX)]
    return [(RAW, len(piece), piece) for piece in pieces]


def checksum(content: bytes) -> bytes:
    """Checksum of the content of a frame, 4 bytes."""
    return zstandard.ZstdCompressor(write_checksum=True).compress(content)[-4:]


def metadata(kind: str, content: bytes, zstd: bytes | None = None, **new: Any) -> Chunk:
    """Metadata chunk of one of `BLOCKS`, perhaps with another frame or size."""
    values = {"size": len(content), "zstd": frame(content) if zstd is None else zstd, **new}
    return Chunk(BLOCKS[kind], msgpack.packb([values["size"], values["zstd"]]))


def one_block(content: bytes) -> bytes:
    """Frame of one raw block of at most 255 bytes, which gives their number in one byte."""
    head = (len(content) << 3 | 1).to_bytes(3, "little")
    return MAGIC + bytes([0x20, len(content)]) + head + content
