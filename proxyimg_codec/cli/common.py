"""Helpers of all tools: exit codes, limits, messages, progress bars."""

from __future__ import annotations

import argparse
import contextlib
import io
import logging
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, NoReturn

from .._version import __version__
from ..errors import PxiError, UsageError
from ..limits import Limits
from .signals import ending

EXIT_CODES = """exit codes:
  0 ok, 2 usage, 3 input or output, 4 invalid file, 5 unsupported, 6 limit exceeded,
  130 interrupted, 143 terminated (129: its terminal was closed)
"""


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are safe for a terminal."""

    def error(self, message: str) -> NoReturn:
        super().error(printable(message))


def parser(prog: str, description: str, *about: str) -> argparse.ArgumentParser:
    """Creates an argument parser in the style of all tools.

    Args:
        prog: Name of the tool.
        description: What it does.
        about: More lines that ``--version`` prints.
    """
    p = _Parser(
        prog, description=description, epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    version = "\n".join((f"{prog} {__version__}", *about)).replace("%", "%%")
    p.add_argument("--version", action="version", version=version)
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


def jobs_of(args: argparse.Namespace) -> int:
    """Threads or processes that the option --jobs asks for: without it, one for each core."""
    return (os.cpu_count() or 1) if args.jobs is None else int(args.jobs)


def processes_of(args: argparse.Namespace) -> int:
    """Processes that the option --jobs asks for.

    Raises:
        UsageError: There are none.
    """
    jobs = jobs_of(args)
    if jobs < 1:
        raise UsageError(f"--jobs {jobs}: at least one process is needed")
    return jobs


def run(prog: str, work: Callable[[], None]) -> int:
    """Runs a tool, and turns its errors into one line on stderr and an exit code.

    Args:
        prog: Name of the tool in error messages.
        work: The work to do.

    Returns:
        The exit code.
    """
    if sys.stderr is None:  # closed: messages would go to stdout, and files get its number
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of layers may have characters that the terminal cannot show.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with ending():
            work()
            print(end="", flush=True)
        return 0
    except KeyboardInterrupt:
        code, message = 130, "interrupted"
    except SystemExit as end:  # raised by `ending` alone
        code = int(end.code or 0)
        message = "interrupted" if code == 130 else "terminated"
    except Exception as error:  # what nobody expects is raised again
        known = failure(error)
        if known is None:
            raise
        code, message = known
    _drop_output()
    if message:
        with contextlib.suppress(OSError):  # a terminal that was closed
            print(f"{prog}: {printable(message.strip())}", file=sys.stderr)
    return code


def failure(error: Exception) -> tuple[int, str] | None:
    """Exit code and message of an error; None if it is not one of those that users cause.

    The message is empty if nobody would see it.
    """
    if isinstance(error, PxiError):
        return error.exit_code, str(error)
    if isinstance(error, MemoryError):
        return 6, "not enough memory; ask for a smaller picture or region"
    if isinstance(error, BrokenPipeError):  # the reader of the output is gone
        return 3, ""
    if isinstance(error, ModuleNotFoundError):
        if (error.name or "").startswith("proxyimg_codec"):
            return None
        return 5, f"this needs {error.name}: pip install 'proxyimg-codec[all]'"
    if isinstance(error, OSError):
        place = "" if error.filename is None else f"{error.filename}: "
        return 3, f"{place}{error.strerror or error}"
    return None


class _OneLine(logging.Formatter):
    """Formatter that makes one line of a warning, safe for a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


@contextlib.contextmanager
def warnings_shown(prog: str, quiet: bool = False) -> Iterator[None]:
    """Prints what the package logs as warnings on stderr while it lasts, or nothing if `quiet`."""
    log, handler = logging.getLogger("proxyimg_codec"), logging.StreamHandler()
    handler.setFormatter(_OneLine(f"{prog}: warning: %(message)s"))
    handler.setLevel(logging.CRITICAL if quiet else logging.WARNING)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


def key(name: str) -> str | int:
    """Parses the address of a layer: digits are a position, anything else is a name."""
    digits = name.removeprefix("-")
    return int(name) if digits.isdecimal() and len(digits) < 10 else name


def printable(text: str) -> str:
    """Escapes what a terminal should not get: control characters, and bytes that are no UTF-8."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _drop_output() -> None:
    """Discards output that cannot be written, about which Python would complain on exit."""
    try:
        print(end="", flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


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

    def say(self, text: str) -> None:
        """Prints a line on stderr, above the bar."""
        if self._bar is None:
            print(text, file=sys.stderr)
        else:
            self._bar.write(text, file=sys.stderr)

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
