"""EXIF and XMP blocks of picture files: found, set upright, and put in."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping

from . import boxes, exif, png

_JPEG_EXIF = b"Exif\0\0"
_JPEG_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_JPEG_MORE_XMP = b"http://ns.adobe.com/xmp/extension/\0"
_SEGMENT_MAX = (1 << 16) - 3
"""Most bytes of a JPEG segment."""

Block = tuple[str, bytes]


def raw_blocks(data: bytes, number: int = 0) -> dict[str, bytes]:
    """Finds the ``exif`` (a TIFF structure) and ``xmp`` (XML) blocks of a picture file, if any.

    Damaged or unknown structures are skipped, so that metadata never keeps a picture from being
    read.

    Args:
        data: The file.
        number: Number of the picture in a TIFF file, from 0.
    """
    blocks: dict[str, bytes] = {}
    for name, block in (*_jpeg(data), *_png(data), *_webp(data), *boxes.blocks(data)):
        if block:
            blocks.setdefault(name, block)
    return blocks | exif.from_tiff(data, number)


def left_out(data: bytes) -> list[str]:
    """Names what a file tells that is neither read as EXIF or XMP, nor colour."""
    found = ["IPTC"] if exif.IPTC in exif.tags(data) else []
    found += ["XMP"] * (data[:3] == b"GIF" and b"!\xff\x0bXMP DataXMP" in data)
    for marker, body in jpeg_segments(data):
        if marker == 0xED and b"8BIM\x04\x04" in body:
            found.append("IPTC")
        elif marker == 0xE1 and body.startswith(_JPEG_MORE_XMP):
            found.append("extended XMP")
        elif marker == 0xFE and body.strip(b"\0 "):
            found.append("comments")
    texts = png.texts(data)
    found += ["IPTC"] * any("profile type iptc" in k or "profile type 8bim" in k for k in texts)
    known = ("Raw profile type", png.XMP, "Software", "date:")
    found += ["texts"] * any(not k.startswith(known) for k in texts)
    return list(dict.fromkeys(found))


def jpeg_segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yields the marker and body of each segment of JPEG data before its first scan."""
    for marker, start, end in _segments(data):
        if marker not in (0xD9, 0xDA):
            yield marker, data[start + 4 : end]


