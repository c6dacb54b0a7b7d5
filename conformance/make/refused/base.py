"""Base of files that must be refused: a small valid file, and ways to break it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.container.chunks import MAPS_UNTIL, Chunk, read, write
from proxyimg_codec.model import Picture

from ..builders import Numbers, changed, ellipse, layer, network, picture, texture, values

HEAD, BACK, DISC, NETW, BACK_TEXR, DISC_TEXR, TAIL = range(7)
"""Positions of the chunks in the base file."""

GRID = (7, 5)
NAN, INFINITY = b"\x00\x7e", b"\x00\x7c"


class Base:
    """Valid file: a back and a disc with a mask, 5-bit codes, one network.

    Attributes:
        data: Bytes of the file.
        chunks: Its chunks.
    """

    def __init__(self) -> None:
        self.data = to_bytes(self.build(Numbers("base")))
        self.chunks = read(self.data)

    def build(self, n: Numbers) -> Picture:
        """Makes the picture of the file."""
        stored = n.integers(0, 2, GRID[::-1]) > 0
        back = layer("back", (0, 0, 12, 10), texture(n, grid=GRID, bits=5))
        plane = texture(n, grid=GRID, bits=5, stored=stored)
        disc = layer("disc", (2, 2, 8, 7), plane, ellipse((6, 5.5), (4, 3.5)))
        return picture((12, 10), [back, disc], network(n))

    def fields(self, at: int) -> dict[str, Any]:
        """Values of chunk number `at` by key."""
        return values(self.chunks[at])

    def order(self, *positions: int) -> bytes:
        """File of the chunks at `positions`, in that order."""
        return write([self.chunks[i] for i in positions])

    def payload(self, at: int, payload: bytes) -> bytes:
        """File with another payload of chunk `at` and a valid CRC."""
        chunks = list(self.chunks)
        chunks[at] = replace(chunks[at], payload=payload)
        return write(chunks)

    def set(self, at: int, **new: Any) -> bytes:
        """File with changed, added or (if None) removed values of chunk `at`."""
        return self.payload(at, changed(self.chunks[at], new).payload)

    def map(self, at: int, **new: Any) -> bytes:
        """File as of `set`, but with a map, in a version that has maps."""
        return self.old(at, changed(self.chunks[at], new, in_map=True).payload)

    def old(self, at: int, payload: bytes) -> bytes:
        """File of version 0.3 with another payload of chunk `at`."""
        return write(read(self.payload(at, payload)), MAPS_UNTIL)

    def edit(self, at: int, key: str, change: Callable[[bytes], bytes]) -> bytes:
        """File with the bytes of one field of chunk `at` changed."""
        return self.set(at, **{key: change(self.fields(at)[key])})

    def insert(self, at: int, type_: str) -> bytes:
        """File with an empty chunk before chunk `at`."""
        return write([*self.chunks[:at], Chunk(type_, b""), *self.chunks[at:]])

    def damage(self, at: int, byte: int, bit: int) -> bytes:
        """File with a bit of the payload of chunk `at` flipped, and the CRC unchanged."""
        payload = put(self.chunks[at].payload, byte, lambda v: v ^ bit)
        return self.data.replace(self.chunks[at].payload, payload)

    def end(self, at: int) -> int:
        """Offset of the end of chunk `at` in the file."""
        return (self.chunks[at].offset or 0) + self.chunks[at].size


def put(data: bytes, at: int, change: Callable[[int], int]) -> bytes:
    """Bytes of `data` with the byte at `at` changed."""
    out = bytearray(data)
    out[at] = change(out[at])
    return bytes(out)


def words(stream: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Entropy-coded stream with its words changed, and their number with them."""
    head = 1 + 4 * (1 << stream[0])
    end = head + 4 + 2 * int.from_bytes(stream[head : head + 4], "little")
    new = change(stream[head + 4 : end])
    return stream[:head] + (len(new) // 2).to_bytes(4, "little") + new + stream[end:]


@dataclass(frozen=True)
class Refused:
    """Case that must be refused.

    Attributes:
        title: Description, one sentence.
        tests: Ids of statements that it tests, besides that of the error that the package raises.
        build: Function that breaks a base file.
        base: Class of the base file.
        optional: Whether a decoder may ignore the fault, as in `cases.Case`.
    """

    title: str
    tests: tuple[str, ...]
    build: Callable[[Any], bytes]
    base: type[Base] = Base
    optional: bool = False


Row = tuple[str, str, str, Callable[[Any], bytes]]
"""Name, title with a small initial, ids of statements, and function that breaks a base file."""


def refused(
    rows: Iterable[Row], base: type[Base] = Base, optional: bool = False
) -> dict[str, Refused]:
    """Cases of rows, by name."""
    return {
        name: Refused(title[0].upper() + title[1:], tuple(tests.split()), build, base, optional)
        for name, title, tests, build in rows
    }
