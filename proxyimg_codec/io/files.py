"""Reading and writing of whole files. A failed write leaves the old file, or none, never half."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import BinaryIO, TextIO

from ..errors import InputError, PxiError
from .streams import (
    Readable,
    Writable,
    is_readable,
    is_url,
    is_writable,
    name_of,
    read_stream,
    read_url,
    write_stream,
    write_url,
)

Name = str | os.PathLike[str]


def read_bytes(path: Name | Readable) -> bytes:
    """Reads all bytes of a file.

    Args:
        path: Path of the file, ``-`` for standard input; a URL; or a file that is open in binary.

    Raises:
        InputError: The file cannot be read.
        UnsupportedError: A URL needs a package that is not installed.
        UsageError: An open file gives text.
    """
    if is_readable(path):
        return read_stream(path)
    if is_url(path):
        return read_url(str(path))
    try:
        if os.fspath(path) == "-":
            return _standard(sys.stdin).read()
        return Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{_name(path, 'input')}: cannot be read: {error.strerror}") from None


def _name(path: Name | Readable, kind: str) -> str:
    if is_readable(path):
        return name_of(path)
    return f"standard {kind}" if os.fspath(path) == "-" else os.fspath(path)


@contextmanager
def naming(path: Name | Readable, kind: type[PxiError] = PxiError) -> Iterator[None]:
    """Context in which errors about the content of an input begin with its name.

    Args:
        path: The file, as for `read_bytes`.
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


def temporary_name() -> str:
    """Name for what is not finished yet, which nobody else uses.

    It is known before anything has it, so that a signal at any time leaves nothing behind.
    """
    return f".pxi-{secrets.token_hex(8)}"


def write_bytes(path: Name | Writable, data: bytes) -> None:
    """Writes a whole file to a path, as `write_atomically`, to a URL, or to an open file.

    Raises:
        InputError: The file cannot be written.
        UnsupportedError: A URL needs a package that is not installed.
        UsageError: An open file takes text.
    """
    if is_writable(path):
        write_stream(path, data)
        return
    place = write_url(str(path), data) if is_url(path) else path
    if place is not None:
        write_atomically(place, data)


def write_atomically(path: Name, data: bytes) -> None:
    """Writes a file under a temporary name in its folder, and then renames it.

    A symbolic link stays a link. Pipes and devices are written to directly. ``-`` is standard
    output.

    Raises:
        InputError: The file cannot be written; an old file of that name is unchanged.
        BrokenPipeError: Nobody reads the pipe any more.
    """
    temporary: Path | None = None
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
        old = target.stat().st_mode & 0o777 if target.exists() else None
        temporary = target.with_name(temporary_name())
        # The system takes away what the umask forbids; asking for the umask would set it meanwhile.
        opener = partial(os.open, mode=0o666 if old is None else old)
        with open(temporary, "xb", opener=opener) as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        if old is not None:
            os.chmod(temporary, old)  # whatever the umask
        os.replace(temporary, target)
        temporary = None
    except BrokenPipeError:
        raise
    except OSError as error:
        name = _name(path, "output")
        raise InputError(f"{name}: cannot be written: {error.strerror}") from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()
