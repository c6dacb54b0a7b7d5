"""What a decoder must be able to do to read a file: its profile, and its level."""

from __future__ import annotations

from dataclasses import fields

from ..container.content import Container
from ..container.file import parse_within
from ..limits import DEFAULT_LIMITS, Budget, Limits
from ..model import Picture
from .unpack import unpack

PROFILES = ("still", "posed", "moving")
"""Each has what those before it have, and: nothing; poses and node sampling; motion."""

LEVELS = (
    Limits(
        file_bytes=1 << 24, chunks=1 << 10, side=1 << 12, layers=1 << 6, networks=1 << 2,
        segments=1 << 12, gates=1 << 12, faces=1 << 15, codes=1 << 22, samples=1 << 22,
        small_gates=1 << 12, small_codes=1 << 22, small_samples=1 << 22, filled=1 << 23,
        covered=1 << 26, wavefronts=1 << 15, motion=1 << 16, parameters=1 << 16,
        metadata_bytes=1 << 20, references=1 << 14,
    ),
    Limits(
        file_bytes=1 << 27, chunks=1 << 12, side=1 << 14, layers=1 << 8, networks=1 << 4,
        segments=1 << 14, gates=1 << 14, faces=1 << 17, codes=1 << 24, samples=1 << 24,
        small_gates=1 << 14, small_codes=1 << 23, small_samples=1 << 24, filled=1 << 25,
        covered=1 << 29, wavefronts=1 << 16, motion=1 << 20, parameters=1 << 20,
        metadata_bytes=1 << 24, references=1 << 17,
    ),
    DEFAULT_LIMITS,
)  # fmt: skip
"""Level 1 is for thumbnails and pages, level 2 for photographs, level 3 is what readers accept."""

DRAWING = ("overlap", "beyond", "output_pixels", "multiply_adds", "work")
COUNTED = tuple(f.name for f in fields(Limits) if f.name not in DRAWING)
"""Limits that make a level: all but those of what is drawn."""


class Usage(Budget):
    """A budget that remembers what was checked against its limits.

    Attributes:
        counted: The largest count of each limit, by its name.
    """

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits)
        self.counted: dict[str, int] = {}

    def check(self, name: str, value: int) -> None:
        """As `Budget.check`."""
        super().check(name, value)
        self.counted[name] = max(self.counted.get(name, 0), value)

    @property
    def level(self) -> int | None:
        """The lowest level, 1..3, whose limits nothing exceeded; None if there is none."""
        counted = {name: count for name, count in self.counted.items() if name in COUNTED}
        levels = (
            number
            for number, level in enumerate(LEVELS, 1)
            if all(count <= getattr(level, name) for name, count in counted.items())
        )
        return next(levels, None)


def profile_and_level(data: bytes, limits: Limits = DEFAULT_LIMITS) -> tuple[str, int | None]:
    """The lowest profile and level, 1..3, that a file needs; None if it is above all levels.

    Args:
        data: The file.
        limits: Bounds what is spent on it.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: It needs a newer reader.
        LimitError: It exceeds `limits`.
    """
    usage = Usage(limits)
    content = parse_within(data, usage)
    refined(content, usage)
    return profile(content), usage.level


def refined(c: Container, usage: Usage) -> Picture:
    """The picture of a parsed file, with its meshes, so that all that makes its level is counted.

    Raises:
        FormatError, UnsupportedError, LimitError: As `profile_and_level`.
    """
    picture = unpack(c, usage)
    for layer in picture.layers:
        if layer.mesh is not None:
            _ = layer.mesh.refined
    return picture


def profile(c: Container) -> str:
    """The lowest of `PROFILES` that shows all of a file."""
    posed = bool(c.poses) or any(v["sampling"] for v in c.layers)
    return PROFILES[2 if c.motion is not None else 1 if posed else 0]
