"""PNG files: chunks, texts, colour, a check before reading, and a writer; and a writer of PPM."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UsageError
from .color import SRGB, Colour

Pixels = NDArray[Any]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
XMP = "XML:com.adobe.xmp"
"""Keyword of the text that is an XMP packet."""

_READ = (XMP, *(f"Raw profile type {name}" for name in ("exif", "xmp", "APP1", "icc", "icm")))
"""Keywords of texts that are read."""

_TEXT_MAX = 1 << 26
"""Most bytes of a compressed text or profile that are read."""

_ROWS_MAX = 1 << 40
"""Most bytes of pixels that are looked for."""

_PIXELS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""Chunks that decide about pixels."""

_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
"""Bits a sample that each colour type may have."""

_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2),
           (0, 1, 1, 2))  # fmt: skip
"""First column, first row and steps between columns and rows of each pass of Adam7."""


def chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yields the type and body of each chunk of a PNG file; the last one may be cut off."""
    at = 8 if data[:8] == SIGNATURE else len(data)
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        yield data[at + 4 : at + 8], data[at + 8 : end]
        at = end + 4


def texts(data: bytes) -> dict[str, bytes]:
    """Texts of a PNG file by keyword, decompressed; of several with a keyword the first.

    Those that are neither XMP nor raw profiles are empty here.
    """
    found: dict[str, bytes] = {}
    for kind, body in chunks(data):
        keyword, _, rest = body.partition(b"\0")
        packed = kind == b"zTXt"
        if kind == b"iTXt":
            packed, rest = rest[:1] == b"\1", rest[2:].split(b"\0", 2)[-1]
        elif packed:
            rest = rest[1:]
        elif kind != b"tEXt":
            continue
        name = keyword.decode("latin-1")
        if name not in found:
            read = rest if name in _READ else b""
            found[name] = _inflated(read) if packed else read
    return found


def _inflated(data: bytes) -> bytes:
    """Decompressed data; empty if it is damaged or larger than `_TEXT_MAX`."""
    try:
        stream = zlib.decompressobj()
        found = stream.decompress(data, _TEXT_MAX)
        return found if stream.eof else b""
    except zlib.error:
        return b""


def raw_profile(text: bytes) -> bytes:
    """Content of a text `Raw profile type`: a name, a length, and hexadecimal digits."""
    match = re.fullmatch(rb"\s*\S+\s+\d+\s+([0-9a-fA-F\s]*)", text)
    digits = b"".join(match[1].split()) if match else b""
    return bytes.fromhex(digits.decode()) if len(digits) % 2 == 0 else b""


def colour(data: bytes) -> Colour:
    """Colour that a PNG file states: cICP before iCCP, sRGB, gAMA and cHRM (PNG, section 4.3)."""
    known: dict[bytes, bytes] = {}
    for kind, body in chunks(data):
        known.setdefault(kind, body)
    icc = _inflated(known.get(b"iCCP", b"").partition(b"\0")[2][1:])
    if not icc and b"sRGB" not in known:
        told = texts(data)
        profiles = (told.get(f"Raw profile type {n}", b"") for n in ("icc", "icm"))
        icc = next(filter(None, map(raw_profile, profiles)), b"")
    cicp = tuple(known[b"cICP"]) if len(known.get(b"cICP", b"")) == 4 else None
    if icc or b"sRGB" in known:
        return Colour(cicp, icc)
    gamma = None
    stated = int.from_bytes(known.get(b"gAMA", b""), "big")
    if len(known.get(b"gAMA", b"")) == 4 and 1e4 <= stated <= 1e6:  # others make no sense
        gamma = 1e5 / stated
    chromaticities = SRGB
    if len(known.get(b"cHRM", b"")) == 32:
        x, y, *rest = (v / 1e5 for v in struct.unpack(">8I", known[b"cHRM"]))
        chromaticities = (*rest, x, y)
        near = max(abs(a - b) for a, b in zip(chromaticities, SRGB, strict=True)) < 0.002
        if near or not _sound(chromaticities):
            chromaticities = SRGB
    # Writers of sRGB state 2.2; libpng has the same tolerance.
    if gamma is not None and abs(gamma / 2.2 - 1) <= 0.05 and chromaticities == SRGB:
        gamma = None
    return Colour(cicp, gamma=gamma, chromaticities=chromaticities)


def _sound(chromaticities: tuple[float, ...]) -> bool:
    """Whether primaries span a triangle, and the white is in the plane of light."""
    xr, yr, xg, yg, xb, yb, _, y = chromaticities
    return abs((xg - xr) * (yb - yr) - (xb - xr) * (yg - yr)) > 1e-3 and y > 1e-3


def frames(data: bytes) -> int:
    """Number of pictures in a PNG file: 1, or of an animation its frames and a picture apart."""
    number, apart = 1, True
    for kind, body in chunks(data):
        if kind == b"acTL" and len(body) == 8:
            number = max(int.from_bytes(body[:4], "big"), 1)
        elif kind == b"fcTL":
            apart = False
        elif kind == b"IDAT":
            break
    return number + 1 if apart and number > 1 else number


def checked(data: bytes, name: str) -> bytes:
    """Checks the pixels of a PNG file, so that libpng, which prints what is wrong, finds nothing.

    Returns:
        The file with the chunks alone that decide about pixels.

    Raises:
        InputError: The file is damaged or truncated.
    """
    kept: list[tuple[bytes, bytes]] = []
    problem = "the end is missing"
    at = 8
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        kind, crc = data[at + 4 : at + 8], data[end : end + 4]
        if kind in _PIXELS:
            if crc != struct.pack(">I", zlib.crc32(data[at + 4 : end])):
                problem = f"{kind.decode()} is damaged"
                break
            kept.append((kind, data[at + 8 : end]))
        if kind == b"IEND":
            problem = _problem(kept)
            break
        at = end + 4
    if problem:
        raise InputError(f"{name}: damaged or truncated ({problem})")
    return _file([part for part in kept if _useful(*part, kept[0][1][9])])


def _useful(kind: bytes, body: bytes, colours: int) -> bool:
    """Whether a chunk has a place beside pixels of a colour type; others need not be there."""
    if kind == b"tRNS":
        return len(body) == {0: 2, 2: 6}.get(colours) or (colours == 3 and 0 < len(body) <= 256)
    return kind != b"PLTE" or colours not in (0, 4)


def _problem(kept: list[tuple[bytes, bytes]]) -> str:
    """Description of what is wrong in the chunks of a whole file; empty if nothing is."""
    head, last = kept[0][1], [kind for kind, _ in kept]
    if last[0] != b"IHDR" or len(head) != 13 or last.count(b"IHDR") > 1:
        return "the header is damaged"
    width, height, depth, colours, packing, filters, interlace = struct.unpack(">IIBBBBB", head)
    if not (width and height) or max(width, height) >= 1 << 31:
        return "the header is damaged"
    if depth not in _DEPTHS.get(colours, ()) or packing or filters or interlace > 1:
        return "the header is damaged"
    before = last[: last.index(b"IDAT")] if b"IDAT" in last else last
    if colours == 3 and b"PLTE" not in before:
        return "the palette is missing"
    palettes = [body for kind, body in kept if kind == b"PLTE"]
    if len(palettes) > 1 or any(len(b) % 3 or not 3 <= len(b) <= 768 for b in palettes):
        return "the palette is damaged"
    passes = _PASSES if interlace else ((0, 0, 1, 1),)
    bits = depth * _SAMPLES[colours]
    sizes = [(-((x - width) // dx), -((y - height) // dy)) for x, y, dx, dy in passes]
    spans = [(h, 1 + (w * bits + 7) // 8) for w, h in sizes if w > 0 and h > 0]
    wanted = sum(h * span for h, span in spans)
    stream = zlib.decompressobj()
    try:
        rows = stream.decompress(
            b"".join(b for k, b in kept if k == b"IDAT"), min(wanted + 1, _ROWS_MAX)
        )
    except zlib.error:
        return "the pixels are damaged"
    if len(rows) < wanted or (len(rows) == wanted and not stream.eof):
        return "the pixels are damaged"
    start = 0
    for h, span in spans:
        if max(rows[start : start + h * span : span]) > 4:
            return "the pixels are damaged"
        start += h * span
    return ""


def png_chunks(blocks: Mapping[str, bytes]) -> list[tuple[bytes, bytes]]:
    """PNG chunks (type, body) that carry `blocks`; they belong before the pixel data."""
    found = []
    if "cicp" in blocks:
        found.append((b"cICP", blocks["cicp"]))
    if "icc" in blocks:
        found.append((b"iCCP", b"ICC profile\0\0" + zlib.compress(blocks["icc"], 9)))
    if "exif" in blocks:
        found.append((b"eXIf", blocks["exif"]))
    if "xmp" in blocks:
        found.append((b"iTXt", XMP.encode() + b"\0\0\0\0\0" + blocks["xmp"]))
    return found


def encode_png(pixels: Pixels, blocks: Mapping[str, bytes] | None = None) -> bytes:
    """Encodes pixels as a PNG file.

    Args:
        pixels: uint8 or uint16 [H, W, 3] or, with straight alpha, [H, W, 4].
        blocks: Metadata blocks ``icc``, ``cicp``, ``exif``, ``xmp`` to carry.

    Raises:
        UsageError: The pixels have another type.
    """
    if pixels.dtype not in (np.uint8, np.uint16):
        raise UsageError("PNG holds 8 or 16 bits a sample, not floating point")
    height, width, channels = pixels.shape
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).reshape(height, -1).view(np.uint8)
    # Filter type 2 of PNG, Up: cheap, and good on smooth pictures.
    filtered = np.full((height, rows.shape[1] + 1), 2, np.uint8)
    filtered[:, 1:] = np.diff(rows, axis=0, prepend=np.zeros_like(rows[:1]))
    header = struct.pack(
        ">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, {3: 2, 4: 6}[channels], 0, 0, 0
    )
    return _file(
        [
            (b"IHDR", header),
            *png_chunks(blocks or {}),
            (b"IDAT", zlib.compress(filtered.tobytes(), 6)),
            (b"IEND", b""),
        ]
    )


def _file(parts: list[tuple[bytes, bytes]]) -> bytes:
    """PNG file of chunks."""
    out = [SIGNATURE]
    for kind, body in parts:
        crc = struct.pack(">I", zlib.crc32(kind + body))
        out += [struct.pack(">I", len(body)), kind, body, crc]
    return b"".join(out)


def encode_ppm(pixels: Pixels) -> bytes:
    """Encodes uint8 or uint16 pixels [H, W, 3] as a binary PPM file.

    Raises:
        UsageError: The pixels have another type, or alpha.
    """
    if pixels.dtype not in (np.uint8, np.uint16):
        raise UsageError("PPM holds 8 or 16 bits a sample, not floating point")
    if pixels.shape[2] != 3:
        raise UsageError("PPM cannot hold transparency; write PNG instead")
    top = np.iinfo(pixels.dtype).max
    head = f"P6\n{pixels.shape[1]} {pixels.shape[0]}\n{top}\n".encode()
    return head + pixels.astype(pixels.dtype.newbyteorder(">")).tobytes()
