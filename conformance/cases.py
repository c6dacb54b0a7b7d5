"""Cases on disk: each is a folder with an input and its description, `case.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).with_name("cases")

EXIT_CODES = {"invalid": 4, "unsupported": 5, "limit": 6}
"""Exit code of a decoder for each class of error."""

PROFILES = ("still", "posed", "moving")
"""Profiles of decoders; each includes those before it."""

LEVELS = 1, 2, 3
"""Levels of decoders; each includes those before it."""


@dataclass(frozen=True)
class Render:
    """Picture that a decoder must be able to render from the input of a case.

    Attributes:
        args: Arguments of `Image.render` that ask for it, with ``time`` for `t`.
        flags: Command-line flags that ask for it.
        expected: PNG file of the expected pixels.
        peak: Largest allowed error of a sample, in 8-bit levels.
        rms: Largest allowed root mean square error, in 8-bit levels.
    """

    args: Mapping[str, Any]
    flags: tuple[str, ...]
    expected: Path
    peak: float
    rms: float


@dataclass(frozen=True)
class Case:
    """Input, and what a decoder must do with it.

    Attributes:
        name: Name of the folder.
        title: Description, one sentence.
        tests: Ids of the statements of the specification that it tests.
        input: The `.pxi` file.
        renders: Pictures to render, if the file is valid, or if refusing it is optional.
        error: Class of error, one of `EXIT_CODES`, if the file must be refused.
        latents: SHA-256 of the latents of its planes, in hexadecimal, if it has any.
        profile: The lowest of `PROFILES` whose decoders must pass it.
        level: The lowest of `LEVELS` whose decoders must read it; None if it must be refused.
        optional: Whether a decoder may ignore the fault of the file, and render it.
        kind: Name of the folder that contains its folder; empty if cases are not grouped.
    """

    name: str
    title: str
    tests: tuple[str, ...]
    input: Path
    renders: tuple[Render, ...]
    error: str | None
    latents: str | None = None
    profile: str = PROFILES[0]
    level: int | None = None
    optional: bool = False
    kind: str = ""

    @property
    def outcome(self) -> str:
        """Expected outcome: ``valid`` or a class of error, perhaps followed by ``, optional``."""
        return f"{self.error or 'valid'}{', optional' if self.optional else ''}"

    def concerns(self, profile: str, level: int) -> bool:
        """Whether decoders of a profile and level must pass it."""
        capable = PROFILES.index(self.profile) <= PROFILES.index(profile)
        return capable and (self.level or LEVELS[0]) <= level


def load(
    folder: Path = FOLDER,
    pattern: str = "*",
    profile: str = PROFILES[-1],
    level: int = LEVELS[-1],
) -> list[Case]:
    """Loads the cases under a folder, sorted by name.

    Args:
        folder: Folder of the cases, or of folders of cases.
        pattern: Pattern of their names, as in a shell.
        profile: Profile of the decoder to test.
        level: Level of the decoder to test.

    Raises:
        ValueError: A `case.json` is inconsistent, or two cases have the same name.
    """
    places = sorted((f.parent for f in folder.rglob("case.json")), key=lambda place: place.name)
    for one, other in pairwise(places):
        if one.name == other.name:
            raise ValueError(f"{one} and {other} have the same name")
    cases = [_read(place, folder) for place in places if fnmatchcase(place.name, pattern)]
    return [case for case in cases if case.concerns(profile, level)]


def find(name: str) -> Case:
    """Case with a name.

    Raises:
        ValueError: There is no such case.
    """
    (case,) = load(pattern=name)
    return case


def _read(place: Path, folder: Path) -> Case:
    """Reads the case in the folder `place`."""
    file = place / "case.json"
    values = json.loads(file.read_text(encoding="utf-8"))
    renders = [
        Render(
            r["args"],
            flags(r["args"]),
            place / r["expected"],
            float(r["peak"]),
            float(r["rms"]),
        )
        for r in values.get("renders", [])
    ]
    error, optional = values.get("error"), values.get("optional", False)
    if (error is not None and error not in EXIT_CODES) or (optional and error is None):
        raise ValueError(f"{file}: {error} is not a class of error")
    if bool(renders) == (error is not None and not optional):
        raise ValueError(f"{file}: needs either renders or a class of error, or is optional")
    # The root mean square never exceeds the largest error, so that such a limit would test nothing.
    if not all(0 < r.rms <= r.peak for r in renders):
        raise ValueError(f"{file}: the tolerance of the mean error exceeds that of the largest")
    profile, level = values["profile"], values.get("level")
    if profile not in PROFILES or level not in ((None,) if error else LEVELS):
        raise ValueError(f"{file}: profile {profile} and level {level} do not fit")
    return Case(
        place.name, values["title"], tuple(values["tests"]), place / "input.pxi",
        tuple(renders), error, values.get("latents"), profile, level, optional,
        place.parent.name if place.parent != folder else "",
    )  # fmt: skip


def flags(args: Mapping[str, Any]) -> tuple[str, ...]:
    """Command-line flags for the `args` of a render."""
    out = ["--bit-depth", "16"]
    if "region" in args:
        out += ["--region", ",".join(str(v) for v in args["region"])]
    for key in ("width", "height"):
        if key in args:
            out += [f"--{key}", str(args[key])]
    if "time" in args:
        out += ["--time", str(args["time"])]
    for name in args.get("layers", []):
        out += ["--layer", name]
    if not args.get("background", True):
        out.append("--no-background")
    return tuple(out)
