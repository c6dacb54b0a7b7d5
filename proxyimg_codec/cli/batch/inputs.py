"""Inputs of a command line, which are files, folders of pictures or patterns, and their outputs."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Callable, Iterator

from ...errors import InputError, UsageError
from ..places import check_names, default_target, in_and_out
from .records import FOLDER

_WILD = re.compile(r"[*?\[]")

STREAMS = ("-", "/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")


def is_many(name: str, stacks: bool) -> bool:
    """Whether a name stands for any number of inputs: a folder, or a pattern of names.

    Args:
        name: The name.
        stacks: Whether a folder is one input.
    """
    return (os.path.isdir(name) and not stacks) or is_pattern(name)


def is_folder(out: str | None) -> bool:
    """Whether an output is a folder for several, which may have to be made."""
    return out is not None and (out.endswith("/") or os.path.isdir(out))


def is_pattern(name: str) -> bool:
    """Whether a name is no name of a file, but a pattern that names of files match."""
    if _WILD.search(name) is None or os.path.lexists(name):
        return False
    return any(True for _ in glob.iglob(name, recursive=True))


def pairs(
    files: list[str], out: str | None, suffix: str, takes: Callable[[str], bool], stacks: bool
) -> list[tuple[str, str | None]]:
    """Inputs that a command line names, each with its output; None if none is named.

    Args:
        files: Names that the command line holds: inputs, or an input and an output.
        out: What its flag -o names.
        suffix: Suffix of the outputs in a folder.
        takes: Whether a file that is found in a folder is an input.
        stacks: Whether a folder is one input.

    Raises:
        UsageError: Two inputs have the same output, several inputs have no folder, or a name is
            empty.
        InputError: An input has no name to make one of, or nothing is found.
    """
    many = any(is_many(name, stacks) for name in files)
    if out is None or not is_folder(out):
        if out is not None and (many or len(files) > 1):
            raise UsageError(f"-o {out}: several inputs go into a folder; write -o {out}/")
        several = "of several inputs the output is a folder: -o FOLDER/"
        for name in filter(is_pattern, files):
            raise UsageError(f"{name}: stands for several files; {several}")
        return [in_and_out(files, out, several)]
    check_names(*files)
    if not files:
        raise UsageError("IN is missing; see --help")
    found: list[tuple[str, str | None]] = []
    taken: dict[str, str] = {}
    for source, inner in _found(files, out, takes, stacks):
        if source in STREAMS:
            raise UsageError(f"-o {out}: what comes from standard input has no name; give OUT")
        target = os.path.join(out, default_target(inner, suffix))
        place = os.path.realpath(target)
        if place in taken:
            raise UsageError(f"{taken[place]} and {source} would both become {target}")
        taken[place] = source
        found.append((source, target))
    return found


def _found(
    files: list[str], out: str, takes: Callable[[str], bool], stacks: bool
) -> Iterator[tuple[str, str]]:
    """Each input, and its name within the folder of outputs."""
    for name in files:
        if is_pattern(name):
            base = os.path.dirname(_WILD.split(name)[0])
            matches = [v for v in glob.glob(name, recursive=True) if stacks or os.path.isfile(v)]
            for match in sorted(matches, key=_natural):
                yield match, os.path.relpath(match, base or ".")
        elif is_many(name, stacks):
            inside = [v for v in _below(name, os.path.realpath(out)) if takes(v)]
            if not inside:
                raise InputError(f"{name}: no picture is in this folder")
            yield from ((os.path.join(name, v), v) for v in inside)
        else:
            yield name, os.path.basename(name)


def _below(folder: str, out: str) -> list[str]:
    """Files in a folder and those within, but hidden ones and outputs, in natural order."""

    def fail(error: OSError) -> None:
        raise InputError(f"{error.filename}: cannot be read: {error.strerror}")

    found = []
    for at, inner, names in os.walk(folder, onerror=fail):
        inner[:] = [v for v in inner if not v.startswith(".")
                    and (v != FOLDER) and os.path.realpath(os.path.join(at, v)) != out]  # fmt: skip
        found += [os.path.relpath(os.path.join(at, v), folder)
                  for v in names if not v.startswith(".")]  # fmt: skip
    return sorted(found, key=_natural)


def _natural(name: str) -> list[tuple[int, str]]:
    """Key by which 2.png comes before 10.png."""
    parts = re.split(r"([0-9]+)", name)
    return [(int(v), "") if v.isascii() and v.isdigit() else (-1, v) for v in parts]
