"""EXIF and XMP in the boxes of JPEG XL (ISO/IEC 18181-2) and JPEG 2000 (ISO/IEC 15444-1) files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

_START = b"\0\0\0\x0c"
_XL, _2000 = b"JXL \r\n\x87\n", b"jP  \r\n\x87\n"
_UUIDS = {
    "exif": b"JpgTiffExif->JP2",
    "xmp": bytes.fromhex("be7acfcb97a942e89c71999491e3afac"),
}
"""Ids of boxes of JPEG 2000."""

_KINDS = {"exif": b"Exif", "xmp": b"xml "}
"""Types of boxes of JPEG XL."""

_FOUND_MAX = 1 << 26
"""Most bytes of a compressed box that are read."""


def is_boxed(data: bytes) -> bool:
    """Whether a file is JPEG XL with boxes, or JPEG 2000."""
    return data[:4] == _START and data[4:12] in (_XL, _2000)


def is_jpeg_xl(data: bytes) -> bool:
    """Whether a file is JPEG XL with boxes. Its own header turns the picture, and not EXIF."""
    return is_boxed(data) and data[4:12] == _XL


def _boxes(data: bytes) -> Iterator[tuple[bytes, int, int, int]]:
    """Yields the type of each box, and where it, its content and the next box begin."""
    at = 0 if is_boxed(data) else len(data)
    while at + 8 <= len(data):
        size, head = int.from_bytes(data[at : at + 4], "big"), 8
        if size == 1:
            size, head = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        end = at + size if size else len(data)
        if end < at + head or end > len(data):
            return
        yield data[at + 4 : at + 8], at, at + head, end
        at = end


def _named(kind: bytes, content: bytes) -> tuple[str, bytes] | None:
    """Name and content of a box that holds a block."""
    if kind == b"brob":
        return _named(content[:4], _inflated(content[4:]))
    if kind == b"uuid":
        names = {v: k for k, v in _UUIDS.items()}
        name = names.get(content[:16])
        return None if name is None else (name, content[16:].removeprefix(b"Exif\0\0"))
    if kind == b"Exif":
        return "exif", content[4 + int.from_bytes(content[:4], "big") :]
    return ("xmp", content) if kind == b"xml " else None


def _inflated(data: bytes) -> bytes:
    """Content of a box compressed by Brotli; empty if it is damaged, or cannot be read here."""
    try:
        import imagecodecs
    except ImportError:
        return b""
    try:
        return bytes(imagecodecs.brotli_decode(data, out=_FOUND_MAX))
    except (imagecodecs.BrotliError, ValueError):
        return b""


def blocks(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yields name and content of each block ``exif`` and ``xmp`` of a file with boxes."""
    for kind, _, start, end in _boxes(data):
        found = _named(kind, data[start:end])
        if found is not None:
            yield found


def put(data: bytes, told: Mapping[str, bytes]) -> bytes:
    """Replaces the blocks ``exif`` and ``xmp`` of a file with boxes."""
    kept, last = [], 0
    for kind, at, start, end in _boxes(data):
        if _named(kind, data[start:end]) is None:
            kept.append(_closed(data[at:end]))
        last = end
    if data[4:12] == _XL:
        new = [(_KINDS[k], bytes(4 * (k == "exif")) + v) for k, v in told.items()]
    else:
        new = [(b"uuid", _UUIDS[k] + v) for k, v in told.items()]
    added = [(8 + len(v)).to_bytes(4, "big") + k + v for k, v in new]
    return b"".join([*kept, data[last:], *added])


def _closed(box: bytes) -> bytes:
    """Box that states its size, which the last one of a file need not."""
    return box if any(box[:4]) else len(box).to_bytes(4, "big") + box[4:]
