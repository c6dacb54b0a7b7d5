"""Reading and writing of whole files. A failed write leaves the old file, or none, never half."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

from ..errors import InputError, PxiError


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Reads all bytes of a file; ``-`` is standard input.

    Raises:
        InputError: The file cannot be read.
    """
    try:
        if os.fspath(path) == "-":
            return _standard(sys.stdin).read()
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{_name(path, 'input')}: cannot be read: {error.strerror}") from None


def _name(path: str | os.PathLike[str], kind: str) -> str:
    return f"standard {kind}" if os.fspath(path) == "-" else os.fspath(path)


@contextmanager
def naming(path: str | os.PathLike[str], kind: type[PxiError] = PxiError) -> Iterator[None]:
    """Context in which errors about the content of an input begin with its name.

    Args:
        path: Path of the file; ``-`` is standard input.
        kind: Class of the errors that are about the content.
    """
    place = f"{_name(path, 'input')}: "
    try:
        yield
    except kind as error:
        if not str(error).startswith(place):
            error.args = (f"{place}{error}",)
        raise


def _standard(stream: TextIO | None) -> BinaryIO:
    """Binary side of a standard stream; `stream` is None if it was closed when Python started."""
    if stream is None:
        raise OSError(errno.EBADF, "it is closed")
    return stream.buffer


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes a file under a temporary name in its folder, and then renames it.

    A symbolic link stays a link. Pipes and devices are written to directly. ``-`` is standard
    output.

    Raises:
        InputError: The file cannot be written; an old file of that name is unchanged.
        BrokenPipeError: Nobody reads the pipe any more.
    """
    temporary = None
    try:
        if os.fspath(path) == "-":
            stream = _standard(sys.stdout)
            stream.write(data)
            stream.flush()
            return
        if os.path.exists(path) and not os.path.isfile(path):
            with open(path, "wb") as stream:
                stream.write(data)
            return
        target = Path(os.path.realpath(path))
        fd, temporary = tempfile.mkstemp(prefix=".pxi-", dir=target.parent)
        with os.fdopen(fd, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        umask = os.umask(0)
        os.umask(umask)
        mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~umask
        os.chmod(temporary, mode)
        os.replace(temporary, target)
        temporary = None
    except BrokenPipeError:
        raise
    except OSError as error:
        name = _name(path, "output")
        raise InputError(f"{name}: cannot be written: {error.strerror}") from None
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
