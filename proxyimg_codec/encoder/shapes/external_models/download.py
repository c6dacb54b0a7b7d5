"""Downloads of known models, when somebody asks for them. Nothing else here uses the network."""

from __future__ import annotations

import hashlib
import http.client
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib import error, request

from ....errors import InputError
from .catalogue import File

CHUNK = 1 << 18
"""Bytes that are read at once."""

PATIENCE = 30.0
"""Seconds without a byte after which a download is given up."""

Progress = Callable[[int, int | None], None]


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def download(file: File, folder: Path, progress: Progress = lambda done, total: None) -> str:
    """Downloads a file of a known model to a folder, which is made.

    What has arrived lies in ``NAME.part`` until all is there and the checksum is right; a download
    that was interrupted goes on there, if the server still has the same file.

    Args:
        file: The file.
        folder: The folder; a file of the same name in it is replaced.
        progress: Called with the bytes that are here, and how many there will be if that is known.

    Returns:
        Its SHA-256, in hexadecimal.

    Raises:
        InputError: The server does not give the file, it ends early, or its checksum is wrong.
        OSError: The folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    part, tag = folder / f"{file.name}.part", folder / f"{file.name}.part.tag"
    try:
        total = _fetch(file.address, part, tag, progress)
    except (error.URLError, http.client.HTTPException, TimeoutError, ConnectionError) as problem:
        told = problem if isinstance(problem, error.HTTPError) else None  # with its number
        reason = told or getattr(problem, "reason", None) or problem
        raise InputError(f"{file.address}: cannot be downloaded: {reason}; run it again to go on, "
                         "or download it with a browser") from None  # fmt: skip
    size = part.stat().st_size
    if total is not None and size != total:
        raise InputError(f"{file.address}: it ended after {size} of {total} bytes; run it again to "
                         "go on")  # fmt: skip
    got = sha256(part)
    if file.sha256 is not None and got != file.sha256:
        part.unlink()
        tag.unlink(missing_ok=True)
        raise InputError(
            f"{file.address}: its SHA-256 is {got}, not {file.sha256}; it is damaged or was "
            "changed, and was thrown away"
        )
    os.replace(part, folder / file.name)
    tag.unlink(missing_ok=True)
    return got


def _fetch(address: str, part: Path, tag: Path, progress: Progress) -> int | None:
    """Gets all that is missing of a file; returns its size, or None if the server does not say."""
    begun = part.stat().st_size if part.is_file() and tag.is_file() else 0
    headers = {"User-Agent": "pxi-models", "Accept-Encoding": "identity"}
    if begun:
        headers |= {"Range": f"bytes={begun}-", "If-Range": tag.read_text("utf-8")}
    try:
        answer = request.urlopen(request.Request(address, headers=headers), timeout=PATIENCE)
    except error.HTTPError as problem:
        problem.close()
        if not begun or problem.code != 416:  # 416: there is nothing after what is here
            raise
        part.unlink()
        return _fetch(address, part, tag, progress)
    with answer:
        if begun and not _continues(answer, begun):
            begun = 0
        length = answer.headers.get("Content-Length")
        total = begun + int(length) if length and length.isdecimal() else None
        version = answer.headers.get("ETag") or answer.headers.get("Last-Modified") or ""
        if version and not version.startswith("W/"):
            tag.write_text(version, "utf-8")
        else:  # nothing says whether the file is the same next time
            tag.unlink(missing_ok=True)
        with part.open("ab" if begun else "wb") as stream:
            done = begun
            while data := answer.read(CHUNK):
                stream.write(data)
                done += len(data)
                progress(done, total)
    return total


def _continues(answer: Any, begun: int) -> bool:
    """Whether an answer is the rest of a file after so many bytes, not the whole file."""
    place = re.match(r"bytes (\d+)-", answer.headers.get("Content-Range", ""))
    return answer.status == 206 and place is not None and int(place[1]) == begun
