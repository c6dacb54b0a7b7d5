"""Colour profiles and PNG files that state colours, made byte by byte."""

import itertools
import struct
import zlib

import numpy as np

P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
BT2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
SRGB = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def to_light(numbers):
    """Light of sRGB numbers (IEC 61966-2-1)."""
    numbers = np.asarray(numbers, float)
    return np.where(numbers <= 0.04045, numbers / 12.92, ((numbers + 0.055) / 1.055) ** 2.4)


def to_numbers(light):
    """sRGB numbers of light, clipped."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def to_xyz(chromaticities):
    """Matrix from light of primaries, whose white is D65, to XYZ (SMPTE RP 177)."""
    x, y = np.reshape(chromaticities, (4, 2)).T
    columns = np.array([x / y, np.ones(4), (1 - x - y) / y])
    return columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3])


def between(source, target):
    """Matrix from light of some primaries to that of others."""
    return np.linalg.solve(to_xyz(target), to_xyz(source))


def cmyk_icc(lightness) -> bytes:
    """Profile of CMYK whose colours are grey (ICC.1:2001-04, type lut8).

    Args:
        lightness: L* of 0..100 of the sixteen mixtures of no and full ink, black changing fastest.
    """
    table = bytes(v for level in lightness for v in (round(level * 2.55), 128, 128))
    line = bytes(range(256))
    matrix = struct.pack(">9i", *(65536 * (k % 4 == 0) for k in range(9)))
    lut = b"mft1\0\0\0\0" + bytes([4, 3, 2, 0]) + matrix + 4 * line + table + 3 * line
    white = b"XYZ \0\0\0\0" + struct.pack(">3I", 0xF6D6, 0x10000, 0xD32D)
    return profile(b"prtr", b"CMYK", b"Lab ", {b"A2B0": lut, b"wtpt": white})


def grey_icc(gamma: float) -> bytes:
    """Profile of grey whose light is its number to the power of `gamma`."""
    curve = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(gamma * 256)) + b"\0\0"
    white = b"XYZ \0\0\0\0" + struct.pack(">3I", 0xF6D6, 0x10000, 0xD32D)
    return profile(b"mntr", b"GRAY", b"XYZ ", {b"kTRC": curve, b"wtpt": white})


def profile(kind: bytes, space: bytes, connection: bytes, tags: dict[bytes, bytes]) -> bytes:
    """Profile of a class, a colour space and a connection space with tags."""
    at, index, body = 132 + 12 * len(tags), b"", b""
    for name, content in tags.items():
        content += bytes(-len(content) % 4)
        index += struct.pack(">4sII", name, at + len(body), len(content))
        body += content
    d50 = struct.pack(">III", 0xF6D6, 0x10000, 0xD32D)
    head = struct.pack(">I4sI4s4s4s", at + len(body), b"none", 0x02400000, kind, space, connection)
    head = (head.ljust(36, b"\0") + b"acsp").ljust(68, b"\0") + d50.ljust(60, b"\0")
    return head + struct.pack(">I", len(tags)) + index + body


MIXTURES = list(itertools.product((0, 255), repeat=4))
"""Inks of the sixteen mixtures in the order of `cmyk_icc`."""


def png_of(
    pixels, *chunks: tuple[bytes, bytes], late: tuple[tuple[bytes, bytes], ...] = ()
) -> bytes:
    """PNG file of uint8 or uint16 [H, W, 1 or 3] with more chunks before and behind the pixels."""
    height, width, channels = pixels.shape
    depth = 8 * pixels.dtype.itemsize
    head = struct.pack(">IIBBBBB", width, height, depth, {1: 0, 3: 2}[channels], 0, 0, 0)
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).tobytes()
    step = len(rows) // height
    data = zlib.compress(b"".join(b"\0" + rows[k : k + step] for k in range(0, len(rows), step)))
    out = b"\x89PNG\r\n\x1a\n"
    for kind, body in ((b"IHDR", head), *chunks, (b"IDAT", data), *late, (b"IEND", b"")):
        crc = struct.pack(">I", zlib.crc32(kind + body))
        out += struct.pack(">I", len(body)) + kind + body + crc
    return out


def tiff_of(pixels, order: str = "<", **tags: int) -> bytes:
    """TIFF file of one strip of [H, W, C] of any type.

    Args:
        pixels: The samples.
        order: Byte order as `struct` writes it.
        tags: Further tags of type SHORT by number, such as ``t262=0``.
    """
    height, width, channels = pixels.shape
    data = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes()
    form = {"u": 1, "i": 2, "f": 3}[pixels.dtype.kind]
    values = {256: [width], 257: [height], 258: [8 * pixels.dtype.itemsize] * channels, 259: [1],
              262: [2 if channels > 2 else 1], 273: [8], 277: [channels], 278: [height],
              279: [len(data)], 339: [form] * channels}  # fmt: skip
    values |= {int(name[1:]): [value] for name, value in tags.items()}
    start = 8 + len(data) + len(data) % 2
    more, rows = b"", b""
    for tag, items in sorted(values.items()):
        kind = "I" if tag in (273, 279) else "H"
        body = struct.pack(f"{order}{len(items)}{kind}", *items)
        if len(body) > 4:
            place = start + 2 + 12 * len(values) + 4 + len(more)
            more, body = more + body + bytes(len(body) % 2), struct.pack(order + "I", place)
        kind_number = 4 if kind == "I" else 3
        rows += struct.pack(order + "HHI", tag, kind_number, len(items)) + body.ljust(4, b"\0")
    head = {"<": b"II*\0", ">": b"MM\0*"}[order] + struct.pack(order + "I", start)
    pad = bytes(len(data) % 2)
    return head + data + pad + struct.pack(order + "H", len(values)) + rows + bytes(4) + more


def gama(value: int) -> tuple[bytes, bytes]:
    """Chunk gAMA."""
    return b"gAMA", struct.pack(">I", value)


def chrm(chromaticities) -> tuple[bytes, bytes]:
    """Chunk cHRM."""
    *colours, x, y = chromaticities
    return b"cHRM", struct.pack(">8I", *(round(v * 1e5) for v in (x, y, *colours)))


def iccp(icc: bytes) -> tuple[bytes, bytes]:
    """Chunk iCCP."""
    return b"iCCP", b"x\0\0" + zlib.compress(icc)
