"""EXIF blocks: orientation, and directories taken from and put into TIFF files (TIFF 6.0)."""

from __future__ import annotations

import struct
from collections.abc import Mapping

ORIENTATION, XMP, IPTC = 0x0112, 0x02BC, 0x83BB
_EXIF, _GPS, _INTEROPERABILITY = 0x8769, 0x8825, 0xA005
_POINTERS = (_EXIF, _GPS, _INTEROPERABILITY)
"""Tags whose value is the place of another directory."""

_ITEM = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
"""Bytes of an item of each type."""

_WORD = {**_ITEM, 5: 4, 10: 4}
"""Bytes that are turned round for the other byte order, of each type."""

_NUMBER = {1: "B", 3: "H", 4: "I"}

_STRUCTURE = {
    *range(254, 270), *range(273, 274), *range(277, 282), *range(284, 294), 297, 301,
    *range(317, 348), *range(512, 533), XMP, IPTC, 34377, 34675, 37724,
}  # fmt: skip
"""Tags that describe the pixels of a TIFF file, or hold what is no EXIF."""

_FILE = {282, 283, 296, 305, 306}
"""Tags that nearly every TIFF file has: resolution, software, time of the last change."""

_ENTRIES_MAX = 4096
"""Most entries of a directory that are looked at."""

Value = tuple[int, int, bytes]
"""Type, number of items, and bytes in little-endian order."""

Directory = dict[int, "Value | Directory"]
"""Values and directories by tag."""


