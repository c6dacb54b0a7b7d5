"""Bytes that other programs hold or carry: buffers, open files, and URLs of fsspec."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from ..errors import InputError, PxiError, UnsupportedError, UsageError

if TYPE_CHECKING:
    from typing_extensions import TypeIs

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(::[^/]*)?://")
"""Start of a URL, also of one that fsspec reads through another; a drive has but one letter."""


@runtime_checkable
class Readable(Protocol):
    """An open file that is read in binary."""

    def read(self) -> bytes:
        """Returns all bytes from the present place on."""
        ...


@runtime_checkable
class Writable(Protocol):
    """An open file that is written in binary."""

    def write(self, data: Any, /) -> Any:
        """Writes bytes; returns how many, or None if that is all of them."""
        ...


def is_readable(file: object) -> TypeIs[Readable]:
    """Whether something is an open file to read from, and not a path with a method that reads."""
    return isinstance(file, Readable) and _is_open(file)


def is_writable(file: object) -> TypeIs[Writable]:
    """Whether something is an open file to write to, and not a path with a method that writes."""
    return isinstance(file, Writable) and _is_open(file)


def _is_open(file: object) -> bool:
    return not isinstance(file, str | os.PathLike) or hasattr(file, "close")


def is_url(name: object) -> bool:
    """Whether something is the URL of a file, such as ``s3://bucket/a.pxi``."""
    return isinstance(name, str) and _URL.match(name) is not None


def name_of(file: object) -> str:
    """Name of an open file in error messages."""
    name = getattr(file, "name", None)
    return name if isinstance(name, str) else f"<{type(file).__name__}>"


def bytes_of(data: object) -> bytes:
    """Returns the bytes of a buffer.

    Args:
        data: bytes, bytearray, memoryview, mmap, or an array of uint8: a row of bytes, contiguous.

    Raises:
        UsageError: It is no buffer, or one of another shape or type.
    """
    if isinstance(data, bytes):
        return data
    try:
        view = memoryview(data)  # type: ignore[arg-type]  # that is what is asked here
    except (TypeError, ValueError) as error:
        raise UsageError(f"the data of a file are bytes or a buffer of them: {error}") from None
    if view.ndim != 1 or view.itemsize != 1 or not view.c_contiguous:
        raise UsageError(f"the data of a file are a contiguous row of bytes, but this is a buffer "
                         f"of shape {view.shape} and type {view.format!r}")  # fmt: skip
    return bytes(view)


def read_stream(file: Readable) -> bytes:
    """Reads an open file from its present place to its end.

    Raises:
        InputError: Reading fails.
        UsageError: The file gives text.
    """
    try:
        data = file.read()
    except (OSError, EOFError, ValueError) as error:  # ValueError: it is closed
        raise InputError(f"{name_of(file)}: cannot be read: {_reason(error)}") from None
    if not isinstance(data, bytes | bytearray | memoryview):
        raise UsageError(f"{name_of(file)}: gives {type(data).__name__}; open it in binary ('rb')")
    return bytes(data)


def write_stream(file: Writable, data: bytes) -> None:
    """Writes bytes to an open file, at its present place.

    Raises:
        InputError: Writing fails. What was written before stays, because only the owner of the file
            can take it back.
        UsageError: The file takes text.
    """
    left = memoryview(data)
    try:
        while left:
            count = file.write(left)
            if isinstance(count, int) and not 0 < count <= len(left):
                raise OSError(f"it took {count} bytes")
            left = left[count:] if isinstance(count, int) else left[:0]
    except TypeError:
        raise UsageError(f"{name_of(file)}: takes no bytes; open it in binary ('wb')") from None
    except (OSError, ValueError) as error:
        done = len(data) - len(left)
        raise InputError(f"{name_of(file)}: cannot be written: {_reason(error)} ({done} of "
                         f"{len(data)} bytes were)") from None  # fmt: skip


def read_url(url: str) -> bytes:
    """Reads a file of any file system that fsspec knows.

    Raises:
        InputError: It cannot be read.
        UnsupportedError: fsspec, or what it needs for this file system, is not installed.
    """
    try:
        system, path = _found(url)
        return bytes(system.cat_file(path))
    except PxiError:
        raise
    except Exception as error:  # each file system has errors of its own
        raise InputError(f"{url}: cannot be read: {_reason(error)}") from None


def write_url(url: str, data: bytes) -> str | None:
    """Writes a file of any file system that fsspec knows, as a whole.

    Returns:
        None; or a path, with nothing written, if the URL stands for a file of this machine.

    Raises:
        InputError: It cannot be written.
        UnsupportedError: fsspec, or what it needs for this file system, is not installed.
    """
    try:
        system, path = _found(url)
        if "file" in ([system.protocol] if isinstance(system.protocol, str) else system.protocol):
            return str(path)
        system.pipe_file(path, data)
    except PxiError:
        raise
    except Exception as error:  # each file system has errors of its own
        raise InputError(f"{url}: cannot be written: {_reason(error)}") from None
    return None


def _found(url: str) -> tuple[Any, str]:
    """File system of a URL, and the path in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise UnsupportedError(
            f"{url}: URLs need fsspec: pip install 'proxyimg-codec[hosts]'"
        ) from None
    try:
        system, path = url_to_fs(url)
    except ImportError as error:
        raise UnsupportedError(f"{url}: {error}") from None
    return system, os.fspath(path)


def _reason(error: BaseException) -> str:
    """Reason of an error in one line."""
    told = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(told).split())
