"""Miniature of an editing set: sprites on photographs, so that true results are known.

It is written in the layout of HumanEdit and read like it, with the edit types that geometry can
make: Add, Remove, Counting and Relation.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...io import raster
from .. import rd
from ..sprites import Sprite, scaled, solid
from .edit_sets import OBJECT
from .items import Effort, Given, Pixels
from .pictures import crops

SIZE = 0.35
"""Longer side of a sprite as a share of that of the picture."""

LEFT, RIGHT = 0.08, 0.57
"""Columns of the two places of a sprite, as shares of the width."""

FOLDERS = ("clipart", "emoji")


def write(given: Given, effort: Effort, out: Path) -> None:
    """Writes the miniature of crops of ``kodak/`` and sprites of ``clipart/`` or ``emoji/``.

    Raises:
        InputError: The folder of photographs is missing, or that of sprites.
    """
    files = [p for f in FOLDERS if (given.data / f).is_dir() for p in rd.files_of(given.data / f)]
    sprites = (solid(p) for f in files or rd.files_of(given.data / FOLDERS[0])
               if (p := rd.load(f)).shape[2] == 4)  # fmt: skip
    usable = (s for s in sprites if s is not None)
    (out / "scripts").mkdir(parents=True)
    with (out / "metadata.jsonl").open("w") as table:
        for name, photo in crops(given.data / "kodak", effort.few, effort.side):
            sprite = next(usable, None)
            if sprite is None:
                break
            for row in _rows(name, photo, scaled(sprite, SIZE * max(photo.shape[:2])), out):
                table.write(json.dumps(row) + "\n")


def _rows(name: str, photo: Pixels, sprite: Pixels, out: Path) -> list[dict[str, Any]]:
    """Writes the pictures and scripts of all edits of a photograph; returns their records."""
    height, width = photo.shape[:2]
    top = max(height - sprite.shape[0], 0) // 2
    left, right = (round(share * width) for share in (LEFT, RIGHT))
    first, second = (Sprite(sprite, x, top) for x in (left, right))
    one, other = _on(photo, first), _on(photo, second)
    both = _on(one, second)
    move = {"op": "move", "layer": OBJECT, "by": [right - left, 0]}
    centre = [left + sprite.shape[1] / 2, top + sprite.shape[0] / 2]
    again = {"op": "duplicate", "layer": OBJECT, "name": "twin"}
    raster.write(out / "scripts" / f"{name}.png", sprite)
    kinds: dict[str, tuple[Pixels, Pixels, list[dict[str, Any]]]] = {
        "Add": (photo, one, [{"op": "insert", "source": f"{name}.png", "at": centre}]),
        "Remove": (one, photo, [{"op": "remove", "layer": OBJECT}]),
        "Counting": (one, both, [again, {**move, "layer": "twin"}]),
        "Relation": (one, other, [move]),
    }
    inside = first.on(photo.shape)[..., 3:] >= 128
    mask = np.where(inside, 255, np.zeros_like(photo)).astype(np.uint8)
    rows = []
    for kind, (before, after, edits) in kinds.items():
        case = f"{name}-{kind.lower()}"
        row: dict[str, Any] = {"IMAGE_ID": case, "EDITING_TYPE": kind, "CORE": 0, "MASK": 1}
        for column, pixels in (("INPUT_IMG", before), ("MASK_IMG", mask), ("OUTPUT_IMG", after)):
            row[column] = f"{case}-{column.lower()}.png"
            raster.write(out / row[column], pixels)
        row |= {"EDITING_INSTRUCTION": f"{kind}, as the script says",
                "OUTPUT_DESCRIPTION": "a photograph, and a drawing on it"}  # fmt: skip
        script = {"version": 1, "edits": edits}
        (out / "scripts" / f"{case}.json").write_text(json.dumps(script))
        rows.append(row)
    return rows


def _on(photo: Pixels, sprite: Sprite) -> Pixels:
    layer = sprite.on(photo.shape).astype(float)
    alpha = layer[..., 3:] / 255
    return np.rint(photo + (layer[..., :3] - photo) * alpha).astype(np.uint8)
