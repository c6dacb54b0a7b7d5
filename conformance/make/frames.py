"""Zstandard frames by hand (RFC 8878), so that no library's version matters, right or wrong."""

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
"""A byte, and how often it comes."""


def frame(
    *parts: bytes | Run,
    size: int | None = None,
    window: int | None = None,
    checksum: bytes = b"",
    flags: int = 0,
) -> bytes:
    """A frame of blocks that are raw or repeat a byte.

    Args:
        parts: What it holds: bytes, or runs.
        size: What it announces to hold; the truth by default.
        window: Byte that gives the size of the window, of a frame that announces no size.
        checksum: Four bytes at its end, or none.
        flags: More bits of its descriptor.
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
    """Kind, size and content of blocks."""
    if isinstance(part, tuple):
        byte, count = part
        sizes = [min(BLOCK_MAX, count - at) for at in range(0, count, BLOCK_MAX)]
        return [(REPEATED, size, bytes([byte])) for size in sizes]
    pieces = [part[at : at + BLOCK_MAX] for at in range(0, len(part), BLOCK_MAX)]
    return [(RAW, len(piece), piece) for piece in pieces]


def checksum(content: bytes) -> bytes:
    """The checksum of what a frame holds."""
    return zstandard.ZstdCompressor(write_checksum=True).compress(content)[-4:]


def metadata(kind: str, content: bytes, zstd: bytes | None = None, **new: Any) -> Chunk:
    """A metadata chunk of one of `BLOCKS`, perhaps with another frame or size."""
    values = {"size": len(content), "zstd": frame(content) if zstd is None else zstd, **new}
    return Chunk(BLOCKS[kind], msgpack.packb([values["size"], values["zstd"]]))


def one_block(content: bytes) -> bytes:
    """A frame of one raw block, of at most 255 bytes, that tells their number in one byte."""
    head = (len(content) << 3 | 1).to_bytes(3, "little")
    return MAGIC + bytes([0x20, len(content)]) + head + content
