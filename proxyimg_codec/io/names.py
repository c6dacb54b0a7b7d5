"""Names of files: which suffixes stand for pictures, and what a new file is called."""

from __future__ import annotations

import os
from pathlib import Path

PICTURES = frozenset((
    ".apng", ".avif", ".bmp", ".cin", ".dds", ".dng", ".dpx", ".exr", ".fits", ".gif", ".hdr",
    ".heic", ".heif", ".ico", ".iff", ".j2c", ".j2k", ".jfif", ".jp2", ".jpe", ".jpeg", ".jpg",
    ".jxl", ".npy", ".ora", ".pbm", ".pfm", ".pgm", ".pic", ".png", ".pnm", ".ppm", ".psb",
    ".psd", ".pxi", ".qoi", ".rgb", ".rgba", ".rla", ".sgi", ".svg", ".tga", ".tif", ".tiff",
    ".tpic", ".tx", ".webp", ".zfile",
))  # fmt: skip
"""Suffixes of picture files in lower case; any other is a part of a name, as in ``name.v1.2``."""


def is_picture(path: str | os.PathLike[str]) -> bool:
    """Whether the suffix of a file stands for a picture."""
    return Path(path).suffix.lower() in PICTURES


def renamed(path: str | os.PathLike[str], suffix: str) -> str:
    """Name of a file with another suffix: of `a.jpg` it is `a.pxi`, but of `a.v2` `a.v2.pxi`.

    Args:
        path: Path of the file.
        suffix: The new suffix, with the dot.

    Raises:
        ValueError: The path has no name, such as ``/`` or ``..``.
    """
    path = Path(path)
    if path.name in ("", ".."):
        raise ValueError(f"{str(path)!r} has no name")
    stem = path.stem if is_picture(path) else path.name
    return str(path.with_name(stem + suffix))
