"""Mutator that knows the container: it changes the content of chunks and keeps the framing valid.

Without it hardly any input would pass the CRCs. In most cases it changes one value of one chunk,
which may lie in a compressed block; sometimes it changes chunks as a whole, or arbitrary bytes.
"""

from __future__ import annotations

import hashlib
import random
import struct
import zlib
from collections.abc import Callable
from typing import Any

import msgpack
import zstandard

PREFIX = 12
"""Number of bytes before the first chunk."""

Chunks = list[tuple[bytes, bytes]]
Mutate = Callable[[bytes, int], bytes]

_ZSTD = b"\x28\xb5\x2f\xfd"
_HISTORY = b"uNDO"
_NUMBERS = (0, 1, 2, 3, 4, 8, 16, 63, 64, 127, 128, 255, 256, 65535, 65536, 1 << 24, (1 << 31) - 1,
            1 << 31, 1 << 33, 1 << 48, (1 << 63) - 1, (1 << 64) - 1)  # fmt: skip
_TYPES = (b"HEAD", b"LAYR", b"MESH", b"POSE", b"NETW", b"PLAN", b"TEXR", b"iCCp", b"eXIf", b"xMPd",
          b"cICp", b"iNFO", b"tREE", b"mOTN", b"uNDO", b"TAIL", b"abCd", b"ABCD")  # fmt: skip


def split(data: bytes) -> Chunks:
    """Types and payloads of the chunks of a file, up to the first that is incomplete."""
    chunks: Chunks = []
    at = PREFIX
    while at + 12 <= len(data):
        type_, length = struct.unpack_from("<4sI", data, at)
        if at + 12 + length > len(data):
            break
        chunks.append((type_, data[at + 8 : at + 8 + length]))
        at += 12 + length
    return chunks


def join(prefix: bytes, chunks: Chunks) -> bytes:
    """Bytes of a file of some chunks, with valid CRCs."""
    parts = [prefix]
    for type_, payload in chunks:
        body = type_ + struct.pack("<I", len(payload)) + payload
        parts += (body, struct.pack("<I", zlib.crc32(body)))
    return b"".join(parts)


