"""pxi-studio: a page in the browser to make layers, and to move, bend, remove and animate them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..errors import UsageError
from .common import add_limits, jobs_of, limits_of, parser, run, warnings_shown


def arguments() -> argparse.ArgumentParser:
    """Parser of the command line."""
    p = parser(
        "pxi-studio",
        "Edit a picture in the browser: point at things, drag, bend, remove and animate them. "
        "Nothing leaves this machine.",
    )
    add = p.add_argument
    add("file", metavar="FILE", nargs="?", help=".pxi file, picture, .ora or .psd file to open; "
        "others can be dropped onto the page")  # fmt: skip
    add("--port", type=int, default=0, metavar="N", help="port of 127.0.0.1 to listen at; a free "
        "one by default")  # fmt: skip
    add("--no-browser", action="store_true", help="print the address, and open no browser")
    add("--stay", action="store_true", help="go on when the page is closed")
    add("--autosave", metavar="FOLDER", help="where changes are kept until they are saved; a "
        "folder of the user's cache by default")  # fmt: skip
    add("-j", "--jobs", type=int, metavar="N", help="cores to use; all by default")
    add_limits(p)
    add("--quiet", action="store_true", help="print nothing but the address and errors")
    return p


def main(argv: list[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    args = arguments().parse_args(argv)
    with warnings_shown("pxi-studio", args.quiet):
        return run("pxi-studio", lambda: start(args))


def start(args: argparse.Namespace) -> None:
    """Runs pxi-studio with parsed arguments.

    Raises:
        PxiError: Anything that goes wrong, as the class that decides the exit code.
    """
    jobs = jobs_of(args)
    if jobs < 1:
        raise UsageError(f"--jobs {jobs}: at least 1")
    if not 0 <= args.port < 65536:
        raise UsageError(f"--port {args.port}: must be 0..65535")

    from ..studio.autosave import default_folder
    from ..studio.server import LINGER, Options, serve

    sessions = default_folder() if args.autosave is None else Path(args.autosave)
    serve(
        Options(
            args.file, args.port, not args.no_browser, sessions, limits_of(args), jobs,
            None if args.stay else LINGER, args.quiet,
        )
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
