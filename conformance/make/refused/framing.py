"""Refused files: faults of the signature and of the framing of chunks, and polyglots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from proxyimg_codec.container.chunks import Chunk, write

from .base import (
    BACK,
    BACK_TEXR,
    DISC,
    DISC_TEXR,
    HEAD,
    NETW,
    TAIL,
    Base,
    Row,
    put,
    refused,
)

ZIP = b"PK\x05\x06" + bytes(18)
"""An empty ZIP archive."""
PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
PAGE = b"<html><script>alert(1)</script>"


def _joined(b: Base) -> bytes:
    """File whose LAYR takes in the chunk after it, including its framing, with a valid CRC."""
    chunks = list(b.chunks)
    after = write([chunks[DISC]])[12:]
    chunks[BACK] = replace(chunks[BACK], payload=chunks[BACK].payload + after)
    return write([*chunks[:DISC], *chunks[DISC + 1 :]])


def _short(b: Base) -> bytes:
    """File in which the length of LAYR ends within its payload, so that the CRC is not valid."""
    return put(b.data, b.chunks[BACK].offset + 4, lambda v: v - 2)  # type: ignore[operator]  # it was read


def _private(type_: str) -> Callable[[Base], bytes]:
    return lambda b: b.insert(NETW, type_)


def _ancillary(change: Callable[[bytes], bytes]) -> Callable[[Base], bytes]:
    """Builder of a file with changed bytes of an unknown ancillary chunk."""

    def build(b: Base) -> bytes:
        chunk = write([Chunk("teSt", b"abc")])[12:]
        at = b.end(BACK)
        return b.data[:at] + change(chunk) + b.data[at:]

    return build


# fmt: off
_FRAMING: list[Row] = [
    ("invalid-empty", "no bytes at all", "", lambda b: b""),
    ("invalid-cut-signature", "ends in the signature", "", lambda b: b.data[:5]),
    ("invalid-cut-version", "ends in the version", "", lambda b: b.data[:10]),
    ("invalid-no-chunk", "ends after the version", "", lambda b: b.data[:12]),
    ("invalid-cut-header", "ends in a chunk header", "",
     lambda b: b.data[:b.end(BACK) + 6]),
    ("invalid-cut-payload", "ends in a payload", "",
     lambda b: b.data[:b.end(NETW) - 20]),
    ("invalid-cut-crc", "ends in a CRC", "", lambda b: b.data[:-2]),
    ("invalid-no-tail", "no TAIL", "", lambda b: b.data[:b.end(DISC_TEXR)]),
    ("invalid-length", "a chunk's length has its top bit set", "SEC-4",
     lambda b: put(b.data, 12 + 7, lambda v: v | 128)),
    ("invalid-crc-head", "the width's last bit flipped", "",
     lambda b: b.damage(HEAD, 2, 1)),
    ("invalid-crc-texture", "the last code's last bit flipped", "SEC-4",
     lambda b: b.damage(BACK_TEXR, -1, 128)),
    ("invalid-crc-tail", "a bit of TAIL's CRC flipped", "",
     lambda b: put(b.data, len(b.data) - 1, lambda v: v ^ 1)),
    ("invalid-trailing-byte", "a zero after TAIL", "", lambda b: b.data + b"\0"),
    ("invalid-trailing-chunk", "a chunk after TAIL", "",
     lambda b: write([*b.chunks, Chunk("teSt", b"")])),
    ("invalid-signature", "the signature of PNG", "",
     lambda b: b.data.replace(b"PXI", b"PNG", 1)),
    ("invalid-line-ends", "line ends changed as by a text transfer", "",
     lambda b: b.data.replace(b"\r\n", b"\n", 1)),
    ("invalid-reserved", "the reserved field is not zero", "",
     lambda b: put(b.data, 10, lambda v: 1)),
    ("invalid-type-case", "a chunk type whose third letter is lower case", "",
     lambda b: b.insert(NETW, "tesT")),
    ("invalid-type-digit", "a chunk type with a digit", "",
     lambda b: b.insert(NETW, "t3ST")),
    ("unsupported-version", "format 1.2", "VER-1", lambda b: put(b.data, 8, lambda v: 1)),
    ("unsupported-version-0-4", "format 0.4", "VER-4",
     lambda b: put(b.data, 9, lambda v: 4)),
    ("unsupported-version-0-8", "format 0.8", "VER-4",
     lambda b: put(b.data, 9, lambda v: 8)),
    ("unsupported-version-0-13", "format 0.13", "VER-4",
     lambda b: put(b.data, 9, lambda v: 13)),
    ("unsupported-version-0-0", "format 0.0", "VER-4",
     lambda b: put(b.data, 9, lambda v: 0)),
    ("unsupported-chunk", "an unknown critical chunk", "",
     lambda b: b.insert(NETW, "TeST")),
]

_CHUNKS: list[Row] = [
    ("invalid-ancillary-first", "an ancillary chunk before HEAD", "CON-12",
     lambda b: b.insert(HEAD, "teSt")),
    ("invalid-ancillary-crc", "an unknown ancillary chunk with a wrong CRC", "CON-9",
     _ancillary(lambda v: put(v, -1, lambda x: x ^ 1))),
    ("invalid-ancillary-type", "an unknown ancillary chunk whose third letter is lower case",
     "CON-9", lambda b: b.insert(NETW, "test")),
    ("invalid-ancillary-length", "an unknown ancillary chunk with a length of two gigabytes",
     "CON-9 SEC-1", _ancillary(lambda v: v[:4] + b"\xff\xff\xff\x7f" + v[8:])),
    ("invalid-type-space", "a chunk type with a space", "", lambda b: b.insert(NETW, "te T")),
    ("unsupported-chunk-private", "a private critical chunk", "CON-8", _private("TsST")),
    ("unsupported-chunk-last", "an unknown critical chunk after the textures", "",
     lambda b: b.insert(TAIL, "TEST")),
    ("unsupported-chunk-case", "a known type with another case of its last letter", "CON-8",
     _private("LAYr")),
    ("invalid-chunk-joined", "a chunk that takes in the next one, with the right CRC", "",
     _joined),
    ("invalid-chunk-short", "a chunk whose length ends within its payload", "", _short),
]

_POLYGLOTS: list[Row] = [
    ("invalid-zip-after", "a ZIP archive after TAIL", "REG-3", lambda b: b.data + ZIP),
    ("invalid-zip-before", "a ZIP archive before the signature", "REG-3", lambda b: ZIP + b.data),
    ("invalid-html-after", "a page after TAIL", "", lambda b: b.data + PAGE),
    ("invalid-html-before", "a page before the signature", "", lambda b: PAGE + b.data),
    ("invalid-png-before", "the beginning of a PNG file before the signature", "",
     lambda b: PNG + b.data),
    ("invalid-blank-before", "a byte order mark before the signature", "",
     lambda b: b"\xef\xbb\xbf" + b.data),
    ("invalid-file-twice", "a file after a file", "", lambda b: b.data + b.data),
]
# fmt: on

CASES = refused((*_FRAMING, *_CHUNKS, *_POLYGLOTS))
