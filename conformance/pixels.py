"""Reader of the PNG and NPY files that decoders write; strict, with numpy and zlib alone."""

from __future__ import annotations

import ast
import math
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

SAMPLES_MAX = 1 << 26
"""Most samples of a picture; no case comes near it."""


def read(data: bytes) -> NDArray[Any]:
    """Reads a PNG or NPY file.

    Returns:
        uint16 or float32 [H, W, 3 or 4] pixels.

    Raises:
        ValueError: The file is damaged, or not of these types.
    """
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return _read_png(data)
    if data[:6] == b"\x93NUMPY":
        return _read_npy(data)
    raise ValueError("neither a PNG nor an NPY file")


def _check_shape(shape: tuple[int, ...]) -> None:
    """Checks that a shape is that of a picture [H, W, 3 or 4]."""
    whole = len(shape) == 3 and all(type(v) is int and v > 0 for v in shape)
    if not whole or shape[2] not in (3, 4) or math.prod(shape) > SAMPLES_MAX:
        raise ValueError(f"shape {shape} is not that of an RGB or RGBA picture")


def _read_npy(data: bytes) -> NDArray[Any]:
    """Reads an NPY file of uint16 or float32."""
    start, form = (12, "<I") if data[6:7] > b"\x01" else (10, "<H")
    if len(data) < start:
        raise ValueError("the NPY file is truncated")
    end = start + struct.unpack_from(form, data, 8)[0]
    try:
        head = ast.literal_eval(data[start:end].decode("latin-1").strip())
        kind, fortran, shape = head["descr"], head["fortran_order"], tuple(head["shape"])
    except (SyntaxError, ValueError, KeyError, TypeError, RecursionError, MemoryError):
        raise ValueError("the NPY header is damaged") from None
    if kind not in ("<u2", ">u2", "<f4", ">f4"):
        raise ValueError(f"NPY samples of type {kind} are neither uint16 nor float32")
    _check_shape(shape)
    dtype = np.dtype(kind)
    if len(data) - end != math.prod(shape) * dtype.itemsize:
        raise ValueError("the NPY file does not have the length that its header states")
    array = np.frombuffer(data, dtype, offset=end).reshape(shape, order="F" if fortran else "C")
    return array.astype(dtype.newbyteorder("="))


def _read_png(data: bytes) -> NDArray[Any]:
    """Reads a PNG file of 16-bit RGB or RGBA without interlacing."""
    chunks = _png_chunks(data)
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 13:
        raise ValueError("the PNG file does not start with IHDR")
    width, height, depth, colour, *methods = struct.unpack(">IIBBBBB", chunks[0][1])
    if depth != 16 or colour not in (2, 6) or methods != [0, 0, 0]:
        raise ValueError("the PNG file is not 16-bit RGB or RGBA without interlacing")
    channels = {2: 3, 6: 4}[colour]
    _check_shape((height, width, channels))
    stride = 2 * width * channels
    inflate = zlib.decompressobj()
    try:
        packed = b"".join(body for type_, body in chunks if type_ == b"IDAT")
        rows = inflate.decompress(packed, height * (stride + 1) + 1)
    except zlib.error:
        raise ValueError("the PNG data are damaged") from None
    if len(rows) != height * (stride + 1):
        raise ValueError("the PNG data do not have the right length")
    out = np.zeros((height + 1, stride), np.uint8)
    for y in range(height):
        line = np.frombuffer(rows, np.uint8, stride + 1, y * (stride + 1))
        out[y + 1] = _unfilter(int(line[0]), line[1:], out[y], 2 * channels)
    return out[1:].view(">u2").astype(np.uint16).reshape(height, width, channels)


def _png_chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Types and contents of the chunks of a PNG file."""
    chunks: list[tuple[bytes, bytes]] = []
    at = 8
    while at < len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        crc = data[end : end + 4]
        if len(crc) < 4 or zlib.crc32(data[at + 4 : end]) != int.from_bytes(crc, "big"):
            raise ValueError("the PNG file is truncated or a CRC is wrong")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : end]))
        at = end + 4
    if not chunks or chunks[-1][0] != b"IEND":
        raise ValueError("the PNG file has no end")
    return chunks


def _unfilter(
    kind: int, line: NDArray[np.uint8], above: NDArray[np.uint8], step: int
) -> NDArray[np.uint8]:
    """Undoes the PNG filter of a row.

    Args:
        kind: Number of the filter.
        line: uint8 [stride] filtered bytes.
        above: uint8 [stride] bytes of the row above.
        step: Bytes a pixel.
    """
    if kind == 0:
        return line
    if kind == 2:
        return line + above
    if kind not in (1, 3, 4):
        raise ValueError(f"PNG filter {kind} does not exist")
    out = [0] * step + line.tolist()
    up = [0] * step + above.tolist()
    for i in range(step, len(out)):
        a, b, c = out[i - step], up[i], up[i - step]
        guess = (a, (a + b) // 2, _paeth(a, b, c))[(1, 3, 4).index(kind)]
        out[i] = (out[i] + guess) & 255
    return np.array(out[step:], np.uint8)


def _paeth(a: int, b: int, c: int) -> int:
    """Paeth predictor of the PNG specification."""
    p = a + b - c
    return min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
