"""Helpers of all tools: exit codes, limits, checks of output files, progress bars."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from .._version import __version__
from ..errors import InputError, PxiError, UsageError
from ..limits import Limits
from .signals import ending

EXIT_CODES = """exit codes:
  0 ok, 2 usage, 3 input or output, 4 invalid file, 5 unsupported, 6 limit exceeded,
  130 interrupted, 143 terminated (129: its terminal was closed)
"""


def parser(prog: str, description: str) -> argparse.ArgumentParser:
    """Creates an argument parser in the style of all tools."""
    p = argparse.ArgumentParser(
        prog, description=description, epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    p.add_argument("--version", action="version", version=f"{prog} {__version__}")
    return p


def add_limits(p: argparse.ArgumentParser) -> None:
    """Adds the option --limit, which all tools have that read `.pxi` files."""
    p.add_argument(
        "--limit", metavar="NAME=VALUE", action="append", default=[],
        help="change a limit on what files may ask for, such as layers=2000; may be repeated",
    )  # fmt: skip


def limits_of(args: argparse.Namespace) -> Limits:
    """Limits that the options --limit ask for.

    Raises:
        UsageError: A limit does not exist, or its value is not a whole number.
    """
    names = [f.name for f in fields(Limits)]
    changes = {}
    for text in args.limit:
        name, _, value = text.partition("=")
        if name not in names:
            raise UsageError(f"--limit {text}: there are {', '.join(names)}")
        if not (value.isascii() and value.isdecimal() and len(value) < 20):
            raise UsageError(f"--limit {text}: {name} must be a whole number of at most 19 digits")
        changes[name] = int(value)
    return Limits(**changes)


def run(prog: str, work: Callable[[], None]) -> int:
    """Runs a tool, and turns its errors into one line on stderr and an exit code.

    Args:
        prog: Name of the tool in error messages.
        work: The work to do.

    Returns:
        The exit code.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of layers may have characters that the terminal cannot show.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with ending():
            work()
            print(end="", flush=True)
        return 0
    except PxiError as error:
        code, message = error.exit_code, str(error)
    except KeyboardInterrupt:
        code, message = 130, "interrupted"
    except SystemExit as end:  # raised by `ending` alone
        code, message = int(end.code or 0), "terminated"
    except MemoryError:
        code, message = 6, "not enough memory; ask for a smaller picture or region"
    except BrokenPipeError:
        # The reader of the output is gone, so that nobody would see a message.
        code, message = 3, ""
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("proxyimg_codec"):
            raise
        code, message = 5, f"this needs {error.name}: pip install 'proxyimg-codec[all]'"
    except OSError as error:
        place = "" if error.filename is None else f"{error.filename}: "
        code, message = 3, f"{place}{error.strerror or error}"
    _drop_output()
    if message:
        with contextlib.suppress(OSError):  # a terminal that was closed
            print(f"{prog}: {' '.join(message.splitlines())}", file=sys.stderr)
    return code


def key(name: str) -> str | int:
    """Parses the address of a layer: digits are a position, anything else is a name."""
    digits = name.removeprefix("-")
    return int(name) if digits.isdecimal() and len(digits) < 10 else name


def printable(text: str) -> str:
    """Makes text of a file safe for a terminal by escaping control characters."""
    return text if text.isprintable() else ascii(text)


def _drop_output() -> None:
    """Discards output that cannot be written, about which Python would complain on exit."""
    try:
        print(end="", flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


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
        return str(Path(source).with_suffix(suffix))
    except ValueError:
        raise InputError(f"{source!r} is not the name of a file") from None


def check_target(path: str, force: bool, source: str | None = None) -> None:
    """Refuses an output file that exists, is the input, or whose folder does not exist.

    Pipes and devices may exist, because writing to them replaces nothing.

    Args:
        path: Name of the output, or ``-``.
        force: Whether an existing file may be replaced.
        source: Name of the input, or ``-``.

    Raises:
        UsageError: Input and output are the same file, or the output is a terminal.
        InputError: The file exists and `force` is off, or its folder is missing.
    """
    if path == "-":
        if sys.stdout is not None and sys.stdout.isatty():
            raise UsageError("refusing to write binary data to a terminal; redirect it")
        return
    target = Path(path)
    same = source not in (None, "-") and target.exists() and os.path.exists(str(source))
    if same and target.samefile(str(source)):
        raise UsageError(f"{path}: input and output are the same file")
    if target.is_dir():
        raise InputError(f"{path}: is a folder")
    if not target.parent.is_dir():
        raise InputError(f"{path}: its folder does not exist")
    if target.is_file() and not force:
        raise InputError(f"{path}: exists already; use --force to replace it")


class Bar:
    """Progress bar on a terminal; invisible in a pipe, with `quiet`, or without tqdm."""

    def __init__(self, total: int, label: str, quiet: bool) -> None:
        self._bar: Any = None
        if not quiet and sys.stderr.isatty():
            try:
                from tqdm import tqdm
            except ImportError:
                return
            self._bar = tqdm(total=total, desc=label, leave=False, unit_scale=True, file=sys.stderr)

    def advance(self, count: int) -> None:
        """Advances the bar by `count` steps."""
        if self._bar is not None:
            self._bar.update(count)

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
