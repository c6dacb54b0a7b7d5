"""Decoder commands, run as processes with limits on time and memory."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .judge import Decoder, Digester, Ended

_FILE_BYTES = 1 << 28
_MESSAGE_BYTES = 2000

# Data is limited rather than address space: some runtimes reserve much more of that than they use.
_LIMITED = """
import os, resource, sys
def cap(what, value):
    hard = resource.getrlimit(what)[1]
    value = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(what, (value, value))
cap(resource.RLIMIT_DATA, int(sys.argv[1]))
cap(resource.RLIMIT_FSIZE, int(sys.argv[2]))
cap(resource.RLIMIT_CORE, 0)
try:
    os.execvp(sys.argv[3], sys.argv[3:])
except OSError as error:
    sys.exit(f"{sys.argv[3]}: {error.strerror}")
"""


def expand(template: str, source: Path, target: Path, flags: Sequence[str]) -> list[str]:
    """Words of a command, with ``{in}``, ``{out}`` and ``{args}`` filled in.

    Args:
        template: The command, quoted as for a shell.
        source: Path of the input.
        target: Path of the output.
        flags: Words in place of ``{args}``.

    Raises:
        ValueError: The template lacks one of the three, or its quotes do not match.
    """
    words = shlex.split(template)
    if "{args}" not in words or any(
        not any(name in word for word in words) for name in ("{in}", "{out}")
    ):
        raise ValueError("the decoder command must contain {in}, {out} and, as a word, {args}")
    out: list[str] = []
    for word in words:
        if word == "{args}":
            out += flags
        else:
            out.append(word.replace("{in}", str(source)).replace("{out}", str(target)))
    return out


def command_decoder(template: str, timeout: float, memory: int) -> Decoder:
    """Creates a decoder that runs a command.

    Args:
        template: Words with ``{in}``, ``{out}`` and ``{args}``, quoted as for a shell.
        timeout: Seconds after which it is killed, with all its children.
        memory: Bytes of data that each of its processes may hold.
    """

    def decode(source: Path, target: Path, flags: Sequence[str]) -> Ended:
        return _run(expand(template, source, target, flags), timeout, memory, "stderr")

    return decode


def command_digester(template: str, timeout: float, memory: int) -> Digester:
    """Creates a digester that runs a command, which prints the hash of the latents of a file.

    Args:
        template: Words with ``{in}``, quoted as for a shell.
        timeout: Seconds after which it is killed, with all its children.
        memory: Bytes of data that each of its processes may hold.
    """

    def digest(source: Path) -> Ended:
        words = [word.replace("{in}", str(source)) for word in shlex.split(template)]
        return _run(words, timeout, memory, "stdout")

    return digest


def _run(words: Sequence[str], timeout: float, memory: int, kept: str) -> Ended:
    """Runs a command; returns its end, with the last part of its ``stdout`` or ``stderr``."""
    limited = [sys.executable, "-ISc", _LIMITED, str(memory), str(_FILE_BYTES), *words]
    with tempfile.TemporaryFile() as said:
        outputs: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(
            limited, stdin=subprocess.DEVNULL, start_new_session=True, **outputs | {kept: said}
        )
        try:
            code = process.wait(timeout)
        except subprocess.TimeoutExpired:
            return Ended(None, f"killed after {timeout:g} s")
        finally:
            if process.returncode is None:
                _kill(process)
        said.seek(max(said.seek(0, os.SEEK_END) - _MESSAGE_BYTES, 0))
        return Ended(code, said.read().decode("utf-8", "replace"))


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kills a process that still runs, and its children."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