def _segments(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yields marker, start and end of each segment, up to the first scan or the end marker."""
    at = 2 if data[:2] == b"\xff\xd8" else len(data)
    while at + 4 <= len(data) and data[at] == 0xFF:
        if data[at + 1] == 0xFF:  # a fill byte, of which any number may stand before a marker
            at += 1
            continue
        end = max(at + 2 + int.from_bytes(data[at + 2 : at + 4], "big"), at + 4)
        yield data[at + 1], at, end
        if data[at + 1] in (0xD9, 0xDA):
            break
        at = end


def _jpeg(data: bytes) -> Iterator[Block]:
    for marker, body in jpeg_segments(data):
        if marker == 0xE1 and body.startswith(_JPEG_EXIF):
            yield "exif", body[len(_JPEG_EXIF) :]
        elif marker == 0xE1 and body.startswith(_JPEG_XMP):
            yield "xmp", body[len(_JPEG_XMP) :]


def is_cut_jpeg(data: bytes) -> bool:
    """Whether JPEG data ends before its end marker; decoders would fill the rest with grey."""
    scans = [start for marker, start, _ in _segments(data) if marker == 0xDA]
    return bool(scans) and data.find(b"\xff\xd9", scans[0]) < 0


def _png(data: bytes) -> Iterator[Block]:
    for kind, body in png.chunks(data):
        if kind == b"eXIf":
            yield "exif", body.removeprefix(_JPEG_EXIF)
    texts = png.texts(data)
    if png.XMP in texts:
        yield "xmp", texts[png.XMP]
    # What ImageMagick and exiftool wrote before PNG had a chunk for EXIF.
    for name in ("exif", "xmp", "APP1"):
        block = png.raw_profile(texts.get(f"Raw profile type {name}", b""))
        if block.startswith(_JPEG_XMP) or name == "xmp":
            yield "xmp", block.removeprefix(_JPEG_XMP)
        else:
            yield "exif", block.removeprefix(_JPEG_EXIF)


def riff_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yields the type and body of each chunk of a WebP file."""
    at = 12 if data[:4] == b"RIFF" and data[8:12] == b"WEBP" else len(data)
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        yield data[at : at + 4], data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2


def _webp(data: bytes) -> Iterator[Block]:
    for kind, body in riff_chunks(data):
        if kind == b"EXIF":
            yield "exif", body.removeprefix(_JPEG_EXIF)
        elif kind == b"XMP ":
            yield "xmp", body


def upright(blocks: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the blocks with their orientation set to 1, because the pixels have been turned.

    A block without an orientation, or one that cannot be read, is returned unchanged.
    """
    change = {"exif": exif.upright, "xmp": _upright_xmp}
    return {name: change.get(name, bytes)(block) for name, block in blocks.items()}


_XMP_ORIENTATION = rb"""(tiff:Orientation(?:\s*=\s*["']|>)\s*)([1-8])"""


def xmp_orientation(xmp: bytes) -> int | None:
    """Orientation that an XMP packet states, 1..8; None if it states none."""
    match = re.search(_XMP_ORIENTATION, xmp)
    return None if match is None else int(match[2])


def _upright_xmp(xmp: bytes) -> bytes:
    return re.sub(_XMP_ORIENTATION, rb"\g<1>1", xmp)


def embed(data: bytes, blocks: Mapping[str, bytes]) -> tuple[bytes, list[str]]:
    """Puts the blocks ``exif`` and ``xmp`` into a file without changing its pixels.

    JPEG, WebP, TIFF, JPEG XL and JPEG 2000 hold them.

    Args:
        data: The file, which has no such blocks, or ones to be replaced.
        blocks: The blocks; others are left alone.

    Returns:
        The file, and the names of blocks that it cannot hold.
    """
    told = {k: blocks[k] for k in ("exif", "xmp") if k in blocks}
    if data[:2] == b"\xff\xd8":
        return _into_jpeg(data, told)
    if data[8:12] == b"WEBP":
        return (_into_webp(data, told) if told else data), []
    if boxes.is_boxed(data):
        return boxes.put(data, told), []
    try:
        return exif.into_tiff(data, told), []
    except ValueError:
        return data, [*told]


def _into_jpeg(data: bytes, blocks: Mapping[str, bytes]) -> tuple[bytes, list[str]]:
    """Replaces the APP1 segments of JPEG data; they stand behind the header of JFIF."""
    marks = {"exif": _JPEG_EXIF, "xmp": _JPEG_XMP}
    bodies = {k: marks[k] + v for k, v in blocks.items()}
    fits = {k: v for k, v in bodies.items() if len(v) <= _SEGMENT_MAX}
    segments = [_segment(0xE1, v) for v in fits.values()]
    before: list[bytes] = []
    at = 2
    for marker, start, end in _segments(data):
        if marker in (0xD9, 0xDA):
            break
        if marker == 0xE0:
            before.append(data[start:end])
        elif marker != 0xE1:
            segments.append(data[start:end])
        at = end
    return b"".join([data[:2], *before, *segments, data[at:]]), [*(bodies.keys() - fits.keys())]


def _segment(marker: int, body: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body


def _into_webp(data: bytes, blocks: Mapping[str, bytes]) -> bytes:
    """Adds chunks to a WebP file, and the header VP8X that they need (RFC 9649, section 2.7)."""
    chunks = dict(riff_chunks(data))
    header = bytearray(chunks.pop(b"VP8X", b"") or _webp_header(chunks))
    names = {"exif": (b"EXIF", 8), "xmp": (b"XMP ", 4)}
    for name, block in blocks.items():
        kind, flag = names[name]
        chunks[kind] = block
        header[0] |= flag
    last = [chunks.pop(k) for k in (b"EXIF", b"XMP ") if k in chunks]
    kinds = [k for k in (b"EXIF", b"XMP ") if header[0] & dict(names.values())[k]]
    parts = [(b"VP8X", bytes(header)), *chunks.items(), *zip(kinds, last, strict=True)]
    body = b"WEBP" + b"".join(
        kind + struct.pack("<I", len(part)) + part + bytes(len(part) % 2) for kind, part in parts
    )
    return b"RIFF" + struct.pack("<I", len(body)) + body


def _webp_header(chunks: Mapping[bytes, bytes]) -> bytes:
    """Body of VP8X for a file that has a single chunk of pixels (RFC 9649, sections 2.5 to 2.7)."""
    if b"VP8L" in chunks:
        bits = int.from_bytes(chunks[b"VP8L"][1:5], "little")
        width, height, alpha = bits & 0x3FFF, bits >> 14 & 0x3FFF, bits >> 28 & 1
    else:
        width, height = (v & 0x3FFF for v in struct.unpack_from("<HH", chunks[b"VP8 "], 6))
        width, height, alpha = width - 1, height - 1, 0
    sides = width.to_bytes(3, "little") + height.to_bytes(3, "little")
    return bytes([16 * alpha, 0, 0, 0]) + sides
