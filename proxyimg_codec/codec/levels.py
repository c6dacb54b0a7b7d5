"""Profile and level of a file: the features and the resources that a decoder needs to read it."""

from __future__ import annotations

from dataclasses import fields

from ..container.content import Container
from ..container.file import parse_within
from ..limits import DEFAULT_LIMITS, Budget, Limits
from ..model import Picture
from .unpack import unpack

PROFILES = ("still", "posed", "moving")
"""Profiles. ``posed`` adds poses and node sampling to ``still``; ``moving`` adds motion to that."""

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
"""Limits of the levels: 1 suits thumbnails and web pages, 2 photographs, 3 is the default."""

DRAWING = ("overlap", "beyond", "output_pixels", "multiply_adds", "work")
"""Limits on rendering."""

COUNTED = tuple(f.name for f in fields(Limits) if f.name not in DRAWING)
"""Limits that define a level: all but those on rendering."""


class Usage(Budget):
    """Budget that also records the largest value checked against each limit.

    Attributes:
        counted: Largest value so far, by the name of the limit.
    """

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits)
        self.counted: dict[str, int] = {}

    def check(self, name: str, value: int) -> None:
        """Checks like `Budget.check`, and records the value."""
        super().check(name, value)
        self.counted[name] = max(self.counted.get(name, 0), value)

    @property
    def level(self) -> int | None:
        """Lowest level, 1..3, whose limits nothing has exceeded; None if there is none."""
        counted = {name: count for name, count in self.counted.items() if name in COUNTED}
        levels = (
            number
            for number, level in enumerate(LEVELS, 1)
            if all(count <= getattr(level, name) for name, count in counted.items())
        )
        return next(levels, None)


def profile_and_level(data: bytes, limits: Limits = DEFAULT_LIMITS) -> tuple[str, int | None]:
    """Finds the lowest profile and level that a decoder needs for a file.

    Args:
        data: Bytes of the file.
        limits: Bounds on what decoding the file may cost.

    Returns:
        One of `PROFILES`, and the level 1..3, or None if the file is above all levels.

    Raises:
        FormatError: The file breaks the format.
        UnsupportedError: The file needs a newer reader.
        LimitError: The file exceeds `limits`.
    """
    usage = Usage(limits)
    content = parse_within(data, usage)
    refined(content, usage)
    return profile(content), usage.level


def refined(c: Container, usage: Usage) -> Picture:
    """Decodes a parsed file together with its meshes, so that `usage` counts all costs of a level.

    Raises:
        FormatError, UnsupportedError, LimitError: As `profile_and_level`.
    """
    picture = unpack(c, usage)
    for layer in picture.layers:
        if layer.mesh is not None:
            _ = layer.mesh.refined
    return picture


def profile(c: Container) -> str:
    """Lowest of `PROFILES` that shows everything in a file."""
    posed = bool(c.poses) or any(v["sampling"] for v in c.layers)
    return PROFILES[2 if c.motion is not None else 1 if posed else 0]
