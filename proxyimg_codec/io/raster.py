"""Reading and writing of ordinary picture files.

PNG, PPM and NPY are written, and NPY is read, with numpy alone. Everything else goes through
OpenImageIO, animations through Pillow, and colours that have to be converted through littlecms.
"""

from __future__ import annotations

import io
import os
import tokenize
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnsupportedError
from . import boxes, color, exif, frames, metadata, oiio, png
from .files import read_bytes, write_atomically
from .samples import standard

Pixels = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Picture:
    """Pixels and metadata of a picture file.

    Attributes:
        pixels: [H, W, 1..4] uint8, uint16 or float32, upright, with straight alpha.
        blocks: Metadata blocks ``icc`` and ``cicp``, which say what colours the pixels are; without
            them they are sRGB. Also ``exif`` and ``xmp``.
        notes: Remarks for the user: what was converted or left out, and which of several pictures
            this is.
    """

    pixels: Pixels
    blocks: Mapping[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read(path: str | os.PathLike[str], *, frame: int | None = None, clip: bool = False) -> Picture:
    """Reads a picture file; ``-`` is standard input. Orientation is applied to the pixels.

    Colours are carried or converted as `color.adopt` says. Samples are scaled as
    `samples.standard` says.

    Args:
        path: The file.
        frame: Number of the picture in a file that holds several, from 0; by default the first, or
            the largest of an icon.
        clip: Whether to clip floating-point samples to 0..1, after they were converted to sRGB.

    Raises:
        InputError: The file is missing, empty, truncated or not a picture, or has no such frame.
        UnsupportedError: The type or its colours need a package that is not installed.
    """
    name = "standard input" if os.fspath(path) == "-" else os.fspath(path)
    return parse(read_bytes(path), name, frame=frame, clip=clip)


def parse(data: bytes, name: str, *, frame: int | None = None, clip: bool = False) -> Picture:
    """Reads a picture file held in memory.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages; its suffix is a hint of the type.
        frame: As `read`.
        clip: As `read`.

    Raises:
        InputError, UnsupportedError: As `read`.
    """
    if not data:
        raise InputError(f"{name}: the file is empty")
    if data[:6] == b"\x93NUMPY":
        if frame:
            raise InputError(f"{name}: --frame {frame}: it has 1 picture, from 0")
        return Picture(_clipped(_read_npy(data, name), clip))
    more = frames.further_pictures(data)
    if frame and more:
        if not 0 < frame <= len(more):
            raise InputError(f"{name}: --frame {frame}: it has {len(more) + 1} pictures, from 0")
        return parse(more[frame - 1], name, frame=0, clip=clip)
    source = _source(data, name, frame)
    told = metadata.raw_blocks(data, source.place)
    colour, is_jpeg = source.colour, data[:2] == b"\xff\xd8"
    # Many cameras say Adobe RGB by this mark alone.
    if is_jpeg and colour == color.Colour() and exif.is_adobe_rgb(told.get("exif", b"")):
        colour = color.ADOBE_RGB
    pixels, blocks, notes = color.adopt(source.pixels, colour)
    notes = [*source.notes, *notes]
    if source.mixed and not source.colour.inks:
        notes.append("converted from CMYK without a profile")
    lost = metadata.left_out(data)
    if source.told and not told and not lost:
        lost = ["metadata in a form that is not read"]
    notes += [f"{', '.join(lost)}: left out"] if lost else []
    count = source.frames + len(more)
    if count > 1 and frame is None:
        notes.insert(0, _which(source.frame, count))
    upright = turned(pixels, _orientation(data, told, source))
    return Picture(_clipped(upright, clip), {**metadata.upright(told), **blocks}, tuple(notes))


def _orientation(data: bytes, told: Mapping[str, bytes], source: oiio.Source) -> int:
    """Orientation of a file by the first that states one: EXIF, XMP, or what its type has."""
    if boxes.is_jpeg_xl(data):
        return 1
    if exif.is_tiff(data):
        return source.orientation
    stated = exif.orientation(told.get("exif", b""))
    return stated or metadata.xmp_orientation(told.get("xmp", b"")) or source.orientation


def stripped(picture: Picture) -> Picture:
    """Returns a picture without metadata, converted to sRGB if its colours are not and can be."""
    if color.is_srgb(picture.blocks):
        return replace(picture, blocks={})
    try:
        pixels: Pixels = color.to_srgb(picture.pixels, picture.blocks)
        note = "converted to sRGB, because what says its colours is stripped"
    except UnsupportedError as error:
        pixels, note = picture.pixels, f"not converted to sRGB: {error}"
    return Picture(pixels, {}, (*picture.notes, note))


def matched(picture: Picture, blocks: Mapping[str, bytes]) -> Picture:
    """Returns a picture in the colours of another one, converted if they differ.

    Args:
        picture: The picture.
        blocks: Metadata blocks of the other one, of which ``icc`` and ``cicp`` count.

    Raises:
        UnsupportedError: The colours cannot be converted.
    """
    if color.same_colours(picture.blocks, blocks):
        return picture
    pixels: Pixels = color.to_colours(picture.pixels, picture.blocks, blocks)
    kept = {k: v for k, v in blocks.items() if k in color.COLOUR}
    notes = (*picture.notes, "converted to the colours of the picture")
    return Picture(pixels, kept, notes)


def _which(frame: int, count: int) -> str:
    return (f"it holds {count} pictures, of which number {frame} is taken, counted from 0; "
            "--frame N takes another")  # fmt: skip


def _clipped(pixels: Pixels, clip: bool) -> Pixels:
    return np.clip(pixels, 0, 1) if clip and pixels.dtype.kind == "f" else pixels


def _source(data: bytes, name: str, frame: int | None) -> oiio.Source:
    """Pixels of a file as stored, with what the file says about them."""
    is_png = data[:8] == png.SIGNATURE
    count = png.frames(data)
    if frames.is_animated(data) and (not is_png or frame):
        pixels, count = frames.read(data, name, frame or 0)
        colour = png.colour(data) if is_png else color.Colour(icc=_webp_profile(data))
        return oiio.Source(pixels, colour, 1, frame or 0, count)
    if is_png:
        if frame is not None and not 0 <= frame < count:
            raise InputError(f"{name}: --frame {frame}: it has 1 picture, from 0")
        oiio.import_oiio()
        found = oiio.read(png.checked(data, name), name)
        return replace(found, colour=png.colour(data), frames=count)
    found = oiio.read(data, name, frame)
    if metadata.is_cut_jpeg(data):
        raise InputError(f"{name}: damaged or truncated (the end of the JPEG data is missing)")
    if data[:2] == b"\xff\xd8" and found.colour.icc[16:20] == b"CMYK":
        colour = replace(found.colour, inks=True)
        return replace(found, pixels=frames.inks(data, name), colour=colour)
    return replace(found, pixels=standard(found.pixels))


def _webp_profile(data: bytes) -> bytes:
    return dict(metadata.riff_chunks(data)).get(b"ICCP", b"")


def _read_npy(data: bytes, name: str) -> Pixels:
    try:
        array: Pixels = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError, SyntaxError, TypeError, tokenize.TokenError):
        raise InputError(f"{name}: not a valid NPY file without pickled objects") from None
    try:
        return standard(array)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def turned(pixels: Pixels, orientation: int) -> Pixels:
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
) -> tuple[str, ...]:
    """Writes a picture file, which is replaced in one step if it exists.

    Args:
        path: Path of the file, whose suffix decides the type; ``-`` is standard output.
        pixels: [H, W, 3] or, with straight alpha, [H, W, 4]; uint8, uint16, or float32 (only for
            NPY and types of OpenImageIO). OpenEXR, Radiance and PFM are written in linear light.
        blocks: What the pixels mean, and metadata: ``icc``, ``cicp``, ``exif`` and ``xmp``. PNG
            holds all of it; JPEG, TIFF, WebP and JPEG XL hold all but ``cicp``, for which they get
            a profile.
        suffix: Type of the file in place of the suffix of `path`, such as ``.png``.

    Returns:
        Remarks for the user: what the type cannot hold.

    Raises:
        InputError: The file cannot be written.
        UsageError: The type cannot hold these pixels.
        UnsupportedError: The type is unknown, or OpenImageIO is missing.
    """
    kind = suffix or Path(path).suffix.lower()
    blocks = metadata.upright(blocks or {})  # the pixels are, whatever these say [MET-6]
    if "exif" in blocks and color.is_srgb(blocks):
        blocks["exif"] = exif.as_srgb(blocks["exif"])
    lost = [*blocks]
    if kind == ".png":
        data, lost = png.encode_png(pixels, blocks), []
    elif kind in (".ppm", ".pnm"):
        data = png.encode_ppm(pixels)
    elif kind == ".npy":
        buffer = io.BytesIO()
        np.save(buffer, pixels, allow_pickle=False)
        data = buffer.getvalue()
    else:
        data, lost = _encode(kind, pixels, blocks)
    write_atomically(path, data)
    return tuple(losses(kind, lost))


