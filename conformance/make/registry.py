"""Registry of valid cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from proxyimg_codec.model import Picture

from .builders import Numbers

Args = Mapping[str, Any]
Build = Callable[[Numbers], Picture | bytes]
WHOLE: Args = {}
"""Arguments of a render of the whole picture at its own size."""


@dataclass(frozen=True)
class Valid:
    """Valid case.

    Attributes:
        title: Description, one sentence.
        tests: Topics of `topics`, or ids of statements, that it tests.
        build: Function that makes the picture, or the file if the package would not write it so.
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
        """Decorator that registers a builder as a case.

        Args:
            title: Description, one sentence.
            *tests: Topics or ids of statements.
            renders: Arguments of each render.
            name: Name of the case; by default that of the builder, with dashes.
        """

        def register(build: Build) -> None:
            known = name or getattr(build, "__name__", "").strip("_").replace("_", "-")
            self[known] = Valid(title, tests, build, renders)

        return register
