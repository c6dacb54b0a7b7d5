"""Records of what a folder of outputs holds, so that a batch goes on where it was ended.

Each output has a file of its own in a hidden folder: its worker writes that it begins, and what the
output is when it is done. So nobody else has to be told, and any worker may be lost at any time.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...io.files import write_atomically

FOLDER = ".pxi-batch"
"""Name of the folder of records, in that of the outputs."""


@dataclass(frozen=True)
class Record:
    """Knowledge of an output.

    Attributes:
        key: Hash of the input and the settings.
        batch: Name of the run that made it.
        digest: Hash of the output; None if it was begun and may not be finished.
        report: What the tool told of it.
    """

    key: str
    batch: str
    digest: str | None = None
    report: dict[str, Any] | None = None


def digest_of(path: str | os.PathLike[str]) -> str:
    """Hash of a file; of a folder, of all files in it with their names."""
    if not os.path.isdir(path):
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    found = sorted(v for v in Path(path).rglob("*") if v.is_file())
    parts = [f"{v.relative_to(path)}\0{digest_of(v)}" for v in found]
    return hashlib.sha256("\n".join(parts).encode("utf-8", "surrogateescape")).hexdigest()


def read(out: str, output: str) -> Record | None:
    """Record of an output; None if there is none that can be read.

    Args:
        out: The folder of outputs.
        output: Path of the output.
    """
    try:
        return Record(**json.loads(_place(out, output).read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


def write(out: str, output: str, record: Record) -> None:
    """Writes the record of an output.

    Raises:
        InputError: It cannot be written.
    """
    write_atomically(_place(out, output), json.dumps(asdict(record)).encode())


def _place(out: str, output: str) -> Path:
    """Path of the record of an output, whose own name may be as long as a name can be."""
    name = os.path.relpath(output, out).encode("utf-8", "surrogateescape")
    return Path(out, FOLDER, f"{hashlib.sha256(name).hexdigest()[:32]}.json")


@contextlib.contextmanager
def locked(out: str) -> Iterator[None]:
    """Context in which no other batch may write into a folder. It ends with the process.

    Raises:
        InputError: Another batch does, or the folder cannot be written to.
    """
    try:
        os.makedirs(os.path.join(out, FOLDER), exist_ok=True)
        file = open(os.path.join(out, FOLDER, "lock"), "a+b")  # noqa: SIM115 # closed below
    except OSError as error:
        raise InputError(f"{out}: cannot be written to: {error.strerror}") from None
    with file:
        try:
            _lock(file.fileno())
        except OSError:
            raise InputError(f"{out}: another batch writes into this folder; wait for its end, or "
                             "choose another") from None  # fmt: skip
        yield


def _lock(number: int) -> None:
    """Locks an open file for this process alone.

    Raises:
        OSError: Another process has it locked.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        msvcrt.locking(number, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore] # on Windows alone
    else:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
