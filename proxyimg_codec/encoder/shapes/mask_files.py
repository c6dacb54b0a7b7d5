"""Files of masks: a folder with one a layer, or one picture of labels."""

from __future__ import annotations

import io
import logging
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from ...errors import InputError
from ...io.names import is_picture
from .labels import label_regions
from .mask_arrays import inside, warn_of_cut
from .masks import BACK_NAMES, NAME_MAX, Region, check_count, check_size

TYPES = (
    ".bmp", ".gif", ".jfif", ".jp2", ".jpeg", ".jpg", ".npy", ".pbm", ".pgm", ".png", ".pnm",
    ".ppm", ".tga", ".tif", ".tiff", ".webp",
)  # fmt: skip
"""Suffixes of the files of a mask folder that are masks."""

_PALETTES = ("P", "PA")
_COLOUR = ("RGB", "RGBA")
_BITS = 258
"""Tag of TIFF: bits a sample."""


class _File(NamedTuple):
    """Content of a mask file.

    Attributes:
        content: Picture, upright, or array of an NPY file.
        kind: Type of the picture in Pillow's words.
        bits: Bits a sample.
        pictures: Number of pictures in the file.
    """

    content: Image.Image | NDArray[Any]
    kind: str = ""
    bits: int = 8
    pictures: int = 1


def load_masks(path: str | Path, width: int, height: int) -> list[Region]:
    """Reads the masks that a user made for a picture.

    A folder holds the mask of one layer in each picture file; files whose names begin with a dot,
    and what is no picture, are passed over. The natural order of the file names is back to front,
    with `back` or `background` first. A region has the name of its file without a number in front:
    `2 cat.png` is `cat`. A folder within holds parts, in front of the mask that has its name:
    `cat/eye.png` is `cat/eye`, which follows `cat`; without `cat.png`, `cat` is a group. Links to
    folders are not followed. Inside is where alpha is at least one half if the file has
    transparency; otherwise what is not index 0 of a palette with colours; otherwise what is at
    least half as light as white, or not 0 in files with only 0 and another value. Masks with more
    values also have alpha; that those whose rims are only antialiased are cut is logged.

    A single file holds labels: 0 for the back layer, then 1, 2, ... for objects back to front. The
    index of a palette is the label, whatever its colours; otherwise a grey value is its label, of 8
    or 16 bits; otherwise colours are labelled in the order of their packed values 0xRRGGBB, black
    being the back. What is clear is the back. An NPY file holds whole numbers [H, W].

    Args:
        path: Folder of masks, or file of labels.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.

    Returns:
        Regions back to front. They may overlap and need not cover the picture: `masks.resolve`.

    Raises:
        InputError: There is no mask, or there are too many; a file cannot be read, has the wrong
            size or several pictures; a mask is faint, or labels are smoothed, too many, or half
            transparent.
    """
    path = Path(path)
    if not path.is_dir():
        file = _read(path, width, height)
        return label_regions(_labels(file, str(path)), str(path))
    regions = list[Region]()
    files = _mask_files(path)
    if not files:
        raise InputError(f"{path}: the mask folder holds no picture; put one mask a layer in it")
    check_count(len(files), f"masks in {path}")
    for name, place in files:
        regions.append(Region(name, *_region(place, width, height)))
    warn_of_cut({str(f): r.alpha for (_, f), r in zip(files, regions, strict=True)})
    return regions


def load_mask(path: str | Path, width: int, height: int) -> NDArray[np.bool_]:
    """Reads one mask, as `load_masks` does those of a folder.

    Args:
        path: Picture file or NPY file.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.

    Returns:
        bool [height, width], True inside.

    Raises:
        InputError: The file cannot be read, has the wrong size or several pictures, or is faint.
    """
    mask, alpha = _region(Path(path), width, height)
    if alpha is not None:
        logging.getLogger(__name__).warning("soft masks are cut at one half: %s", path)
    return mask


def _region(
    file: Path, width: int, height: int
) -> tuple[NDArray[np.bool_], NDArray[np.float32] | None]:
    """Inside of the mask in a file, bool [height, width], and alpha, if it has other values."""
    content = _read(file, width, height).content
    values = content if isinstance(content, np.ndarray) else _mask(content)
    return inside(values, f"{file}: the mask")


