"""Where a clip can go, told from the name alone.

========================  ==========================================================  =====
Target                    What is written                                             alpha
========================  ==========================================================  =====
``NAME.mp4``              H.264, 4:2:0, playable while it loads                       no
``NAME.webm``             VP9, 4:2:0                                                  yes
``NAME.webp``             animated WebP; lossless where that is no larger             yes
``NAME.gif``              one dithered palette of 255 colours for the whole clip      1 bit
``NAME.apng``             animated PNG, lossless                                      yes
``FOLDER/``               ``FOLDER/frame-0000.png`` and so on                         yes
``NAME-%04d.png``         the same under another name; ``%d`` is the frame's number   yes
``NAME.png``, a sheet     a sprite sheet, and its map in ``NAME.json``                yes
========================  ==========================================================  =====
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from ..errors import UsageError

SLOWEST = 0.01
"""Frames a second."""

_NUMBER = re.compile(r"%(?:0([1-9]))?d")


@dataclass(frozen=True)
class Kind:
    """What a type of target can hold.

    Attributes:
        alpha_bits: 8, 1 (each pixel is clear or opaque) or 0 (composited over a background).
        fastest: Frames a second.
        longest_side: Pixels.
    """

    alpha_bits: int
    fastest: int
    longest_side: int


# Browsers show a GIF, WebP or APNG whose frames last less than about 11 ms (GIF: 20 ms) slowly.
KINDS = {
    "mp4": Kind(0, 1000, 16384),
    "webm": Kind(8, 1000, 16384),
    "webp": Kind(8, 90, 16383),
    "gif": Kind(1, 50, 65535),
    "apng": Kind(8, 90, 65535),
    "frames": Kind(8, 1000, 65535),
    "sheet": Kind(8, 1000, 65535),
}


@dataclass(frozen=True)
class Target:
    """Where a clip goes.

    Attributes:
        kind: ``mp4``, ``webm``, ``webp``, ``gif``, ``apng``, ``frames`` or ``sheet``.
        path: The file; of frames the pattern, whose name has one ``%d`` or ``%04d``.
    """

    kind: str
    path: Path

    @property
    def alpha_bits(self) -> int:
        """How many bits a pixel are kept of transparency: 8, 1 (GIF) or 0 (MP4)."""
        return KINDS[self.kind].alpha_bits

    @property
    def first(self) -> Path:
        """The file that exists if there is such a clip already."""
        return self.numbered(0) if self.kind == "frames" else self.path

    @property
    def sidecar(self) -> Path:
        """The map of a sprite sheet."""
        return self.path.with_suffix(".json")

    def numbered(self, k: int) -> Path:
        """The file of frame `k`, of a pattern."""
        name = _NUMBER.sub(lambda match: f"{k:0{match[1] or 1}d}", self.path.name)
        return self.path.with_name(name)


def target_of(path: str, sheet: bool = False) -> Target:
    """What to write to `path`, by its name alone.

    Args:
        path: As in the table of this module.
        sheet: A ``.png`` is a sprite sheet.

    Raises:
        UsageError: No clip can be written under such a name.
    """
    name = os.path.basename(path)
    suffix = os.path.splitext(name)[1].lower()
    if sheet:
        if suffix != ".png" or _NUMBER.search(name):
            raise UsageError(f"{path}: a sprite sheet is one .png file")
        return Target("sheet", Path(path))
    if path.endswith("/"):
        return Target("frames", Path(path) / "frame-%04d.png")
    if len(_NUMBER.findall(name)) == 1 and suffix == ".png":
        return Target("frames", Path(path))
    if suffix in (".mp4", ".webm", ".webp", ".gif", ".apng"):
        return Target(suffix[1:], Path(path))
    raise UsageError(
        f"{path}: name a clip .mp4, .webm, .webp, .gif or .apng, a folder/ or name-%04d.png for "
        "one file a frame, or a .png for a sprite sheet and say that it is one"
    )
