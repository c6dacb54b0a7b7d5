"""Complete check of a file: every chunk, every stream, and oddities that are not errors.

Errors have the id of the broken statement of the specification; oddities have codes of their own
(`warnings`). An error ends the check of its chunk, and of everything that cannot be understood
without it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from ..codec.levels import Usage, profile, refined
from ..container import file, layr, meta, plan, undo
from ..container.chunks import Chunk, read, read_damaged
from ..container.content import Container, Values
from ..errors import FormatError, PxiError
from ..geometry import warp
from ..limits import DEFAULT_LIMITS, Budget, Limits
from ..model import Layer, Picture
from ..render.neighbours import present_outline
from . import warnings
from .findings import NO_MEMORY, REFUSED, Findings
from .streams import Streams, latents
from .warnings import ERROR, Issue

HISTORY_CHUNKS, HISTORY_VALUES = 1 << 20, 1 << 26
"""Most chunks of all states of a history, and most values in their streams, that are checked."""

DRAWN = 256
"""Samples in the longer side of the trial drawing that finds how often a bent layer overlaps."""

_END = Chunk("TAIL", b"")


class Report(NamedTuple):
    """Result of the check of a file.

    Attributes:
        issues: Errors, then warnings, then notes, each by their offset in the file. The file is
            valid if there are no errors.
        profile: One of `levels.PROFILES`; None if the file is not valid.
        level: 1..3; None if the file is not valid, or above all levels.
    """

    issues: list[Issue]
    profile: str | None
    level: int | None


def validate(data: bytes, limits: Limits = DEFAULT_LIMITS) -> list[Issue]:
    """Checks a file; returns the issues of `report`."""
    return report(data, limits).issues


def report(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Report:
    """Checks a file completely.

    Args:
        data: The file.
        limits: Limits; a file that exceeds them has an error.
    """
    check = _Check(limits)
    check.file(data)
    order = (ERROR, warnings.WARNING, warnings.NOTE)
    found = check.findings
    issues = sorted(found.issues, key=lambda v: (order.index(v.severity), v.offset or 0))
    if found.failed:
        return Report(issues, None, None)
    return Report(issues, check.profile, check.usage.level)


class _Check:
    """Check of one file.

    Attributes:
        findings: The issues that were found.
        profile: Profile of the file, if its chunks fit together.
        usage: Budget that the file has spent, without its history.
    """

    def __init__(self, limits: Limits) -> None:
        self.findings = Findings()
        self.profile: str | None = None
        self.usage = Usage(limits)
        self._limits, self._intact = limits, True
        self._streams = Streams(self.findings, limits)
        # Values of the chunks of the file and its history, so that equal chunks are parsed once.
        self._values: dict[tuple[str, bytes], Values] = {}

    def file(self, data: bytes) -> None:
        """Checks the whole file."""
        chunks, wrong = self._chunks(data)
        complete = bool(chunks) and chunks[-1].type == _END.type
        numbers: Counter[str] = Counter()
        sound = []
        for k, chunk in enumerate(chunks):
            number = numbers[chunk.type]
            numbers[chunk.type] += 1
            self.findings.offsets[chunk.type, number] = chunk.offset
            if k in wrong:
                self.findings.report(wrong[k], chunk.type, number)
            elif self.findings.attempt(partial(self._payload, chunk, chunks), chunk.type, number):
                sound.append(chunk)
                continue
            complete &= not chunk.critical
        content = None
        if complete:
            content = self.findings.attempt(
                partial(file.assemble, sound, self.usage, self._values_of)
            )
        if content is not None:
            self.profile = profile(content)
            self._picture(content)
            if not self.findings.failed:
                self.findings.issues += warnings.old((data[8], data[9]))
            self._history(content.history)

    def _chunks(self, data: bytes) -> tuple[list[Chunk], dict[int, FormatError]]:
        """Chunks that can be recognized, and errors in their framing by position in the list."""
        try:
            return read(data, self.usage), {}
        except REFUSED as error:
            first = error
        self._intact = False
        chunks: list[Chunk] = []
        wrong: dict[int, FormatError] = {}
        with suppress(*REFUSED):
            chunks, cut = read_damaged(data, Budget(self._limits))
            for k in cut:
                wrong[k] = FormatError("CRC mismatch: the file is damaged", rule="CON-6")
                if cut[k]:
                    wrong[k] = FormatError("the file ends in the chunk", rule="CON-7")
        if getattr(first, "offset", None) not in [chunks[k].offset for k in wrong]:
            self.findings.report(first)
        return chunks, wrong

    def _values_of(self, chunk: Chunk) -> Values:
        """Values of the fields of a chunk, parsed once."""
        key = chunk.type, chunk.payload
        if key not in self._values:
            self._values[key] = file.values(chunk)
        return self._values[key]

    def _payload(self, chunk: Chunk, chunks: Sequence[Chunk]) -> bool:
        """Checks a chunk by itself; always returns True.

        Raises:
            FormatError, UnsupportedError, LimitError: The chunk is refused.
        """
        if file.fields_of(chunk):
            self._values_of(chunk)
        if chunk.type in meta.BLOCKS.values():
            meta.decompress(chunk, "", Budget(self._limits))
        if chunk.type == undo.TYPE:
            present = [c for c in chunks if c.type not in (undo.TYPE, _END.type)]
            undo.decode(chunk, present, "", Budget(self._limits))
            state = undo.digest(present, chunk.old)
            if self._intact and self._values_of(chunk)["state"] != state:
                self.findings.issues.append(
                    warnings.warning("VAL-2", "it is ignored", undo.TYPE, chunk.offset)
                )
        return True

    def _picture(self, c: Container) -> None:
        """Decodes the whole picture; checks the cost of drawing it, and looks for oddities."""
        try:
            picture = refined(c, self.usage)
        except (*REFUSED, MemoryError) as error:
            self._streams.decode(c)  # finds all errors, not only the first
            if not self.findings.failed:
                self.findings.report(error if isinstance(error, PxiError) else NO_MEMORY)
            return
        for number, own in enumerate(picture.planes):
            self.findings.attempt(partial(latents, own), plan.TYPE, number)
        self._streams.keep(c, picture)
        if self.findings.failed:
            return
        self.findings.attempt(
            partial(self._limits.check, "output_pixels", picture.width * picture.height)
        )
        for i, layer in enumerate(picture.layers):
            self.findings.attempt(partial(self._drawing, picture, layer), layr.TYPE, i)
        if not self.findings.failed:
            self.findings.issues += warnings.find(picture, c, self.findings.place)

    def _drawing(self, picture: Picture, layer: Layer) -> None:
        """Checks the cost of drawing a bent layer, at a small size."""
        _ = present_outline(picture, layer)
        bent = warp.Warp(layer.pose, layer.mesh, layer.sampling in (1, 2), Budget(self._limits))
        if bent.meshed:
            scale = min(DRAWN / max(picture.width, picture.height), 1)
            box = (
                0,
                0,
                max(round(picture.width * scale), 1),
                max(round(picture.height * scale), 1),
            )
            bent.faces(np.zeros(2), np.full(2, scale), box)

    def _history(self, history: Sequence[undo.Step]) -> None:
        """Checks the states of a history, the latest first, until one has an issue."""
        issues = self.findings.issues
        self._streams.budget, chunks, found = HISTORY_VALUES, 0, len(issues)
        for number, step in reversed([*enumerate(history, 1)]):
            chunks += len(step.chunks)
            if chunks <= HISTORY_CHUNKS:
                self.findings.state = f"the state before edit {number}"
                self._state(step)
            if chunks > HISTORY_CHUNKS or self._streams.budget < 0:
                detail = f"only back to edit {number} of {len(history)}"
                place = self.findings.place(undo.TYPE, 0)
                issues.append(warnings.warning("VAL-11", detail, *place))
            if len(issues) > found:
                return

    def _state(self, step: undo.Step) -> None:
        """Checks one state of the history."""
        if any(c.type == undo.TYPE for c in step.chunks):
            self.findings.report(FormatError("it has a history itself", rule="MET-16"))
        chunks, budget = [*step.chunks, _END], Budget(self._limits)
        content = self.findings.attempt(partial(file.assemble, chunks, budget, self._values_of))
        if content is not None:
            self._streams.decode(content)
