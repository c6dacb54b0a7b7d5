"""The list of valid cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from proxyimg_codec.model import Picture

from .builders import Numbers

Args = Mapping[str, Any]
Build = Callable[[Numbers], Picture | bytes]
WHOLE: Args = {}
"""Arguments of the plainest render."""


@dataclass(frozen=True)
class Valid:
    """A valid case.

    Attributes:
        title: One sentence.
        tests: What it is there for: topics of `topics`, or ids of statements.
        build: Makes the picture, or its file where the package would not write it so.
        renders: Arguments of each render, as in `cases.Render`.
    """

    title: str
    tests: tuple[str, ...]
    build: Build
    renders: Sequence[Args]


class Valids(dict[str, Valid]):
    """Valid cases by name."""

    def case(
        self, title: str, *tests: str, renders: Sequence[Args] = (WHOLE,), name: str = ""
    ) -> Callable[[Build], None]:
        """Decorates a builder, whose name, with dashes, becomes that of the case by default."""

        def register(build: Build) -> None:
            known = name or getattr(build, "__name__", "").strip("_").replace("_", "-")
            self[known] = Valid(title, tests, build, renders)

        return register