class Mutator:
    """Mutator of `.pxi` files.

    Args:
        seeds: Files whose chunks are also put into others.
        mutate: Function that mutates arbitrary bytes: (bytes, largest size) -> bytes;
            `atheris.Mutate`.
    """

    def __init__(self, seeds: list[bytes], mutate: Mutate) -> None:
        self._pool = sorted({chunk for seed in seeds for chunk in split(seed)})
        self._mutate = mutate
        self._rng = random.Random(0)

    def __call__(self, data: bytes, max_size: int, seed: int) -> bytes:
        """Mutated `data`, of at most `max_size` bytes."""
        rng = self._rng
        rng.seed(seed)
        chunks = split(data)
        if not chunks or rng.random() < 0.05:
            return self._mutate(data, max_size)
        for _ in range(1 + (rng.random() < 0.3)):
            k = rng.randrange(len(chunks))
            type_, payload = chunks[k]
            if rng.random() < 0.75:
                chunks[k] = type_, self._payload(payload)
            elif rng.random() < 0.3:
                chunks[k] = type_, self._mutate(payload, len(payload) + 64)
            else:
                self._shuffle(chunks, k)
        out = join(data[:PREFIX], self._consistent(data[:PREFIX], chunks))
        return out if len(out) <= max_size else data

    def _shuffle(self, chunks: Chunks, k: int) -> None:
        """Removes, repeats, inserts or replaces chunks at position `k`."""
        rng = self._rng
        match rng.randrange(5):
            case 0 if len(chunks) > 1:
                del chunks[k]
            case 1:
                chunks.insert(k, chunks[k])
            case 2:
                chunks.insert(rng.randrange(len(chunks)), rng.choice(self._pool))
            case 3:
                type_, payload = rng.choice(self._pool)
                chunks[k] = type_, payload
            case _:
                chunks[k] = rng.choice(_TYPES), chunks[k][1]

    def _consistent(self, prefix: bytes, chunks: Chunks) -> Chunks:
        """Corrects the numbers in HEAD and the hash in uNDO, in most cases."""
        if self._rng.random() < 0.9 and chunks[0][0] == b"HEAD":
            head = _unpacked(chunks[0][1])
            if isinstance(head, list) and len(head) == 6:
                types = [t for t, _ in chunks]
                head[4:] = types.count(b"LAYR"), types.count(b"NETW")
                chunks[0] = b"HEAD", _packed(head)
        for k, (type_, payload) in enumerate(chunks):
            if type_ == _HISTORY and self._rng.random() < 0.95:
                history = _unpacked(payload)
                if isinstance(history, list) and history:
                    others = [c for c in chunks if c[0] not in (_HISTORY, b"TAIL")]
                    bound = prefix[:8] + b"\0\2\0\0" if prefix[8:10] < b"\0\4" else b""
                    history[0] = hashlib.sha256(join(bound, others)).digest()
                    chunks[k] = type_, _packed(history)
        return chunks

    def _payload(self, payload: bytes) -> bytes:
        """Payload with one value changed."""
        content = _unpacked(payload)
        if content is None:
            return self._mutate(payload, len(payload) + 64)
        return _packed(self._value(content)) or payload

    def _value(self, value: Any) -> Any:
        """MessagePack value, changed in one place."""
        rng = self._rng
        if rng.random() < 0.02:
            return rng.choice((0, -1, "", b"", [], {}, None, True, 1.5, [[]], 1 << 40))
        if isinstance(value, list):
            return self._list(value)
        if isinstance(value, dict) and value:
            key = rng.choice([*value])
            return {**value, key: self._value(value[key])}
        if isinstance(value, bytes):
            return self._bytes(value)
        if isinstance(value, str):
            return self._mutate(value.encode(), len(value) + 16).decode(errors="ignore")
        return self._int(value) if isinstance(value, int) else value

    def _list(self, value: list[Any]) -> list[Any]:
        """List with one item changed, added, repeated or removed."""
        rng = self._rng
        if not value or rng.random() < 0.08:
            k = rng.randrange(len(value) + 1)
            match rng.randrange(3):
                case 0:
                    return [*value[:k], rng.choice(_NUMBERS[:8]), *value[k:]]
                case 1:
                    return [*value[:k], *value[k : k + 1], *value[k:]]
                case _:
                    return value[:k] + value[k + 1 :]
        k = rng.randrange(len(value))
        return [*value[:k], self._value(value[k]), *value[k + 1 :]]

    def _bytes(self, value: bytes) -> bytes:
        """Bytes changed; a Zstandard frame is changed in its content."""
        rng = self._rng
        if value[:4] != _ZSTD or rng.random() < 0.2:
            return self._mutate(value, len(value) + 64) if value or rng.random() < 0.5 else b"\0"
        try:
            block = zstandard.ZstdDecompressor().stream_reader(value).read(1 << 16)
        except (zstandard.ZstdError, MemoryError):
            return value
        content = _unpacked(block)
        if content is None:
            block = self._mutate(block, len(block) + 16)
        else:
            block = _packed(self._value(content)) or block
        return zstandard.ZstdCompressor(level=1).compress(block)

    def _int(self, value: int) -> int:
        """Integer near to another one, or an extreme one."""
        rng = self._rng
        match rng.randrange(5):
            case 0:
                value = rng.choice(_NUMBERS)
            case 1:
                value = -rng.choice(_NUMBERS)
            case 2:
                value += rng.choice((-2, -1, 1, 2))
            case 3:
                value ^= 1 << rng.randrange(34)
            case _:
                value = rng.randrange(256)
        return value


def _unpacked(payload: bytes) -> Any:
    """Content of MessagePack bytes; None if they are none."""
    try:
        return msgpack.unpackb(payload, raw=False)
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException):
        return None


def _packed(content: Any) -> bytes:
    """MessagePack bytes of a value; empty if it has none."""
    try:
        packed: bytes = msgpack.packb(content, use_bin_type=True)
    except (ValueError, OverflowError, TypeError, RecursionError):
        return b""
    return packed
