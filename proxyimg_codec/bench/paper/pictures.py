"""Pictures of the data folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import rd
from .items import Pixels


def crops(folder: Path, most: int, side: int) -> list[tuple[str, Pixels]]:
    """Names and central crops uint8 [side, side, 3] of evenly chosen pictures of a folder.

    Crops of smaller pictures are as large as the pictures.

    Raises:
        InputError: The folder does not exist or has no pictures, or one of them is damaged.
    """
    found = []
    for source in _chosen(folder, most):
        pixels = rd.load(source)[..., :3]
        y, x = (max(n - side, 0) // 2 for n in pixels.shape[:2])
        found.append((source.stem, np.ascontiguousarray(pixels[y : y + side, x : x + side])))
    return found


def _chosen(folder: Path, most: int) -> list[Path]:
    files = rd.files_of(folder)
    return files[:: max(len(files) // most, 1)][:most]
