"""Running a decoder command as a process with caps on time and memory."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .judge import Decoder, Ended

_FILE_BYTES = 1 << 28
_MESSAGE_BYTES = 2000

# Caps data rather than address space, of which some runtimes reserve much more than they use.
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
    """The words of a command with ``{in}``, ``{out}`` and ``{args}`` filled in.

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
    """A decoder that is a command.

    Args:
        template: Words with ``{in}``, ``{out}`` and ``{args}``, quoted as for a shell.
        timeout: Seconds after which it is killed, with all its children.
        memory: Bytes of data that each of its processes may hold.
    """

    def decode(source: Path, target: Path, flags: Sequence[str]) -> Ended:
        words = expand(template, source, target, flags)
        limited = [sys.executable, "-ISc", _LIMITED, str(memory), str(_FILE_BYTES), *words]
        with tempfile.TemporaryFile() as errors:
            process = subprocess.Popen(
                limited, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
                start_new_session=True,
            )  # fmt: skip
            try:
                code = process.wait(timeout)
            except subprocess.TimeoutExpired:
                return Ended(None, f"killed after {timeout:g} s")
            finally:
                if process.returncode is None:
                    _kill(process)
            errors.seek(max(errors.seek(0, os.SEEK_END) - _MESSAGE_BYTES, 0))
            return Ended(code, errors.read().decode("utf-8", "replace"))

    return decode


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Ends a process that still runs, and its children."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
