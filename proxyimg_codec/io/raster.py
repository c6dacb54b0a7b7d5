"""Reading and writing of ordinary picture files.

PNG, PPM and NPY are written, and NPY is read, with numpy alone. Everything else goes through
OpenImageIO.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import tempfile
import tokenize
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnsupportedError, UsageError
from .files import read_bytes, write_atomically
from .metadata import is_cut_jpeg, png_chunks, raw_blocks, upright

Pixels = NDArray[Any]

_PREMULTIPLIED = ("iff", "openexr", "rla")
"""OpenImageIO types with alpha premultiplied by convention, which OpenImageIO does not convert."""

_NO_FILES = ("null", "term")
"""OpenImageIO types that do not stand for files."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Pixels and metadata of a picture file.

    Attributes:
        pixels: [H, W, 1..4] uint8, uint16 or float32, upright, with straight alpha; of an NPY file
            the array as it is, also [H, W] or of another type.
        blocks: Metadata blocks ``icc``, ``exif``, ``xmp``.
    """

    pixels: Pixels
    blocks: Mapping[str, bytes] = field(default_factory=dict)


def read(path: str | os.PathLike[str]) -> Picture:
    """Reads a picture file; ``-`` is standard input. EXIF orientation is applied to the pixels.

    Raises:
        InputError: The file is missing, empty, truncated or not a picture.
        UnsupportedError: The type needs OpenImageIO, which is not installed.
    """
    name = "standard input" if os.fspath(path) == "-" else os.fspath(path)
    return parse(read_bytes(path), name)


def parse(data: bytes, name: str) -> Picture:
    """Reads a picture file held in memory.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages; its suffix is a hint of the type.

    Raises:
        InputError, UnsupportedError: As `read`.
    """
    if not data:
        raise InputError(f"{name}: the file is empty")
    if data[:6] == b"\x93NUMPY":
        return Picture(_read_npy(data, name))
    pixels, icc, orientation = _read_oiio(data, name)
    blocks = raw_blocks(data)
    # Output is RGB: the profile of a grey or CMYK original would not describe it.
    if icc[16:20] == b"RGB ":
        blocks["icc"] = icc
    return Picture(_turn(pixels, orientation), upright(blocks))


def _read_npy(data: bytes, name: str) -> Pixels:
    try:
        array: Pixels = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError, SyntaxError, TypeError, tokenize.TokenError):
        raise InputError(f"{name}: not a valid NPY file without pickled objects") from None
    if array.ndim not in (2, 3) or array.size == 0:
        raise InputError(f"{name}: an array of shape {array.shape} is not a picture")
    native: Pixels = array.astype(array.dtype.newbyteorder("="))
    return native


def _import_oiio() -> Any:
    try:
        import OpenImageIO
    except ImportError:
        raise UnsupportedError(
            "this file type needs OpenImageIO: pip install 'proxyimg-codec[io]'"
        ) from None
    return OpenImageIO


def _read_oiio(data: bytes, name: str) -> tuple[Pixels, bytes, int]:
    """Reads the pixels as stored, the ICC profile and the EXIF orientation of a file in memory."""
    oiio = _import_oiio()
    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)
    # OpenImageIO finds the reader of a type by trying. All readers work on files, but not all on
    # memory.
    hint = Path(name).suffix if name.isascii() else ""
    with tempfile.NamedTemporaryFile(suffix=hint) as file, _silent_stderr():
        file.write(data)
        file.flush()
        source = oiio.ImageInput.open(file.name, wanted)
        if source is None or source.format_name() in _NO_FILES:
            oiio.geterror()
            raise InputError(f"{name}: not a picture in a known format")
        spec = source.spec()
        kinds = {"uint8": "uint8", "uint16": "uint16", "half": "float", "float": "float"}
        kind = kinds.get(str(spec.format), "uint16" if "int" in str(spec.format) else "float")
        pixels = source.read_image(kind)
        problem = source.geterror()
        source.close()
    if pixels is None:
        problem = (problem or "unknown reason").splitlines()[0]
        raise InputError(f"{name}: damaged or truncated ({problem})")
    if is_cut_jpeg(data):
        raise InputError(f"{name}: damaged or truncated (the end of the JPEG data is missing)")
    pixels = np.asarray(pixels)
    if pixels.ndim != 3 or pixels.size == 0:
        raise InputError(f"{name}: not a two-dimensional picture")
    colours = 3 if spec.nchannels > 2 else 1
    alpha = "A" in spec.channelnames[colours : colours + 1]
    pixels = pixels[..., : colours + alpha]
    # A TIFF file without this attribute says that its alpha is premultiplied.
    straight = spec.get_int_attribute("oiio:UnassociatedAlpha")
    if alpha and not straight and source.format_name() in (*_PREMULTIPLIED, "tiff"):
        pixels = _straight(pixels)
    icc = spec.getattribute("ICCProfile")
    return pixels, b"" if icc is None else bytes(icc), spec.get_int_attribute("Orientation", 1)


@contextlib.contextmanager
def _silent_stderr() -> Iterator[None]:
    """Silences stderr of the process: image libraries print there what `geterror` says anyway."""
    try:
        saved = os.dup(2)
    except OSError:
        yield
        return
    with open(os.devnull, "wb") as null:
        os.dup2(null.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


def _straight(pixels: Pixels) -> Pixels:
    """Converts premultiplied to straight alpha."""
    top = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    alpha = np.maximum(pixels[..., -1:].astype(np.float64) / top, 1e-12)
    colour = np.minimum(pixels[..., :-1] / alpha, top)
    if pixels.dtype.kind != "f":
        colour = np.rint(colour)
    return np.concatenate([colour.astype(pixels.dtype), pixels[..., -1:]], axis=2)


def _turn(pixels: Pixels, orientation: int) -> Pixels:
    """Applies an EXIF orientation (1..8; others count as 1)."""
    if orientation in (5, 6, 7, 8):
        pixels = pixels.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return np.ascontiguousarray(pixels)


def write(
    path: str | os.PathLike[str],
    pixels: Pixels,
    blocks: Mapping[str, bytes] | None = None,
    suffix: str | None = None,
) -> None:
    """Writes a picture file, which is replaced in one step if it exists.

    Args:
        path: Path of the file, whose suffix decides the type; ``-`` is standard output.
        pixels: [H, W, 3] or, with straight alpha, [H, W, 4]; uint8, uint16, or float32 (only for
            NPY and types of OpenImageIO).
        blocks: Metadata to carry: all of it in PNG, the ICC profile in types of OpenImageIO.
        suffix: Type of the file in place of the suffix of `path`, such as ``.png``.

    Raises:
        InputError: The file cannot be written.
        UsageError: The type cannot hold these pixels.
        UnsupportedError: The type is unknown, or OpenImageIO is missing.
    """
    kind = suffix or Path(path).suffix.lower()
    if kind == ".png":
        data = encode_png(pixels, dict(blocks or {}))
    elif kind in (".ppm", ".pnm"):
        data = encode_ppm(pixels)
    elif kind == ".npy":
        buffer = io.BytesIO()
        np.save(buffer, pixels, allow_pickle=False)
        data = buffer.getvalue()
    else:
        data = _encode_oiio(kind, pixels, dict(blocks or {}))
    write_atomically(path, data)


def encode_png(pixels: Pixels, blocks: dict[str, bytes] | None = None) -> bytes:
    """Encodes pixels as a PNG file.

    Args:
        pixels: uint8 or uint16 [H, W, 3] or, with straight alpha, [H, W, 4].
        blocks: Metadata blocks ``icc``, ``exif``, ``xmp`` to carry.

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
    chunks = [
        (b"IHDR", header),
        *png_chunks(blocks or {}),
        (b"IDAT", zlib.compress(filtered.tobytes(), 6)),
        (b"IEND", b""),
    ]
    out = [b"\x89PNG\r\n\x1a\n"]
    for type_, body in chunks:
        crc = struct.pack(">I", zlib.crc32(type_ + body))
        out += [struct.pack(">I", len(body)), type_, body, crc]
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