def _mask_files(folder: Path, above: str = "") -> list[tuple[str, Path]]:
    """Names of regions and their picture files, back to front, of a folder and those within.

    Args:
        folder: The folder.
        above: Beginning of the names: "cat/" for the parts of a cat.

    Raises:
        InputError: A folder cannot be read, or lies too deep.
    """
    if len(above) > NAME_MAX:
        raise InputError(f"{folder}: the folder lies too deep; names have 1..{NAME_MAX} characters")
    try:
        seen = sorted(f for f in folder.iterdir() if not f.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from None
    files = [f for f in seen if f.suffix.lower() in TYPES and not f.is_dir()]
    found = [(stack_order(f), 0, [(above + region_name(f), f)]) for f in files]
    wholes = {region_name(f): f for f in reversed(files)}
    for other in (f for f in seen if f not in files):
        parts = []
        if other.is_dir() and not other.is_symlink():
            parts = _mask_files(other, f"{above}{region_name(other)}/")
        if parts:
            found.append((stack_order(wholes.get(region_name(other), other)), 1, parts))
        elif other.is_dir() or is_picture(other):
            kind = "a folder without masks" if other.is_dir() else "no type of masks"
            logging.getLogger(__name__).warning("%s: %s; it is left out", other, kind)
    return [each for _, _, some in sorted(found, key=lambda v: v[:2]) for each in some]


def _stem(file: Path) -> str:
    return file.name if file.is_dir() else file.stem


def stack_order(file: Path) -> tuple[bool, list[tuple[int, str]], str]:
    """Sort key for natural order: `object 2` before `object 10`, the background before all."""
    stem = _stem(file).lower()
    natural = [(int(p), "") if p.isdecimal() else (-1, p) for p in re.findall(r"\d+|\D+", stem)]
    return stem not in BACK_NAMES, natural, file.name


def region_name(file: Path) -> str:
    """Name of the region of a mask or folder."""
    return name_of_stem(_stem(file))


def name_of_stem(stem: str) -> str:
    """Name of a region: a stem without the number in front, not too long."""
    stem = "".join(c if c.isprintable() else "?" for c in stem)
    return re.sub(r"^\d+[ ._-]+(?=.)", "", stem)[:NAME_MAX]


def _read(path: Path, width: int, height: int) -> _File:
    """Reads a picture file upright, with the indices of palettes, or an NPY file.

    Raises:
        InputError: It cannot be read, has another size, or holds several pictures.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the mask ({error.strerror}); check it") from None
    try:
        file = _opened(data, (width, height))
    except MemoryError:
        raise
    except UnidentifiedImageError:
        raise InputError(f"{path}: the mask is no valid picture; save it as PNG") from None
    except Exception as error:
        # Pillow's readers raise errors of any class.
        raise InputError(
            f"{path}: the mask is no valid picture ({error}); save it as PNG"
        ) from None
    if isinstance(file.content, np.ndarray):
        if file.content.ndim != 2:
            raise InputError(f"{path}: an array of shape {file.content.shape} is no mask [H, W]")
        blank = file.content
    else:
        blank = np.broadcast_to(np.False_, file.content.size[::-1])
    check_size(f"{path}: the mask", blank, width, height)
    if file.pictures > 1:
        raise InputError(f"{path}: holds {file.pictures} pictures; a mask is one, save it alone")
    return file


def _opened(data: bytes, size: tuple[int, int]) -> _File:
    """Decodes a file in memory; a picture only if it may have `size`, turned or not."""
    if data[:6] == b"\x93NUMPY":
        return _File(np.load(io.BytesIO(data), allow_pickle=False))
    picture = Image.open(io.BytesIO(data))
    if sorted(picture.size) != sorted(size):
        return _File(picture)
    kind, pictures = picture.format, getattr(picture, "n_frames", 1)
    picture.load()
    bits = data[24] if kind == "PNG" else getattr(picture, "tag_v2", {}).get(_BITS, 8)
    # TIFF has a number of bits for each channel.
    bits = int(np.max(bits))
    return _File(ImageOps.exif_transpose(picture), kind or "", bits, pictures)


def _mask(picture: Image.Image) -> NDArray[Any]:
    """Values of a mask [H, W], of which half of the range or more are inside."""
    if picture.has_transparency_data:
        alpha = np.asarray(picture.convert("RGBA"))[..., 3]
        if alpha.min() < 255:
            return alpha
    if picture.mode in _PALETTES:
        colours = np.asarray(picture.convert("RGB"))
        if (colours != colours[..., :1]).any():
            return _channels(picture)[..., 0] > 0
    if picture.mode == "1" or picture.mode.startswith(("L", "I", "F")):
        return _channels(picture)[..., 0]
    return np.asarray(picture.convert("RGB").convert("L"))


def _labels(file: _File, where: str) -> NDArray[Any]:
    """Labels [H, W], or colours [H, W, 3], of a label picture.

    Raises:
        InputError: The type of the file, its bits or its alpha let no labels through.
    """
    picture = file.content
    if isinstance(picture, np.ndarray):
        if picture.dtype.kind not in "iub":
            raise InputError(f"{where}: labels are whole numbers, not {picture.dtype}")
        return picture
    if file.kind == "JPEG":
        raise InputError(f"{where}: JPEG blurs the edges of labels; save the label picture as PNG")
    grey = picture.mode == "1" or picture.mode.startswith(("L", "I", "F"))
    if not grey and picture.mode not in (*_PALETTES, *_COLOUR):
        raise InputError(f"{where}: labels cannot be {picture.mode}; save them as greys or RGB")
    if picture.mode in _COLOUR and file.bits > 8:
        raise InputError(f"{where}: colours of {file.bits} bits a channel; save 8 bits, or greys")
    image = _channels(picture)
    if picture.mode in _PALETTES:
        return image[..., 0]
    image = image[..., : 1 if grey else 3]
    if grey and file.bits in (2, 4):
        image = image // (255 // (2**file.bits - 1))  # readers of pictures scale them to 8 bits
    if image.dtype.kind == "f":
        if not (image == np.rint(image)).all():
            raise InputError(f"{where}: labels are whole numbers; save greys of 8 or 16 bits")
        image = image.astype(np.int64)
    if picture.has_transparency_data:
        alpha = np.asarray(picture.convert("RGBA"))[..., 3]
        if ((alpha > 0) & (alpha < 255)).any():
            raise InputError(
                f"{where}: the label picture is half transparent in places; what is clear is the "
                "back, all else must be opaque"
            )
        image = np.where(alpha[..., None] > 0, image, 0)
    return image[..., 0] if grey else image


def _channels(picture: Image.Image) -> NDArray[Any]:
    """Samples [H, W, C] as they are stored; those of one bit are 0 and 1."""
    values = np.asarray(picture)
    values = values.astype(np.uint8) if values.dtype.kind == "b" else values
    return values.reshape(*values.shape[:2], -1)
