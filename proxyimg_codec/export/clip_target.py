"""Targets of clips, recognized by their names alone.

========================  ==========================================================  =====
Target                    Content                                                     alpha
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
"""Lowest frame rate, in frames a second."""

_NUMBER = re.compile(r"%(?:0([1-9]))?d")


@dataclass(frozen=True)
class Kind:
    """Bounds of a kind of target.

    Attributes:
        alpha_bits: Bits of transparency a pixel: 8, 1 (clear or opaque), or 0 (composited over a
            background).
        fastest: Highest frame rate, in frames a second.
        longest_side: Largest width and height in pixels.
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
    """Target of a clip.

    Attributes:
        kind: ``mp4``, ``webm``, ``webp``, ``gif``, ``apng``, ``frames`` or ``sheet``.
        path: The file; for ``frames`` a pattern, whose name has one ``%d`` or ``%04d``.
    """

    kind: str
    path: Path

    @property
    def alpha_bits(self) -> int:
        """Bits of transparency that are kept a pixel: 8, 1 (GIF) or 0 (MP4)."""
        return KINDS[self.kind].alpha_bits

    @property
    def first(self) -> Path:
        """File whose existence tells that there is such a clip already."""
        return self.numbered(0) if self.kind == "frames" else self.path

    @property
    def sidecar(self) -> Path:
        """Map of a sprite sheet, a JSON file."""
        return self.path.with_suffix(".json")

    def numbered(self, k: int) -> Path:
        """File of frame `k`, for a pattern."""
        name = _NUMBER.sub(lambda match: f"{k:0{match[1] or 1}d}", self.path.name)
        return self.path.with_name(name)


def target_of(path: str, sheet: bool = False) -> Target:
    """Recognizes a target by its name.

    Args:
        path: A name as in the table of this module.
        sheet: Whether a ``.png`` is a sprite sheet.

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
