"""Work of one worker: making the output of one input, unless it is made already."""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import logging
import os
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from ...errors import InputError
from ..common import failure
from ..places import check_target
from ..signals import ending
from . import records

Work = Callable[[argparse.Namespace], dict[str, Any]]
"""Makes one output, and returns what there is to tell of it, as JSON can hold it."""

MADE, SAME, FAILED = "made", "same", "failed"
"""Outputs are made, are there already and the same as they would be, or have failed."""


@dataclass(frozen=True)
class Job:
    """One output to be made; it can be pickled.

    Attributes:
        place: Number of the input, from 0.
        work: Function that makes an output.
        args: Command line for one input, with `input` and `output`.
        out: Folder of the outputs.
        recipe: Hash of the settings.
        batch: Name of this run.
    """

    place: int
    work: Work
    args: argparse.Namespace
    out: str
    recipe: str
    batch: str


@dataclass(frozen=True)
class Outcome:
    """Result of a job.

    Attributes:
        place: Number of the input, from 0.
        state: `MADE`, `SAME` or `FAILED`.
        report: What the tool tells of the output; empty if it failed.
        notes: Warnings.
        error: Why it failed, or empty.
        code: Exit code that belongs to it.
        seconds: Time that it took.
    """

    place: int
    state: str
    report: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    error: str = ""
    code: int = 0
    seconds: float = 0.0


def perform(job: Job) -> Outcome:
    """Does a job, whatever happens to it, so that one bad picture ends no batch of a thousand."""
    started = time.perf_counter()
    notes: list[str] = []
    try:
        with _collected(notes), ending():
            state, report = _made(job)
        outcome = Outcome(job.place, state, report)
    except Exception as error:  # a bug too is told of, and the other pictures are made
        code, told = failure(error) or (1, _bug(error))
        told = told if job.args.input in told else f"{job.args.input}: {told}"
        outcome = Outcome(job.place, FAILED, error=told, code=code)
    seconds = round(time.perf_counter() - started, 3)
    return replace(outcome, notes=tuple(notes), seconds=seconds)


def _bug(error: Exception) -> str:
    """Text about an error that nobody expects, and where it was raised, in one line."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{os.path.basename(place.filename)}, line {place.lineno}"
    return f"please report this bug: {type(error).__name__}: {error} ({where})"


def _made(job: Job) -> tuple[str, dict[str, Any]]:
    """Makes an output, or finds that it is there: its state and report."""
    args = job.args
    output = str(args.output)
    # What cannot be hashed, such as a URL, counts as another input in another batch.
    content = _digest(args.input) or job.batch
    key = hashlib.sha256(f"{job.recipe} {content}".encode()).hexdigest()
    old = records.read(job.out, output)
    exists = os.path.exists(output)
    # Whatever stands under the name of an output that was begun came of this tool.
    ours = old is not None and exists and old.digest in (None, _digest(output))
    again = old is not None and (args.resume or old.batch == job.batch)
    if old is not None and ours and again and old.key == key and old.digest is not None:
        return MADE if old.batch == job.batch else SAME, old.report or {}
    force = args.force or (ours and again)
    if exists and not force and old is not None and ours:
        raise InputError(f"{output}: exists already; --resume goes on with an earlier batch, "
                         "--force makes all anew")  # fmt: skip
    check_target(output, force, *args.inputs)
    records.write(job.out, output, records.Record(key, job.batch))
    report = job.work(argparse.Namespace(**{**vars(args), "force": force}))
    done = records.Record(key, job.batch, _digest(output), report)
    records.write(job.out, output, done)
    return MADE, report


def _digest(path: str) -> str | None:
    """Hash of a file or folder; None if it cannot be read, about which others tell."""
    try:
        return records.digest_of(path)
    except OSError:
        return None


class _Notes(logging.Handler):
    """Handler that collects the warnings of one thread."""

    def __init__(self, notes: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._notes, self._thread = notes, threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread == self._thread:
            self._notes.append(record.getMessage())


@contextlib.contextmanager
def _collected(notes: list[str]) -> Iterator[None]:
    """Collects what the package logs as warnings, instead of passing it on."""
    log, handler = logging.getLogger("proxyimg_codec"), _Notes(notes)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
