"""Pictures of the data folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .. import rd
from .items import Pixels


def crops(folder: Path, most: int, side: int) -> list[tuple[str, Pixels]]:
    """Names and central crops uint8 [side, side, 3] of evenly chosen pictures of a folder.

    Crops of smaller pictures are as large as the pictures.

    Raises:
        InputError: The folder does not exist or has no pictures, or one of them is damaged.
    """
    return [(p.stem, centre(rd.load(p)[..., :3], side)) for p in _chosen(folder, most)]


def over_white(folder: Path, most: int, side: int) -> list[tuple[str, Pixels]]:
    """Names and central crops as of `crops`, of pictures that are drawn over white.

    Raises:
        InputError: The folder does not exist or has no pictures, or one of them is damaged.
    """
    found = []
    for path in _chosen(folder, most):
        pixels = rd.load(path)
        if pixels.shape[2] == 4:
            alpha = pixels[..., 3:] / 255.0
            pixels = np.rint(pixels[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
        found.append((path.stem, centre(pixels, side)))
    return found


def centre(pixels: Any, side: int) -> Any:
    """Central crop [side, side, ...] of a picture or mask; as large as the picture if smaller."""
    y, x = (max(n - side, 0) // 2 for n in pixels.shape[:2])
    return np.ascontiguousarray(pixels[y : y + side, x : x + side])


def _chosen(folder: Path, most: int) -> list[Path]:
    files = rd.files_of(folder)
    return files[:: max(len(files) // most, 1)][:most]