def _order(data: bytes) -> str | None:
    """Byte order of a TIFF structure, as `struct` writes it; None if `data` is none."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    return order if len(data) >= 10 else None


def is_tiff(data: bytes) -> bool:
    """Whether data is a TIFF structure: a file, or an EXIF block."""
    return _order(data) is not None


def _entries(data: bytes, order: str, start: int) -> list[tuple[int, int]]:
    """Tags of a directory, and where their entries of 12 bytes are; those that are there."""
    if start < 8 or start + 2 > len(data):
        return []
    (count,) = struct.unpack_from(order + "H", data, start)
    places = range(start + 2, start + 2 + 12 * min(count, _ENTRIES_MAX), 12)
    return [(struct.unpack_from(order + "H", data, p)[0], p) for p in places if p + 12 <= len(data)]


def _next(data: bytes, order: str, start: int) -> int:
    """Place of the directory after the one at `start`; 0 if there is none."""
    if start < 8 or start + 2 > len(data):
        return 0
    (count,) = struct.unpack_from(order + "H", data, start)
    at = start + 2 + 12 * count
    return int(struct.unpack_from(order + "I", data, at)[0]) if at + 4 <= len(data) else 0


def _first(data: bytes, order: str) -> int:
    return int(struct.unpack_from(order + "I", data, 4)[0])


def tags(data: bytes) -> set[int]:
    """Tags of the first directory of a TIFF structure; none if `data` is no such structure."""
    order = _order(data)
    return {tag for tag, _ in _entries(data, order, _first(data, order))} if order else set()


def orientation(exif: bytes) -> int | None:
    """Orientation that an EXIF block states, 1..8; None if it states none."""
    order = _order(exif)
    if order is None:
        return None
    for tag, at in _entries(exif, order, _first(exif, order)):
        if tag == ORIENTATION:
            form = _NUMBER.get(struct.unpack_from(order + "H", exif, at + 2)[0], "H")
            value = struct.unpack_from(order + form, exif, at + 8)[0]
            return value if 1 <= value <= 8 else None
    return None


def is_adobe_rgb(exif: bytes) -> bool:
    """Whether a block has the mark of Adobe RGB, index R03 (Exif 2.32, Annex A and DCF 2.0)."""
    at = _mark(exif)
    return at is not None and exif[at : at + 3] == b"R03"


def as_srgb(exif: bytes) -> bytes:
    """Sets the mark of Adobe RGB in a block, if there is one, to that of sRGB, R98."""
    at = _mark(exif)
    return exif[:at] + b"R98" + exif[at + 3 :] if at is not None and is_adobe_rgb(exif) else exif


def _mark(exif: bytes) -> int | None:
    """Place of the index of interoperability in a block; None if there is none."""
    order = _order(exif)
    if order is None:
        return None
    start = _first(exif, order)
    for tag in (_EXIF, _INTEROPERABILITY):
        places = [at for found, at in _entries(exif, order, start) if found == tag]
        start = struct.unpack_from(order + "I", exif, places[0] + 8)[0] if places else 0
    return next((at + 8 for found, at in _entries(exif, order, start) if found == 1), None)


def upright(exif: bytes) -> bytes:
    """Sets the orientation of a block to 1, and drops the thumbnail of a picture that was turned.

    A block without an orientation, or one that cannot be read, is returned unchanged.
    """
    order, turned = _order(exif), orientation(exif) not in (None, 1)
    if order is None:
        return exif
    out, start = bytearray(exif), _first(exif, order)
    for tag, at in _entries(exif, order, start):
        if tag == ORIENTATION:
            out[at + 2 : at + 12] = struct.pack(order + "HIHH", 3, 1, 1, 0)
    (count,) = struct.unpack_from(order + "H", exif, start) if start + 2 <= len(exif) else (0,)
    link = start + 2 + 12 * count
    if turned and link + 4 <= len(exif):
        out[link : link + 4] = bytes(4)
    return bytes(out)


def _swapped(value: bytes, kind: int, order: str) -> bytes:
    """Value in the other byte order if `order` is not little-endian."""
    size = _WORD[kind]
    if order == "<" or size == 1:
        return value
    return b"".join(value[k : k + size][::-1] for k in range(0, len(value), size))


def _directory(data: bytes, order: str, start: int, depth: int = 0) -> Directory:
    """Directory at a place of a TIFF structure, without what is damaged."""
    found: Directory = {}
    for tag, at in _entries(data, order, start):
        kind, count = struct.unpack_from(order + "HI", data, at + 2)
        size = _ITEM.get(kind, 0) * count
        place = at + 8 if size <= 4 else struct.unpack_from(order + "I", data, at + 8)[0]
        if not size or place + size > len(data):
            continue
        if tag in _POINTERS:
            place = struct.unpack_from(order + "I", data, at + 8)[0]
            inner = _directory(data, order, place, depth + 1) if depth < 3 else {}
            if inner:
                found[tag] = inner
        else:
            found[tag] = kind, count, _swapped(data[place : place + size], kind, order)
    return found


def _serialized(entries: Mapping[int, Value | Directory], order: str, base: int) -> bytes:
    """Directory as bytes that stand at `base` of a file, without a next one."""
    rows, values = [], b""
    after = base + 2 + 12 * len(entries) + 4
    for tag, entry in sorted(entries.items()):
        if isinstance(entry, dict):
            place = after + len(values)
            values += _serialized(entry, order, place)
            rows.append(struct.pack(order + "HHII", tag, 4, 1, place))
        else:
            kind, count, value = entry
            value = _swapped(value, kind, order)
            if len(value) > 4:
                place = after + len(values)
                values += value + bytes(len(value) % 2)
                value = struct.pack(order + "I", place)
            rows.append(struct.pack(order + "HHI", tag, kind, count) + value.ljust(4, b"\0"))
    return struct.pack(order + "H", len(rows)) + b"".join(rows) + bytes(4) + values


def from_tiff(data: bytes, number: int = 0) -> dict[str, bytes]:
    """Finds what a picture of a TIFF file says in EXIF and XMP.

    Args:
        data: The file.
        number: Number of the picture, from 0.

    Returns:
        Blocks ``exif``, a TIFF structure of its own, and ``xmp``, if there is something in them.
    """
    order = _order(data)
    if order is None:
        return {}
    start = _first(data, order)
    for _ in range(number):
        start = _next(data, order, start)
    entries = _directory(data, order, start)
    blocks = {}
    xmp = entries.get(XMP)
    if isinstance(xmp, tuple):
        blocks["xmp"] = xmp[2]
    told = {k: v for k, v in entries.items() if k not in _STRUCTURE and k != ORIENTATION}
    if told.keys() - _FILE:
        blocks["exif"] = b"II*\0\x08\0\0\0" + _serialized(told, "<", 8)
    return blocks


def into_tiff(data: bytes, blocks: Mapping[str, bytes]) -> bytes:
    """Puts the blocks ``exif`` and ``xmp`` into the first picture of a TIFF file.

    Its directory is written anew at the end of the file, without the time and the XMP that it had.

    Raises:
        ValueError: `data` is no TIFF file with offsets of 32 bits.
    """
    order = _order(data)
    if order is None:
        raise ValueError("not a TIFF file with offsets of 32 bits")
    start = _first(data, order)
    more: Directory = {}
    exif = blocks.get("exif", b"")
    told = _order(exif)
    if told is not None:
        inside = _directory(exif, told, _first(exif, told))
        more = {k: v for k, v in inside.items() if k not in _STRUCTURE}
    if "xmp" in blocks:
        more[XMP] = 1, len(blocks["xmp"]), blocks["xmp"]
    data += bytes(len(data) % 2)
    old = {
        t: data[p : p + 12] for t, p in _entries(data, order, start) if t not in {*more, 306, XMP}
    }
    # Entries that stay are copied: the places that they name do not move.
    base = len(data)
    count = len(old) + len(more)
    values_at = base + 2 + 12 * count + 4
    new = _serialized(more, order, values_at - (2 + 12 * len(more) + 4))
    rows = {t: new[2 + 12 * k : 14 + 12 * k] for k, t in enumerate(sorted(more))}
    listed = b"".join(row for _, row in sorted({**old, **rows}.items()))
    values = new[2 + 12 * len(more) + 4 :]
    tail = struct.pack(order + "I", _next(data, order, start))
    head = data[:4] + struct.pack(order + "I", base)
    return head + data[8:] + struct.pack(order + "H", count) + listed + tail + values
