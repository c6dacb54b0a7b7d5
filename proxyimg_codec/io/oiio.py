"""Reading and writing of picture files through OpenImageIO.

Nothing here is shared by threads: OpenImageIO keeps an error message for each thread, and files are
given to it under temporary names.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, UnsupportedError, UsageError
from .color import COLOUR, SRGB, Colour, is_srgb, to_linear

Pixels = NDArray[Any]

_PREMULTIPLIED = ("iff", "openexr", "rla")
"""Types with alpha premultiplied by convention, which OpenImageIO does not convert."""

_NO_FILES = ("null", "term")
"""Types that do not stand for files."""

LINEAR = (".exr", ".hdr", ".rgbe", ".pfm")
"""Suffixes of output files that hold linear light."""

_SRGB_NAMES = ("", "unknown", "Rec709", "data", "raw", "srgb_rec709_scene", "srgb_rec709_display")
"""Names of colour spaces that are sRGB, or say nothing. OpenImageIO calls all PNM files Rec709."""

_INKS = ("CMYK", "YCCK", "YCbCrK", "color separated")
"""Names of colour spaces of inks."""

_KINDS = {"uint8": "uint8", "uint16": "uint16", "uint32": "uint", "uint": "uint", "half": "float",
          "float": "float", "double": "float"}  # fmt: skip
"""Types of samples that are read, and as what."""


@dataclass(frozen=True)
class Source:
    """One picture of a file as OpenImageIO reads it.

    Attributes:
        pixels: [H, W, 1..4] uint8, uint16, uint32 or float32, with straight alpha, not turned.
        colour: What the file says about the numbers.
        orientation: Orientation that the reader found, 1..8.
        frame: Number of the picture in the file, from 0.
        frames: Number of pictures in the file that can be chosen.
        place: Number of the subimage of OpenImageIO.
        told: Whether the reader found EXIF, IPTC or XMP, wherever it was.
        mixed: Whether the file has inks, and the reader has made RGB of them.
        notes: Remarks on what the file has beside the pixels, and is left out.
    """

    pixels: Pixels
    colour: Colour
    orientation: int
    frame: int
    frames: int
    place: int = 0
    told: bool = False
    mixed: bool = False
    notes: tuple[str, ...] = ()


def import_oiio() -> Any:
    """Returns the module OpenImageIO; raises `UnsupportedError` if it is not installed."""
    try:
        import OpenImageIO
    except ImportError:
        raise UnsupportedError(
            "this file type needs OpenImageIO: pip install 'proxyimg-codec[io]'"
        ) from None
    return OpenImageIO


def _error(*sources: Any) -> str:
    """First line of what OpenImageIO says went wrong; empty if it says nothing."""
    lines: list[str] = []
    for source in sources:
        try:
            lines += source.geterror().split("\n")
        except UnicodeDecodeError:  # it quotes the file
            lines.append("its content makes no sense")
    return next((line.strip() for line in lines if line.strip()), "")


def read(data: bytes, name: str, frame: int | None = None) -> Source:
    """Reads a picture file held in memory.

    Args:
        data: Bytes of the file.
        name: Name of the file in error messages; its suffix is a hint of the type.
        frame: Number of the picture in the file, from 0; by default the largest of an icon, and
            otherwise the first that is no thumbnail.

    Raises:
        InputError: The file is truncated, not a picture, or has no such frame.
        UnsupportedError: OpenImageIO is not installed, or the colour space is not known.
    """
    oiio = import_oiio()
    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)
    # OpenImageIO finds the reader of a type by trying. All readers work on files, but not all on
    # memory.
    hint = Path(name).suffix if name.isascii() and name.isprintable() else ""
    with tempfile.NamedTemporaryFile(suffix=hint[:16]) as file:
        file.write(data)
        file.flush()
        source = oiio.ImageInput.open(file.name, wanted)
        if source is None or source.format_name() in _NO_FILES:
            _error(oiio)
            raise InputError(f"{name}: not a picture in a known format")
        if _is_foreign(source.spec()) and source.format_name() == "tiff":
            source.close()
            wanted.attribute("oiio:RawColor", 1)
            source = oiio.ImageInput.open(file.name, wanted)
        try:
            return _read(source, name, frame)
        finally:
            source.close()


def _is_foreign(spec: Any) -> bool:
    """Whether a file has colours that are converted here: inks with a profile, and L*a*b*."""
    return _icc(spec)[16:20] == b"CMYK" or _space(spec).endswith("LAB")


def _space(spec: Any) -> str:
    """Name of the colours of the pixels of a TIFF file."""
    return str(spec.getattribute("tiff:ColorSpace") or "")


def _icc(spec: Any) -> bytes:
    icc = spec.getattribute("ICCProfile")
    return b"" if icc is None else bytes(icc)


def _frames(source: Any) -> list[int]:
    """Subimages of a file that are pictures of their own: no thumbnails, masks or layers."""
    if source.format_name() == "psd":  # the picture, and then its layers
        return [0]
    found, number = [], 0
    while source.seek_subimage(number, 0):
        # Bits of NewSubfileType (TIFF 6.0): 1 a reduced version, 4 a mask.
        if not source.spec().get_int_attribute("tiff:subfiletype") & 5:
            found.append(number)
        number += 1
    _error(source)
    return found or [*range(number)]


def _read(source: Any, name: str, frame: int | None) -> Source:
    """`read` of an open file."""
    numbers = _frames(source)
    if frame is None:
        frame = 0
        if source.format_name() == "ico":
            frame = max(range(len(numbers)), key=lambda k: (_area(source, numbers[k]), -k))
    if not 0 <= frame < len(numbers):
        raise InputError(f"{name}: --frame {frame}: it has {_count(len(numbers))}, from 0")
    source.seek_subimage(numbers[frame], 0)
    spec = source.spec()
    kind = _KINDS.get(str(spec.format))
    if kind is None:
        raise UnsupportedError(
            f"{name}: samples of type {spec.format} have a sign, so that their white is not known"
        )
    pixels = source.read_image(numbers[frame], 0, 0, spec.nchannels, kind)
    problem = _error(source)
    if pixels is None:
        raise InputError(f"{name}: damaged or truncated ({problem or 'unknown reason'})")
    pixels = np.asarray(pixels)
    if pixels.ndim != 3 or pixels.size == 0:
        raise InputError(f"{name}: not a two-dimensional picture")
    type_ = source.format_name()
    told = any(a.name.startswith(("Exif:", "GPS:", "IPTC:", "xmp:")) for a in spec.extra_attribs)
    spaces = (spec.getattribute(f"{kind}:ColorSpace") for kind in ("jpeg", "tiff", "oiio", "psd"))
    inks = any(str(space) in _INKS for space in spaces)
    mixed = inks and "".join(spec.channelnames[:4]) != "CMYK"
    return Source(
        _channels(pixels, spec, type_),
        _colour(spec, type_, pixels.dtype.kind == "f", name),
        spec.get_int_attribute("Orientation", 1), frame, len(numbers), numbers[frame], told,
        mixed, tuple(_remarks(spec, type_)),
    )  # fmt: skip


def _remarks(spec: Any, type_: str) -> list[str]:
    """Remarks on channels and on a window that the pixels will not tell."""
    notes = []
    names = spec.channelnames[_used(spec, type_) :]
    if names:
        more = ", ..." if len(names) > 8 else ""
        notes.append(f"channels left out: {', '.join(names[:8])}{more}")
    data = spec.width, spec.height, spec.x, spec.y
    whole = spec.full_width, spec.full_height, spec.full_x, spec.full_y
    if type_ == "openexr" and data != whole:
        notes.append("its data window, {}x{} at {},{}, is taken; its display window is {}x{} at "
                     "{},{}".format(*data, *whole))  # fmt: skip
    return notes


def _used(spec: Any, type_: str) -> int:
    """Number of the first channels of a picture that are colour, inks or alpha."""
    if "".join(spec.channelnames[:4]) == "CMYK":
        return 4
    if type_ == "jpegxl" and spec.nchannels == 2:  # grey and alpha, which it calls R and G
        return 2
    colours = 3 if spec.nchannels > 2 else 1
    return colours + ("A" in spec.channelnames[colours : colours + 1])


def _count(number: int) -> str:
    return "1 picture" if number == 1 else f"{number} pictures"


def _area(source: Any, number: int) -> int:
    source.seek_subimage(number, 0)
    return int(source.spec().width * source.spec().height)


def _channels(pixels: Pixels, spec: Any, type_: str) -> Pixels:
    """Channels of a picture that are colour or alpha, with straight alpha."""
    used = _used(spec, type_)
    if "".join(spec.channelnames[:4]) == "CMYK":
        return pixels[..., :used]
    # OpenImageIO turns round only those of 8 bits and less.
    if spec.getattribute("tiff:PhotometricInterpretation") == 0 and pixels.dtype != np.uint8:
        white = 1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
        turned = (white - pixels[..., :1]).astype(pixels.dtype)
        pixels = np.concatenate([turned, pixels[..., 1:]], axis=2)
    pixels = pixels[..., :used]
    # A TIFF file without this attribute says that its alpha is premultiplied.
    straight = spec.get_int_attribute("oiio:UnassociatedAlpha")
    if used in (2, 4) and not straight and type_ in (*_PREMULTIPLIED, "tiff"):
        pixels = _straight(pixels)
    return pixels


def _colour(spec: Any, type_: str, floating: bool, name: str) -> Colour:
    """Statement of a file about the meaning of its numbers."""
    icc, cicp = _icc(spec), spec.getattribute("CICP")
    if cicp is not None:
        # Whatever they were in the file: the reader gives RGB, over the full range.
        primaries, transfer = tuple(cicp)[:2]
        # Grey JPEG XL has no primaries.
        return Colour((int(primaries) or 1, int(transfer), 0, 1), icc)
    if icc and not _space(spec).endswith("LAB"):
        return Colour(icc=icc, inks="".join(spec.channelnames[:4]) == "CMYK")
    space = str(spec.getattribute("oiio:ColorSpace") or "")
    if _space(spec) == "CIELAB" and spec.nchannels == 3 and not floating:
        return Colour(lab=True)
    silent = type_ == "openexr" and space == ""
    if silent or type_ == "hdr" or (type_ == "pnm" and floating):
        space = "lin_rec709_scene"
    chromaticities = spec.getattribute("chromaticities")
    if chromaticities is not None:
        chromaticities = tuple(float(v) for v in chromaticities)
    if space == "lin_rec709_scene":
        return Colour(gamma=1.0, chromaticities=chromaticities or SRGB)
    if space in _SRGB_NAMES or "CMYK" in space or space == "color separated":
        return Colour()
    return _named(space, name)


def _named(space: str, name: str) -> Colour:
    """Colour space that OpenColorIO knows under a name."""
    config = import_oiio().ColorConfig()
    chromaticities, gamma = config.get_chromaticities(space), 0.0
    if chromaticities:
        cicp = config.get_cicp(space)
        gamma = config.get_transfer_function_gamma(space)
        if cicp and not config.isColorSpaceLinear(space):
            return Colour((cicp[0], cicp[1], 0, 1))
    if not chromaticities or not gamma:
        raise UnsupportedError(
            f"{name}: the colour space {space} is not known; convert the picture to sRGB first"
        )
    return Colour(gamma=float(gamma), chromaticities=tuple(map(float, chromaticities)))


def _straight(pixels: Pixels) -> Pixels:
    """Converts premultiplied to straight alpha."""
    whole = pixels.dtype.kind != "f"
    top = float(np.iinfo(pixels.dtype).max) if whole else 1.0
    alpha = pixels[..., -1:].astype(np.float64) / top
    colour = pixels[..., :-1] / np.where(alpha > 0, alpha, 1)
    if whole:
        colour = np.rint(np.minimum(colour, top))
    return np.concatenate([colour.astype(pixels.dtype), pixels[..., -1:]], axis=2)


def encode(kind: str, pixels: Pixels, blocks: Mapping[str, bytes]) -> tuple[bytes, bool]:
    """Encodes pixels as a file of a type that OpenImageIO writes.

    Args:
        kind: Suffix of the type, with the dot.
        pixels: As `raster.write` takes them; types of linear light are converted.
        blocks: Metadata blocks, of which ``icc`` and ``cicp`` are written where the type has them.

    Returns:
        The file, and whether it says or follows what these say.

    Raises:
        UsageError: The type cannot hold these pixels.
        UnsupportedError: The type is unknown, or OpenImageIO is missing.
    """
    oiio = import_oiio()
    if not kind.isascii():  # OpenImageIO takes no names that are not UTF-8
        raise UnsupportedError(f"files of type {kind} cannot be written")
    if not kind:
        raise UsageError("the output has no suffix; name it .png, .jpg, .tif or the like")
    with tempfile.TemporaryDirectory() as folder:
        name = str(Path(folder) / f"picture{kind}")
        target = oiio.ImageOutput.create(name)
        if target is None or target.format_name() in _NO_FILES:
            _error(oiio)
            raise UnsupportedError(f"files of type {kind} cannot be written")
        height, width, channels = pixels.shape
        if channels == 4 and not target.supports("alpha"):
            raise UsageError(f"{kind} cannot hold transparency; write PNG instead")
        form = {"uint8": "uint8", "uint16": "uint16", "float32": "float"}[str(pixels.dtype)]
        if kind in LINEAR:
            pixels, form = to_linear(pixels, blocks), "float" if form == "float" else "half"
            blocks = {k: v for k, v in blocks.items() if k not in COLOUR}
        spec = oiio.ImageSpec(width, height, channels, form)
        spec.attribute("oiio:UnassociatedAlpha", 1)
        if target.format_name() == "tiff":  # which would get the time of day
            spec.attribute("DateTime", "2000:01:01 00:00:00")
        if "icc" in blocks:
            profile = np.frombuffer(blocks["icc"], np.uint8)
            spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), profile)
        if "cicp" in blocks:
            spec.attribute("CICP", oiio.TypeDesc("int[4]"), tuple(blocks["cicp"]))
        if channels == 4 and target.format_name() in _PREMULTIPLIED:
            pixels = _associated(pixels)
        good = target.open(name, spec)
        if good and _loses_bits(form, str(target.spec().format)):
            raise UsageError(f"{kind} holds fewer bits a sample than asked for; write PNG or TIFF")
        good = good and target.write_image(np.ascontiguousarray(pixels)) and target.close()
        # Some writers report success and leave a truncated file.
        back = oiio.ImageInput.open(name) if good else None
        if back is None:
            problem = _error(target, oiio) or "unknown reason"
            raise UnsupportedError(f"{kind} cannot hold this picture: {problem}")
        follows = is_srgb(blocks) or _says(back.spec(), blocks)
        back.close()
        return Path(name).read_bytes(), follows


def _says(spec: Any, blocks: Mapping[str, bytes]) -> bool:
    """Whether a file that was written says the colour that the blocks say."""
    cicp = spec.getattribute("CICP")
    if "cicp" in blocks and cicp is not None:
        return bytes(tuple(cicp)[:2]) == blocks["cicp"][:2]
    return "icc" in blocks and _icc(spec) == blocks["icc"]


def _loses_bits(wanted: str, got: str) -> bool:
    return got == "uint8" != wanted or (wanted == "float" and got != "float")


def _associated(pixels: Pixels) -> Pixels:
    """Converts straight to premultiplied alpha."""
    top = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    colour = pixels[..., :-1] * (pixels[..., -1:] / top)
    if pixels.dtype.kind != "f":
        colour = np.rint(colour)
    return np.concatenate([colour.astype(pixels.dtype), pixels[..., -1:]], axis=2)
