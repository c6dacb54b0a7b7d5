"""The cases on disk: one folder each, described by its `case.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).with_name("cases")

EXIT_CODES = {"invalid": 4, "unsupported": 5, "limit": 6}
"""Exit code of a decoder for each class of error."""


@dataclass(frozen=True)
class Render:
    """One picture that a decoder must be able to make of a case's input.

    Attributes:
        args: Arguments of `Image.render` that ask for it, with ``time`` for `t`.
        flags: Command-line flags that do.
        expected: PNG file of the pixels.
        peak: Largest error of a sample that is allowed, in 8-bit levels.
        rms: Largest root mean square error, likewise.
    """

    args: Mapping[str, Any]
    flags: tuple[str, ...]
    expected: Path
    peak: float
    rms: float


@dataclass(frozen=True)
class Case:
    """One input and what a decoder must do with it.

    Attributes:
        name: Name of the folder.
        title: One sentence.
        tests: What it is there for.
        input: The `.pxi` file.
        renders: Pictures to make, if the file is valid.
        error: Class of error, one of `EXIT_CODES`, if it must be refused.
        latents: SHA-256 of the latents of its planes, in hexadecimal, if it has any.
    """

    name: str
    title: str
    tests: tuple[str, ...]
    input: Path
    renders: tuple[Render, ...]
    error: str | None
    latents: str | None = None


def load(folder: Path = FOLDER, pattern: str = "*") -> list[Case]:
    """All cases under `folder` whose name matches the shell pattern, by name."""
    files = sorted(folder.glob("*/case.json"))
    return [_read(f) for f in files if fnmatchcase(f.parent.name, pattern)]


def _read(file: Path) -> Case:
    values = json.loads(file.read_text(encoding="utf-8"))
    renders = [
        Render(
            r["args"],
            flags(r["args"]),
            file.parent / r["expected"],
            float(r["peak"]),
            float(r["rms"]),
        )
        for r in values.get("renders", [])
    ]
    error = values.get("error")
    if (error is None) == (not renders) or (error is not None and error not in EXIT_CODES):
        raise ValueError(f"{file}: needs either renders or a known class of error")
    return Case(
        file.parent.name, values["title"], tuple(values["tests"]), file.with_name("input.pxi"),
        tuple(renders), error, values.get("latents"),
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