def _encode_oiio(kind: str, pixels: Pixels, blocks: dict[str, bytes]) -> bytes:
    oiio = _import_oiio()
    if not kind:
        raise UsageError("the output has no suffix; name it .png, .jpg, .tif or the like")
    if not kind.isascii():  # OpenImageIO takes no names that are not UTF-8
        raise UnsupportedError(f"files of type {kind} cannot be written")
    with tempfile.TemporaryDirectory() as folder, _silent_stderr():
        name = str(Path(folder) / f"picture{kind}")
        target = oiio.ImageOutput.create(name)
        if target is None or target.format_name() in _NO_FILES:
            oiio.geterror()
            raise UnsupportedError(f"files of type {kind} cannot be written")
        height, width, channels = pixels.shape
        if channels == 4 and not target.supports("alpha"):
            raise UsageError(f"{kind} cannot hold transparency; write PNG instead")
        formats = {"uint8": "uint8", "uint16": "uint16", "float32": "float"}
        spec = oiio.ImageSpec(width, height, channels, formats[str(pixels.dtype)])
        spec.attribute("oiio:UnassociatedAlpha", 1)
        if "icc" in blocks:
            profile = np.frombuffer(blocks["icc"], np.uint8)
            spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), profile)
        if channels == 4 and target.format_name() in _PREMULTIPLIED:
            pixels = _associated(pixels)
        good = target.open(name, spec)
        if good and _loses_bits(formats[str(pixels.dtype)], str(target.spec().format)):
            raise UsageError(f"{kind} holds fewer bits a sample than asked for; write PNG or TIFF")
        good = good and target.write_image(np.ascontiguousarray(pixels)) and target.close()
        # Some writers report success and leave a truncated file.
        if not good or oiio.ImageInput.open(name) is None:
            problem = f"{target.geterror()}\n{oiio.geterror()}".strip() or "unknown reason"
            problem = problem.splitlines()[0]
            raise UnsupportedError(f"{kind} cannot hold this picture: {problem}")
        return Path(name).read_bytes()


def _loses_bits(wanted: str, got: str) -> bool:
    return got == "uint8" != wanted or (wanted == "float" and got != "float")


def _associated(pixels: Pixels) -> Pixels:
    """Converts straight to premultiplied alpha."""
    top = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    colour = pixels[..., :-1] * (pixels[..., -1:] / top)
    if pixels.dtype.kind != "f":
        colour = np.rint(colour)
    return np.concatenate([colour.astype(pixels.dtype), pixels[..., -1:]], axis=2)