def _encode(kind: str, pixels: Pixels, blocks: dict[str, bytes]) -> tuple[bytes, list[str]]:
    """A file of a type of OpenImageIO, and the names of blocks that it does not hold."""
    cicp = blocks.get("cicp")
    holds = {k: v for k, v in blocks.items() if k not in color.COLOUR}
    said = {k: v for k, v in blocks.items() if k in color.COLOUR}
    if cicp is not None and kind not in oiio.LINEAR and "icc" not in said:
        made = color.profile_of(cicp)
        said |= {} if made is None else {"icc": made}
    data, follows = oiio.encode(kind, pixels, said)
    data, lost = metadata.embed(data, holds)
    return data, lost if follows else [*lost, "icc"]


def losses(kind: str, lost: Sequence[str]) -> list[str]:
    """Remarks for the user on blocks that a type does not hold.

    Args:
        kind: Suffix of the type.
        lost: Names of the blocks.
    """
    notes = []
    told = [name.upper() for name in ("exif", "xmp") if name in lost]
    if told:
        notes.append(f"{kind} does not take this {' and '.join(told)}; left out")
    if "icc" in lost or "cicp" in lost:
        notes.append(f"{kind} cannot say what colours these are, so that they look wrong; write "
                     "PNG, or sRGB (pxi-decode --srgb)")  # fmt: skip
    return notes
