"""Folder of a session: what a crash must not lose, and files that edits may name.

``session.json`` is written last, and each file under a temporary name that is then renamed, so that
a folder is complete at any time.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..io.files import read_bytes, write_atomically

STATE = "session.json"

KEPT_DAYS = 30
"""Days after which a session that nobody went on with is given up."""


def default_folder() -> Path:
    """Folder of all sessions of a user."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "proxyimg-codec" / "studio"


class Folder:
    """Folder of one session.

    Args:
        path: The folder, which exists.

    Attributes:
        path: The folder.
        files: Folder of the files that edits may name.
        exports: Folder of files that were made for the user to take.
        held: What a large file of the folder was made of, so that it is not written again.
    """

    def __init__(self, path: Path) -> None:
        path = path.absolute()  # edits are done in another folder
        self.path, self.files, self.exports = path, path / "files", path / "exports"
        self.held: object = None
        try:
            for each in (self.files, self.exports):
                each.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be made: {error.strerror}") from None

    @classmethod
    def new(cls, sessions: Path) -> Folder:
        """Makes the folder of a new session.

        Raises:
            InputError: It cannot be made.
        """
        try:
            sessions.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            raise InputError(f"{sessions}: cannot be made: {error.strerror}") from None
        return cls(sessions / secrets.token_hex(8))

    def names(self) -> list[str]:
        """Names of the files that edits may name."""
        return sorted(f.name for f in self.files.iterdir() if not f.name.startswith("."))

    def add(self, name: str, data: bytes) -> str:
        """Adds a file that edits may name; returns its name, with a number if that was taken.

        Raises:
            InputError: It cannot be written.
        """
        name = plain_name(name)
        stem, suffix = os.path.splitext(name)
        number = 2
        while (self.files / name).exists():
            name, number = f"{stem} {number}{suffix}", number + 1
        write_atomically(self.files / name, data)
        return name

    def write(self, state: Mapping[str, Any], parts: Mapping[str, bytes]) -> None:
        """Writes what is to be kept: files by name, then the state that refers to them.

        Raises:
            InputError: It cannot be written.
        """
        for name, data in parts.items():
            write_atomically(self.path / name, data)
        write_atomically(self.path / STATE, json.dumps(state).encode())

    def read(self, name: str) -> bytes:
        """Reads one of the files of `write`.

        Raises:
            InputError: It cannot be read.
        """
        return read_bytes(self.path / name)

    def state(self) -> dict[str, Any] | None:
        """State that was written last; None if there is none that can be read."""
        try:
            state = json.loads(self.read(STATE))
        except (InputError, ValueError, RecursionError):
            return None
        return state if isinstance(state, dict) else None

    def remove(self) -> None:
        """Removes the folder."""
        shutil.rmtree(self.path, ignore_errors=True)


def broken_off(sessions: Path, file: str | None) -> Folder | None:
    """Finds the newest session of a file that was not ended, and of which no server is alive.

    Args:
        sessions: Folder of all sessions.
        file: Absolute path of the file; None for sessions that were started without one.
    """
    found: list[tuple[float, Path]] = []
    with contextlib.suppress(OSError):
        for path in sessions.iterdir():
            with contextlib.suppress(OSError):
                found.append(((path / STATE).stat().st_mtime, path))
    for _, path in sorted(found, reverse=True):
        folder = Folder(path)
        state = folder.state()
        if state and state.get("path") == file and not _alive(state.get("port")):
            return folder
    return None


def sweep(sessions: Path) -> None:
    """Removes sessions that nobody has gone on with for `KEPT_DAYS`."""
    oldest = time.time() - KEPT_DAYS * 86400
    with contextlib.suppress(OSError):
        for path in [*sessions.iterdir()]:
            state = path / STATE
            if state.is_file() and state.stat().st_mtime < oldest:
                folder = Folder(path)
                if not _alive((folder.state() or {}).get("port")):
                    folder.remove()


def _alive(port: Any) -> bool:
    """Whether somebody listens at a port of this machine."""
    if not isinstance(port, int) or not 0 < port < 65536:
        return False
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=0.5):
            return True
    except OSError:
        return False


def plain_name(name: str) -> str:
    """Name of a file without folders and without what a system could take for something else."""
    last = name.replace("\\", "/").rpartition("/")[2]
    kept = "".join(c for c in last if c.isprintable() and c not in '<>:"|?*@=')[-120:]
    kept = kept.strip(". ")
    stem = kept.rpartition(".")[0] or kept
    if not stem or stem.lstrip("-").isdecimal() or kept.startswith("-"):
        return f"file {kept}".strip()
    return kept
