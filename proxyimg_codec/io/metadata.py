"""Raw EXIF and XMP blocks of JPEG, PNG and WebP files, to which image libraries give no access."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping

_JPEG_EXIF = b"Exif\0\0"
_JPEG_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_PNG_XMP = b"XML:com.adobe.xmp\0"
ORIENTATION_TAG = 0x0112


def raw_blocks(data: bytes) -> dict[str, bytes]:
    """Finds the ``exif`` (a TIFF structure) and ``xmp`` (XML) blocks of a picture file, if any.

    Damaged or unknown structures are skipped, so that metadata never keeps a picture from being
    read.
    """
    blocks: dict[str, bytes] = {}
    for name, block in (*_jpeg(data), *_png(data), *_webp(data)):
        blocks.setdefault(name, block)
    return {k: v for k, v in blocks.items() if v}


def _jpeg(data: bytes) -> Iterator[tuple[str, bytes]]:
    at = 2 if data[:2] == b"\xff\xd8" else len(data)
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] not in (0xD9, 0xDA):
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        body = data[at + 4 : end]
        if data[at + 1] == 0xE1 and body.startswith(_JPEG_EXIF):
            yield "exif", body[len(_JPEG_EXIF) :]
        elif data[at + 1] == 0xE1 and body.startswith(_JPEG_XMP):
            yield "xmp", body[len(_JPEG_XMP) :]
        at = max(end, at + 4)


def is_cut_jpeg(data: bytes) -> bool:
    """Whether JPEG data ends before its end marker; decoders would fill the rest with grey."""
    at = 2
    while data[:2] == b"\xff\xd8" and at + 4 <= len(data) and data[at] == 0xFF:
        if data[at + 1] == 0xDA:
            return data.find(b"\xff\xd9", at) < 0
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return False


def _png(data: bytes) -> Iterator[tuple[str, bytes]]:
    at = 8 if data[:8] == b"\x89PNG\r\n\x1a\n" else len(data)
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        type_, body = data[at + 4 : at + 8], data[at + 8 : end]
        if type_ == b"eXIf":
            yield "exif", body
        elif type_ == b"iTXt" and body.startswith(_PNG_XMP):
            flags, rest = body[len(_PNG_XMP) : len(_PNG_XMP) + 2], body[len(_PNG_XMP) + 2 :]
            text = rest.split(b"\0", 2)[-1]
            if flags[:1] == b"\0":
                yield "xmp", text
        at = end + 4


def _webp(data: bytes) -> Iterator[tuple[str, bytes]]:
    at = 12 if data[:4] == b"RIFF" and data[8:12] == b"WEBP" else len(data)
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        body = data[at + 8 : at + 8 + size]
        if data[at : at + 4] == b"EXIF":
            yield "exif", body.removeprefix(_JPEG_EXIF)
        elif data[at : at + 4] == b"XMP ":
            yield "xmp", body
        at += 8 + size + size % 2


def upright(blocks: Mapping[str, bytes]) -> dict[str, bytes]:
    """Returns the blocks with their orientation set to 1, because the pixels have been turned.

    A block without an orientation, or one that cannot be read, is returned unchanged.
    """
    change = {"exif": _upright_exif, "xmp": _upright_xmp}
    return {name: change.get(name, bytes)(block) for name, block in blocks.items()}


def _upright_xmp(xmp: bytes) -> bytes:
    return re.sub(rb"""(tiff:Orientation(?:\s*=\s*["']|>)\s*)[2-8]""", rb"\g<1>1", xmp)


def _upright_exif(exif: bytes) -> bytes:
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(exif[:4])
    if order is None or len(exif) < 10:
        return exif
    (start,) = struct.unpack_from(order + "I", exif, 4)
    if start + 2 > len(exif):
        return exif
    (count,) = struct.unpack_from(order + "H", exif, start)
    for at in range(start + 2, min(start + 2 + 12 * count, len(exif) - 11), 12):
        if struct.unpack_from(order + "H", exif, at)[0] == ORIENTATION_TAG:
            return exif[: at + 8] + struct.pack(order + "HH", 1, 0) + exif[at + 12 :]
    return exif


def png_chunks(blocks: dict[str, bytes]) -> list[tuple[bytes, bytes]]:
    """PNG chunks (type, body) that carry `blocks`; they belong before the pixel data."""
    chunks = []
    if "icc" in blocks:
        chunks.append((b"iCCP", b"ICC profile\0\0" + zlib.compress(blocks["icc"], 9)))
    if "exif" in blocks:
        chunks.append((b"eXIf", blocks["exif"]))
    if "xmp" in blocks:
        chunks.append((b"iTXt", _PNG_XMP + b"\0\0\0\0" + blocks["xmp"]))
    return chunks
