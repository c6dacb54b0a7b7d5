"""Checks a file completely: every chunk, every stream, and what is odd without being wrong.

Errors have the id of the broken statement of the specification; what is odd has codes of its own
(`warnings`). An error stops the check of its chunk, and of what cannot be understood without it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from math import inf, prod
from typing import Any, NamedTuple

import numpy as np

from ..codec import unpack
from ..codec.levels import Usage, profile, refined
from ..container import file, layr, mesh, meta, motn, netw, plan, pose, texr, undo
from ..container.chunks import Chunk, read, read_damaged
from ..container.content import Container, Values
from ..errors import FormatError, LimitError, PxiError, UnsupportedError
from ..geometry import boundary, warp
from ..geometry import pose as poses
from ..geometry.mesh import Mesh
from ..limits import DEFAULT_LIMITS, Budget, Limits
from ..model import Layer, Picture
from ..render.neighbours import present_outline
from ..texture import implicit, network, planes, pyramid
from . import warnings
from .warnings import ERROR, Issue

HISTORY_CHUNKS, HISTORY_VALUES = 1 << 20, 1 << 26
"""Chunks of all states of a history, and values in their streams, that are checked at most."""

DRAWN = 256
"""Samples a side at which it is tried how often a bent layer covers itself."""

_END = Chunk("TAIL", b"")
_NUMBERED = (layr.TYPE, mesh.TYPE, pose.TYPE, netw.TYPE, plan.TYPE, texr.TYPE)
_REFUSED = (FormatError, UnsupportedError, LimitError)
_NO_MEMORY = LimitError("there is not enough memory for it")


class Report(NamedTuple):
    """What is known of a file.

    Attributes:
        issues: What is wrong, and what is odd: errors, then warnings, then notes, each by their
            place in the file. It is valid if nothing of that is an error.
        profile: One of `levels.PROFILES`; None if the file is not valid.
        level: 1..3; None if the file is not valid, or above all levels.
    """

    issues: list[Issue]
    profile: str | None
    level: int | None


def validate(data: bytes, limits: Limits = DEFAULT_LIMITS) -> list[Issue]:
    """What is wrong with a file, and what is odd: `Report.issues` of `report`."""
    return report(data, limits).issues


def report(data: bytes, limits: Limits = DEFAULT_LIMITS) -> Report:
    """Checks a file.

    Args:
        data: The file.
        limits: What exceeds them is an error.
    """
    check = _Check(limits)
    check.file(data)
    order = (ERROR, warnings.WARNING, warnings.NOTE)
    issues = sorted(check.issues, key=lambda v: (order.index(v.severity), v.offset or 0))
    if check.failed:
        return Report(issues, None, None)
    return Report(issues, check.profile, check.usage.level)


class _Check:
    """The check of one file.

    Attributes:
        issues: What was found.
        profile: That of the file, if its chunks fit together.
        usage: What was spent on the file, without its history.
    """

    def __init__(self, limits: Limits) -> None:
        self.issues: list[Issue] = []
        self.profile: str | None = None
        self.usage = Usage(limits)
        self._limits = limits
        self._offsets: dict[tuple[str, int], int | None] = {}
        # What chunks of the file and its history hold, and what that decodes to, by identity.
        self._values: dict[tuple[str, bytes], Values] = {}
        self._results: dict[tuple[int, ...], Any] = {}
        self._state, self._intact = "", True
        self._budget: float = inf

    def file(self, data: bytes) -> None:
        """Checks all of it."""
        chunks, wrong = self._chunks(data)
        complete = bool(chunks) and chunks[-1].type == _END.type
        numbers: Counter[str] = Counter()
        sound = []
        for k, chunk in enumerate(chunks):
            number = numbers[chunk.type]
            numbers[chunk.type] += 1
            self._offsets[chunk.type, number] = chunk.offset
            if k in wrong:
                self._report(wrong[k], chunk.type, number)
            elif self._try(partial(self._payload, chunk, chunks), chunk.type, number):
                sound.append(chunk)
                continue
            complete &= not chunk.critical
        content = None
        if complete:
            content = self._try(partial(file.assemble, sound, self.usage, self._values_of))
        if content is not None:
            self.profile = profile(content)
            self._picture(content)
            if not self.failed:
                self.issues += warnings.old((data[8], data[9]))
            self._history(content.history)

    @property
    def failed(self) -> bool:
        """Whether an error was found."""
        return any(issue.severity == ERROR for issue in self.issues)

    def _chunks(self, data: bytes) -> tuple[list[Chunk], dict[int, FormatError]]:
        """All chunks that can be told, and what is wrong with the frames of some."""
        try:
            return read(data, self.usage), {}
        except _REFUSED as error:
            first = error
        self._intact = False
        chunks: list[Chunk] = []
        wrong: dict[int, FormatError] = {}
        with suppress(*_REFUSED):
            chunks, cut = read_damaged(data, Budget(self._limits))
            for k in cut:
                wrong[k] = FormatError("CRC mismatch: the file is damaged", rule="CON-6")
                if cut[k]:
                    wrong[k] = FormatError("the file ends in the chunk", rule="CON-7")
        if getattr(first, "offset", None) not in [chunks[k].offset for k in wrong]:
            self._report(first)
        return chunks, wrong

    def _place(self, type_: str, number: int) -> tuple[str, int | None]:
        """How a chunk is called, and where it is."""
        name = f"{type_} {number}" if type_ in _NUMBERED else type_
        return name, self._offsets.get((type_, number))

    def _report(self, error: PxiError, type_: str = "", number: int = 0) -> None:
        """Adds an error of a chunk, or of what the error itself names."""
        code, message = error.rule, getattr(error, "problem", str(error))
        if type_:
            name, offset = self._place(type_, number)
        else:
            name = getattr(error, "where", "").removeprefix("chunk ")
            offset = getattr(error, "offset", None)
            if offset is None and (name, 1) not in self._offsets:
                offset = self._offsets.get((name, 0))
        if self._state:
            message = f"{self._state}: {f'chunk {name}: ' if name else ''}{message}"
            name, offset = self._place(undo.TYPE, 0)
        self.issues.append(Issue(code, ERROR, message, name, offset, error.exit_code))

    def _try(self, work: Callable[[], Any], type_: str = "", number: int = 0) -> Any:
        """What `work` gives; None if it fails, which is reported."""
        try:
            return work()
        except _REFUSED as error:
            self._report(error, type_, number)
        except MemoryError:
            self._report(_NO_MEMORY, type_, number)
        return None

    def _values_of(self, chunk: Chunk) -> Values:
        key = chunk.type, chunk.payload
        if key not in self._values:
            self._values[key] = file.values(chunk)
        return self._values[key]

    def _payload(self, chunk: Chunk, chunks: Sequence[Chunk]) -> bool:
        """Checks a chunk by itself; always True."""
        if file.fields_of(chunk):
            self._values_of(chunk)
        if chunk.type in meta.BLOCKS.values():
            meta.decompress(chunk, "", Budget(self._limits))
        if chunk.type == undo.TYPE:
            present = [c for c in chunks if c.type not in (undo.TYPE, _END.type)]
            undo.decode(chunk, present, "", Budget(self._limits))
            state = undo.digest(present, chunk.old)
            if self._intact and self._values_of(chunk)["state"] != state:
                self.issues.append(
                    warnings.warning("VAL-2", "it is ignored", undo.TYPE, chunk.offset)
                )
        return True

    def _once(
        self, type_: str, number: int, cost: int, work: Callable[[], Any], *parts: object
    ) -> Any:
        """What a chunk decodes to, once for the same `parts`; None if that fails.

        The history may hold as many chunks as it likes: `cost` is what their streams hold.
        """
        key = tuple(map(id, parts))
        if key not in self._results:
            self._budget -= cost
            if self._budget < 0:
                return None
            self._results[key] = self._try(work, type_, number)
        return self._results[key]

    def _streams(self, c: Container) -> None:
        """Decodes all streams of a container."""
        budget = Budget(self._limits)
        for i, v in enumerate(c.layers):
            self._once(layr.TYPE, i, sum(v["segments"]), partial(boundary.decode, v, ""), v)
        meshes = {
            v["layer"]: self._once(mesh.TYPE, i, v["gates"] << 6, partial(_mesh, v, budget), v)
            for i, v in enumerate(c.meshes)
        }
        for i, v in enumerate(c.poses):
            own = meshes.get(v["layer"])
            if own is not None or v["layer"] not in meshes:
                cost = 1 if own is None else 4 * len(own.refined.nodes)
                self._once(pose.TYPE, i, cost, partial(poses.decode, v, own, ""), v, own)
        nets = [
            self._once(
                netw.TYPE, i, v["hidden"] * (v["depth"] * v["hidden"] + v["dim"] * 25),
                partial(network.unpack, v, ""), v,
            )
            for i, v in enumerate(c.networks)
        ]  # fmt: skip
        rasters = [
            self._once(
                plan.TYPE, i, 3 * prod(n + (1 << v["levels"]) for n in v["size"]),
                partial(_planes, v), v,
            )
            for i, v in enumerate(c.planes)
        ]  # fmt: skip
        self._textures(c, nets, rasters)
        if c.motion is not None:
            moving = [meshes[n] for n in c.motion["layers"]]
            if all(m is not None for m in moving):
                nodes = sum(len(m.refined.nodes) for m in moving)
                cost = c.motion["modes"] * (len(moving) * (c.motion["intervals"] + 3) + 2 * nodes)
                work = partial(unpack.motion, c.motion, meshes, budget)
                self._once(motn.TYPE, 0, cost, work, c.motion, *moving)

    def _textures(self, c: Container, nets: list[Any], rasters: list[Any]) -> None:
        for i, v in enumerate(c.textures):
            if v["coder"] == texr.IMPLICIT:
                sampling = c.layers[i]["sampling"]
                sources = [nets[v["network"]]]
                cost = prod(v["grid"]) * c.networks[v["network"]]["dim"]
                work: Callable[[], Any] = partial(implicit.unpack, v, tuple(nets), "", sampling)
                parts: list[object] = [v, *sources, sampling == 1]
            elif v["coder"] == texr.PYRAMID:
                sources = [rasters[k] for k in (v["planes"], v["alpha"] - 1) if k >= 0]
                cost = prod(texr.mask_shape(v)) if v["mask"] else 1
                work = partial(pyramid.unpack, v, rasters, "")
                parts = [v, *sources]
            else:
                continue
            if None not in sources:
                self._once(texr.TYPE, i, cost, work, *parts)

    def _picture(self, c: Container) -> None:
        """Decodes all of the picture, and tries what it takes to show it, and what is odd."""
        try:
            picture = refined(c, self.usage)
        except (*_REFUSED, MemoryError) as error:
            self._streams(c)  # finds all that is wrong, not only what was met first
            if not self.failed:
                self._report(error if isinstance(error, PxiError) else _NO_MEMORY)
            return
        for number, own in enumerate(picture.planes):
            self._try(partial(getattr, own, "latents"), plan.TYPE, number)
        self._keep(c, picture)
        if self.failed:
            return
        self._try(partial(self._limits.check, "output_pixels", picture.width * picture.height))
        for i, layer in enumerate(picture.layers):
            self._try(partial(self._drawing, picture, layer), layr.TYPE, i)
        if not self.failed:
            self.issues += warnings.find(picture, c, self._place)

    def _keep(self, c: Container, picture: Picture) -> None:
        """Keeps what the chunks of the picture decode to, for states of the history."""
        meshes = [picture.layers[v["layer"]].mesh for v in c.meshes]
        pairs = [
            *zip(c.layers, [v.boundary for v in picture.layers], strict=True),
            *zip(c.meshes, meshes, strict=True),
            *zip(c.networks, picture.networks, strict=True),
            *zip(c.planes, picture.planes, strict=True),
        ]
        self._results |= {(id(values),): own for values, own in pairs}
        for v, layer in zip(c.textures, picture.layers, strict=True):
            if v["coder"] == texr.IMPLICIT:
                key = id(v), id(picture.networks[v["network"]]), id(layer.sampling == 1)
                self._results[key] = layer.texture
            elif v["coder"] == texr.PYRAMID:
                sources = (picture.planes[k] for k in (v["planes"], v["alpha"] - 1) if k >= 0)
                self._results[id(v), *map(id, sources)] = layer.texture

    def _drawing(self, picture: Picture, layer: Layer) -> None:
        """Tries what bent layers cost, at a small size."""
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
        """Checks the states of a history, the latest first, up to one that is wrong."""
        self._budget, chunks, found = HISTORY_VALUES, 0, len(self.issues)
        for number, step in reversed([*enumerate(history, 1)]):
            chunks += len(step.chunks)
            if chunks <= HISTORY_CHUNKS:
                self._state = f"the state before edit {number}"
                if any(c.type == undo.TYPE for c in step.chunks):
                    self._report(FormatError("it has a history itself", rule="MET-16"))
                budget = Budget(self._limits)
                work = partial(file.assemble, [*step.chunks, _END], budget, self._values_of)
                content = self._try(work)
                if content is not None:
                    self._streams(content)
            if chunks > HISTORY_CHUNKS or self._budget < 0:
                detail = f"only back to edit {number} of {len(history)}"
                self.issues.append(warnings.warning("VAL-11", detail, *self._place(undo.TYPE, 0)))
            if len(self.issues) > found:
                return


def _mesh(values: Values, budget: Budget) -> Mesh:
    own = Mesh({k: v for k, v in values.items() if k != "layer"}, "", budget)
    _ = own.refined
    return own


def _planes(values: Values) -> planes.Planes:
    own = planes.unpack(values, "")
    _ = own.latents
    return own
