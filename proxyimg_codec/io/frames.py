"""Pictures of files that hold several, for which OpenImageIO does not do: read through Pillow.

Frames of GIF, PNG and WebP are shown on top of each other; Pillow puts them together. It also gives
the inks of a JPEG file in CMYK.
"""

from __future__ import annotations

import contextlib
import io
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, PxiError, UnsupportedError
from . import png
from .metadata import jpeg_segments, riff_chunks

Pixels = NDArray[Any]


def is_animated(data: bytes) -> bool:
    """Whether a file is GIF, or a PNG or WebP file with several frames."""
    if data[:6] in (b"GIF87a", b"GIF89a") or png.frames(data) > 1:
        return True
    return any(kind in (b"ANIM", b"ANMF") for kind, _ in riff_chunks(data))


def read(data: bytes, name: str, frame: int) -> tuple[Pixels, int]:
    """Reads one frame as it is displayed.

    Args:
        data: A file for which `is_animated` is true.
        name: Name of the file in error messages.
        frame: Number of the frame, from 0; a picture of a PNG file that is not part of the
            animation comes before it.

    Returns:
        uint8 [H, W, 3] or, with straight alpha, [H, W, 4]; and the number of frames.

    Raises:
        InputError: The file is damaged, or has no such frame.
        UnsupportedError: Pillow is not installed.
    """
    with _opened(data, name) as source:
        count = int(getattr(source, "n_frames", 1))
        if not 0 <= frame < count:
            many = "1 picture" if count == 1 else f"{count} pictures"
            raise InputError(f"{name}: --frame {frame}: it has {many}, from 0")
        source.seek(frame)
        pixels = np.asarray(source.convert("RGBA"))
    return (pixels[..., :3] if (pixels[..., 3] == 255).all() else pixels), count


def inks(data: bytes, name: str) -> Pixels:
    """Reads the inks of a JPEG file in CMYK: uint8 [H, W, 4], 255 being all of an ink.

    Raises:
        InputError: The file is damaged.
        UnsupportedError: Pillow is not installed.
    """
    with _opened(data, name) as source:
        return np.asarray(source.convert("CMYK"))


@contextlib.contextmanager
def _opened(data: bytes, name: str) -> Iterator[Any]:
    """File opened by Pillow, whose errors become `InputError`s."""
    try:
        from PIL import Image
    except ImportError:
        raise UnsupportedError(
            "this file type needs Pillow: pip install 'proxyimg-codec[io]'"
        ) from None
    try:
        with Image.open(io.BytesIO(data)) as source:
            yield source
    except (PxiError, MemoryError):
        raise
    except Exception as error:  # of a damaged file any, such as IndexError
        lines = str(error).splitlines() or [type(error).__name__]
        raise InputError(f"{name}: damaged or truncated ({lines[0]})") from None


def further_pictures(data: bytes) -> list[bytes]:
    """Finds the pictures behind the first one of a JPEG file (CIPA DC-007, MPF)."""
    for marker, body in jpeg_segments(data):
        if marker == 0xE2 and body.startswith(b"MPF\0"):
            return _listed(data, body[4:])
    return []


def _listed(data: bytes, index: bytes) -> list[bytes]:
    """JPEG files that an index of MPF lists after the first."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(index[:4])
    base = data.find(index)
    if order is None:
        return []
    try:
        (start,) = struct.unpack_from(order + "I", index, 4)
        (count,) = struct.unpack_from(order + "H", index, start)
        entries = [
            struct.unpack_from(order + "HHII", index, start + 2 + 12 * k) for k in range(count)
        ]
        _, _, size, place = next(e for e in entries if e[0] == 0xB002)
        rows = [struct.unpack_from(order + "IIIHH", index, place + 16 * k)
                for k in range(1, min(size // 16, 1000))]  # fmt: skip
    except (struct.error, StopIteration):
        return []
    found = [data[base + at : base + at + length] for _, length, at, _, _ in rows if at]
    return [v for v in found if v[:2] == b"\xff\xd8"]
