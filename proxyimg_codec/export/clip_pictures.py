"""Clips as PNG files, one for each frame, or as a sprite sheet; see `clip` for the coders."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..io.png import encode_png
from .clip_target import Target

Frame = NDArray[np.uint8]


class Numbered:
    """Coder that writes one PNG file for each frame."""

    def __init__(self, target: Target, stage: Path) -> None:
        self._target = target
        self._stage = stage
        self._count = 0

    def add(self, frame: Frame) -> None:
        """Writes the next frame, uint8 [H, W, 3 or 4]."""
        name = self._target.numbered(self._count).name
        (self._stage / name).write_bytes(encode_png(frame))
        self._count += 1

    def finish(self) -> None:
        """Does nothing, because each frame is written at once."""

    def close(self) -> None:
        """Does nothing, because no file is open."""


class Sheet:
    """Coder that writes all frames into one PNG file, row by row, nearly square, and its map.

    The map is the JSON (hash) that TexturePacker and Aseprite export, and that Phaser, PixiJS and
    others read. It also has the grid, for programs that only count.
    """

    def __init__(self, target: Target, stage: Path, rate: Fraction, loop: bool) -> None:
        self._target = target
        self._stage = stage
        self._rate = rate
        self._loop = loop
        self._frames: list[Frame] = []

    def add(self, frame: Frame) -> None:
        """Keeps the next frame, uint8 [H, W, 3 or 4], until `finish`."""
        self._frames.append(frame)

    def finish(self) -> None:
        """Writes the sheet and its map."""
        count = len(self._frames)
        height, width, channels = self._frames[0].shape
        columns = min(count, math.ceil(math.sqrt(count * height / width)))
        rows = math.ceil(count / columns)
        pixels = np.zeros((rows * height, columns * width, channels), np.uint8)
        stem = self._target.path.stem
        boxes = {}
        for k, frame in enumerate(self._frames):
            y, x = k // columns * height, k % columns * width
            pixels[y : y + height, x : x + width] = frame
            begin, end = (round(n * 1000 / self._rate) for n in (k, k + 1))
            boxes[f"{stem}-{k:04d}"] = {
                "frame": {"x": x, "y": y, "w": width, "h": height},
                "rotated": False,
                "trimmed": False,
                "spriteSourceSize": {"x": 0, "y": 0, "w": width, "h": height},
                "sourceSize": {"w": width, "h": height},
                "duration": end - begin,
            }
        meta = {
            "app": "proxyimg-codec",
            "image": self._target.path.name,
            "format": "RGBA8888" if channels == 4 else "RGB888",
            "size": {"w": columns * width, "h": rows * height},
            "scale": "1",
            "columns": columns,
            "rows": rows,
            "frameWidth": width,
            "frameHeight": height,
            "frameCount": count,
            "fps": float(self._rate),
            "loop": self._loop,
        }
        whole = {"frames": boxes, "animations": {stem: list(boxes)}, "meta": meta}
        text = json.dumps(whole, indent=1)
        (self._stage / self._target.path.name).write_bytes(encode_png(pixels))
        (self._stage / self._target.sidecar.name).write_text(text + "\n", encoding="utf-8")

    def close(self) -> None:
        """Does nothing, because no file is open."""
