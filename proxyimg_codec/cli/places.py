"""Inputs and outputs that a command line names, and what may be written where (decision 14)."""

from __future__ import annotations

import argparse
import os
import stat
import sys
from pathlib import Path

from ..errors import InputError, UsageError
from ..io.names import renamed

_INPUT = ("/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")
_OUTPUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


def add_files(p: argparse.ArgumentParser, inputs: str, output: str) -> None:
    """Adds the arguments IN OUT, and IN... -o OUT, of tools that take several inputs.

    Args:
        p: The parser.
        inputs: What an input is, for the help.
        output: What the output is, for the help.
    """
    p.usage = "%(prog)s [options] IN [OUT]\n       %(prog)s [options] IN|DIR|GLOB... -o FOLDER/"
    p.add_argument("files", metavar="IN [OUT]", nargs="*", default=[], help=f"{inputs}; {output}")
    p.add_argument(
        "-o", "--out", metavar="OUT", help="instead of the second name: a file, or for several "
        "inputs, a folder of them (DIR) or a pattern like 'photos/**/*.jpg' (GLOB) a folder, which "
        "is made if its name ends in /"
    )  # fmt: skip


def add_force_suffix(p: argparse.ArgumentParser) -> None:
    """Adds the flag --force-suffix of tools that write `.pxi` files."""
    p.add_argument(
        "--force-suffix", action="store_true", help="write .pxi data also if OUT has another suffix"
    )


def parse(p: argparse.ArgumentParser, words: list[str] | None) -> argparse.Namespace:
    """Parses a command line with a list `files`, which may stand before, among and after flags.

    What comes after ``--`` are files, whatever they begin with.
    """
    given = sys.argv[1:] if words is None else words
    cut = given.index("--") if "--" in given else len(given)
    args = p.parse_intermixed_args(given[:cut])
    args.files = [*args.files, *given[cut + 1 :]]
    return args


def check_names(*names: str | None) -> None:
    """Refuses empty names, as of a variable of the shell that is not set; None is no name.

    Raises:
        UsageError: A name is empty.
    """
    if "" in names:
        raise UsageError("the name of a file is empty")


def in_and_out(
    files: list[str], out: str | None = None, hint: str = "see --help"
) -> tuple[str, str | None]:
    """Input and output of a command line with one input; ``-`` for the standard streams.

    Args:
        files: The files that are named without a flag.
        out: The output that is named by a flag.
        hint: What somebody who names more files may have meant.

    Raises:
        UsageError: There are more files, or none, or a name is empty.
    """
    if not files:
        raise UsageError("IN is missing; see --help")
    names = files if out is None else [*files, out]
    check_names(*names)
    if len(names) > 2:
        raise UsageError(f"{len(files)} files are too many for IN OUT; {hint}")
    source = "-" if names[0] in _INPUT else names[0]
    if len(names) == 1:
        return source, None
    return source, "-" if names[1] in _OUTPUT else names[1]


def default_target(source: str, suffix: str) -> str:
    """Name of the output file if the user gives none: the input with another suffix.

    Args:
        source: Name of the input, or ``-``.
        suffix: Suffix of the output, with the dot.

    Raises:
        InputError: `source` is not the name of a file.
    """
    if source == "-":
        return "-"
    try:
        return renamed(source, suffix)
    except ValueError:
        raise InputError(f"{source!r} is not the name of a file") from None


def is_stream(path: str) -> bool:
    """Whether a name stands for standard output, or for a pipe, device or folder that exists."""
    return path == "-" or (os.path.exists(path) and not os.path.isfile(path))


def same_file(one: str | os.PathLike[str], other: str | os.PathLike[str]) -> bool:
    """Whether two names stand for the same file, whatever it is called; ``-`` is standard input."""
    found = [_status(path) for path in (one, other)]
    if found[0] is None or found[1] is None:
        return "-" not in (one, other) and os.path.realpath(one) == os.path.realpath(other)
    return stat.S_ISREG(found[0].st_mode) and os.path.samestat(found[0], found[1])


def _status(path: str | os.PathLike[str]) -> os.stat_result | None:
    try:
        return os.fstat(sys.stdin.fileno()) if path == "-" else os.stat(path)
    except (OSError, ValueError, AttributeError):
        return None  # standard input may be closed, or be no file


def check_target(path: str, force: bool, *sources: str | os.PathLike[str] | None) -> None:
    """Refuses an output file that exists, is an input, or whose folder does not exist.

    Pipes and devices may exist, because writing to them replaces nothing.

    Args:
        path: Name of the output, or ``-``.
        force: Whether an existing file may be replaced.
        sources: Names of the inputs, ``-`` for standard input; None for none.

    Raises:
        UsageError: An input and the output are the same file, or the output is a terminal.
        InputError: The file exists and `force` is off, or its folder is missing.
    """
    if path == "-":
        if sys.stdout is not None and sys.stdout.isatty():
            raise UsageError("refusing to write binary data to a terminal; redirect it")
        return
    target = Path(path)
    for source in sources:
        if source is not None and same_file(path, source):
            raise UsageError(f"{path}: input and output are the same file")
    if target.is_dir():
        raise InputError(f"{path}: is a folder")
    if not target.parent.is_dir():
        raise InputError(f"{path}: its folder does not exist")
    if target.is_file() and not force:
        raise InputError(f"{path}: exists already; use --force to replace it")


def check_suffix(path: str, insisted: bool, hint: str) -> None:
    """Refuses to write `.pxi` data under the name of something else.

    Args:
        path: Name of the output; that of a pipe, a device or a folder may be any.
        insisted: Whether the user insists on the name.
        hint: What the user may have meant.

    Raises:
        UsageError: The name does not end in ``.pxi``.
    """
    if path and not (insisted or is_stream(path) or path.lower().endswith(".pxi")):
        raise UsageError(
            f"{path}: what is written is a .pxi file; {hint}, or insist with --force-suffix"
        )
