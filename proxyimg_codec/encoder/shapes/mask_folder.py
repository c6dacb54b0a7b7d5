"""Writing of mask folders, as `mask_files.load_masks` reads them."""

from __future__ import annotations

import io
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from ...errors import InputError
from ...io.files import temporary_name, write_atomically
from .mask_files import TYPES, name_of_stem
from .masks import Region

_OWN = re.compile(r"(\d+ [^/]+/)*\d+ [^/]+\.png")
"""Names, within the folder, of files that `write_masks` makes."""

_OWN_FOLDER = re.compile(r"\d+ .+")
"""Names of folders of parts that it makes."""

_BITS_AND_KIND = b"\x01\x00"
"""Bits a sample and colour type in the head of the PNG files that `write_masks` makes."""


def write_masks(folder: Path, regions: Sequence[Region], replace: bool = False) -> list[Path]:
    """Writes a folder of masks with one PNG file of one bit a pixel for each region.

    Parts such as ``cat/eye`` go to a folder within, beside the mask of ``cat``; so they are read
    back right in front of it.

    Args:
        folder: The folder. If it exists, masks are added to the files there are.
        regions: Regions back to front, whose names differ.
        replace: Whether masks that this function wrote to the folder earlier may be replaced.

    Returns:
        The files, back to front.

    Raises:
        InputError: The folder cannot be written; it holds masks already, or pictures that would
            be read as masks; or a name cannot be that of a file.
    """
    names = _names(folder, regions)
    old = _old_masks(folder, replace)
    files = [_png(region) for region in regions]
    try:
        if folder.is_dir():
            for name, data in zip(names, files, strict=True):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                write_atomically(folder / name, data)
            for file in old:
                if file.relative_to(folder).as_posix() not in names:
                    file.unlink()
                    _remove_empty(file.parent, folder)
        else:
            _write_new(folder, dict(zip(names, files, strict=True)))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
    return [folder / name for name in names]


def _names(folder: Path, regions: Sequence[Region]) -> list[str]:
    """Names of the files of regions within the folder.

    Raises:
        InputError: The name of a region cannot be that of a file.
    """
    digits = len(str(len(regions) - 1))
    number = {region.name: k for k, region in enumerate(regions)}
    names = []
    for k, region in enumerate(regions):
        parts, above = list[str](), ""
        for part in region.name.split("/"):
            above = f"{above}/{part}".removeprefix("/")
            parts.append(f"{number.setdefault(above, k):0{digits}} {part}")
            if name_of_stem(parts[-1]) != part or "\\" in part:
                raise InputError(
                    f'{folder}: "{region.name}" cannot be the name of a mask file; begin names '
                    "with a letter, and leave \\ out"
                )
        names.append("/".join(parts) + ".png")
    return names


def _remove_empty(folder: Path, top: Path) -> None:
    """Removes folders below `top` that hold nothing any more."""
    while folder != top and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent


def _old_masks(folder: Path, replace: bool) -> list[Path]:
    """Masks of an earlier run in a folder.

    Raises:
        InputError: They must not be replaced, or the folder holds other pictures.
    """
    if not folder.exists():
        return []
    try:
        seen = sorted(f for f in folder.iterdir() if not f.name.startswith("."))
        within = [f for f in seen if _OWN_FOLDER.fullmatch(f.name) and f.is_dir()]
        seen += sorted(f for part in within for f in part.rglob("*") if not f.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from None
    pictures = [f for f in seen if f.suffix.lower() in TYPES and f.is_file()]
    others = [f for f in pictures if not _is_own(f, f.relative_to(folder).as_posix())]
    if others:
        raise InputError(
            f"{others[0]}: was not written by this tool, and would be read as a mask; choose an "
            "empty folder"
        )
    if pictures and not replace:
        raise InputError(f"{folder}: holds masks already; use --force to replace them")
    return pictures


def _is_own(file: Path, name: str) -> bool:
    if not _OWN.fullmatch(name):
        return False
    with file.open("rb") as content:
        return content.read(26)[24:] == _BITS_AND_KIND


def _png(region: Region) -> bytes:
    data = io.BytesIO()
    Image.fromarray(np.asarray(region.mask, np.bool_)).save(data, "PNG", optimize=True)
    return data.getvalue()


def _write_new(folder: Path, files: dict[str, bytes]) -> None:
    """Writes a new folder under a temporary name and renames it, so that it is whole or absent."""
    temporary = folder.with_name(temporary_name())
    try:
        temporary.mkdir()
        for name, data in files.items():
            (temporary / name).parent.mkdir(parents=True, exist_ok=True)
            (temporary / name).write_bytes(data)
        os.rename(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
