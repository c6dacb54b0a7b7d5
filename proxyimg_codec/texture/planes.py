"""Planes of the pyramid coder: latents <-> PLAN, and the raster that they give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays, laplace, rans
from ..errors import FormatError
from ..native import kernel
from . import context, context_native, registered_model, synthesis
from .context import Ints
from .network import Floats

SHIFT_ORIGIN = 8
"""A stored shift of the scale index is greater by this."""


class Latents(NamedTuple):
    """Whole numbers that a raster is made of.

    Attributes:
        levels: int32 [9, h, w] of levels 1, 2, ..; channel 3 * colour + band.
        lowest: int32 [3, h, w].
    """

    levels: tuple[Ints, ...]
    lowest: Ints


@dataclass(frozen=True, eq=False)
class Planes:
    """Coded latents of one raster.

    Attributes:
        packed: The fields of PLAN.
        where: The chunk, for errors.
    """

    packed: Mapping[str, Any]
    where: str = "chunk PLAN"

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the raster."""
        columns, rows = self.packed["size"]
        return columns, rows

    @property
    def components(self) -> int:
        """1 grey, 3 colour."""
        return int(self.packed["components"])

    @cached_property
    def support(self) -> NDArray[np.bool_]:
        """Cells that have latents [rows, columns].

        Raises:
            FormatError: The stream is corrupt.
        """
        shape = cells_of(self.size, self.packed["cell"])
        stored = np.ones(shape, bool)
        if self.packed["support"]:
            stored = arrays.decode(self.packed["support"], (1, *shape), 1, stored)[0].astype(bool)
            if stored.all() or not stored.any():
                raise FormatError("the support is full or empty", self.where, rule="PYR-5")
        return stored

    @property
    def latents(self) -> Latents:
        """The latents, decoded anew each time: the raster is what is kept.

        Raises:
            FormatError: The stream is corrupt.
        """
        coder = _Decoder(self.packed["data"], self.packed["escapes"])
        found = _code(coder, self.packed, self.support, None)
        coder.finish(self.where)
        return found

    @cached_property
    def raster(self) -> Floats:
        """The decoded raster [rows, columns, components], in 0..1.

        Raises:
            FormatError: The stream is corrupt.
            UnsupportedError: The model is not known.
        """
        found = self.latents
        weights = registered_model.registered(self.packed["model"])
        out = synthesis.samples(weights, found.levels, found.lowest, self.packed["step"])
        columns, rows = self.size
        out = np.ascontiguousarray(out[:rows, :columns])
        if self.components == 1:
            out = np.mean(out, 2, keepdims=True, out=np.empty((rows, columns, 1), np.float32))
        out /= 255
        return np.clip(out, 0, 1, out=out)


def unpack(fields: Mapping[str, Any], where: str = "chunk PLAN") -> Planes:
    """Planes of PLAN; the streams are decoded when first needed.

    Raises:
        FormatError: The fields contradict each other.
        UnsupportedError: The model is not known.
    """
    registered_model.registered(fields["model"])
    levels, components = fields["levels"], fields["components"]
    if components == 2:
        raise FormatError("2 components: they are 1 or 3", where, rule="PYR-2")
    if fields["grey"] > levels or (components == 1 and fields["grey"] < levels):
        raise FormatError("more levels without chroma than there are levels", where, rule="PYR-2")
    if len(fields["lowest"]) != components or len(fields["shifts"]) != 2 * levels:
        raise FormatError("scales or shifts do not fit the levels", where, rule="PYR-2")
    return Planes(fields, where)


def encoded(
    latents: Latents, size: tuple[int, int], step: int, support: NDArray[np.bool_] | None = None,
    cell: int = 3, components: int = 3, number: int = 1,
    shifts: tuple[int, ...] | None = None,
) -> Planes:  # fmt: skip
    """Planes that hold latents.

    Args:
        latents: What to hold; outside the support they are taken as 0, except the lowest.
        size: Columns and rows of the raster.
        step: Quantization step, 2**(step / 64).
        support: Cells that have latents; None = all.
        cell: Side of a cell is 2**cell samples.
        components: 1 or 3.
        number: The model.
        shifts: Shift of the scale index per level: luma, chroma.

    Raises:
        ValueError: A latent is as large as `context.LIMIT`, or larger.
    """
    if any(np.abs(y).max() >= context.LIMIT for y in (*latents.levels, latents.lowest)):
        raise ValueError(context.BAD_LATENT)
    levels = len(latents.levels)
    shape = cells_of(size, cell)
    coded_support = b""
    if support is None or support.all():
        support = np.ones(shape, bool)
    else:
        coded_support = arrays.encode(support[None].astype(np.int64), 1, np.ones(shape, bool))
    grey = levels if components == 1 else 0
    while grey < levels and not latents.levels[grey][3:].any():
        grey += 1
    fields: dict[str, Any] = {
        "model": number,
        "size": list(size),
        "components": components,
        "step": step,
        "levels": levels,
        "grey": grey,
        "lowest": [_scale_of(p) for p in latents.lowest[:components]],
        "shifts": [SHIFT_ORIGIN + v for v in shifts or (0,) * (2 * levels)],
        "cell": cell,
        "support": coded_support,
    }
    coder = _Encoder()
    _code(coder, fields, support, latents)
    fields["escapes"], fields["data"] = coder.escapes(), coder.stream.finish()
    return Planes(fields)


def salvaged(planes: Planes) -> tuple[Planes, int]:
    """Planes with the levels that can be decoded of a stream that is cut off or damaged.

    A level is in vain if the stream fails in it. If it only does not end where it should, the
    finest one is: wherever the damage is, what comes last is wrong.

    Args:
        planes: As they were read; `data` may be shorter than it says.

    Returns:
        Planes with a sound stream, and how many levels they have from it; finer ones are 0. The
        same planes if nothing is wrong.

    Raises:
        FormatError: Not even the lowest planes can be decoded.
    """
    packed, support, where = planes.packed, planes.support, planes.where
    found: list[Ints] = []
    try:
        coder = _Decoder(_cut(packed["data"]), packed["escapes"])
        for latents in _steps(coder, packed, support, None):
            found.append(latents)
        coder.finish(where)
    except FormatError as error:
        if not found:
            raise FormatError(
                f"none of the planes can be decoded: {error}", where, rule=error.rule
            ) from None
    else:
        return planes, packed["levels"]
    del found[packed["levels"] :]
    count = len(found) - 1
    rows, columns = found[0].shape[1:]
    found += [
        np.zeros((9, rows << k, columns << k), np.int32) for k in range(count, packed["levels"])
    ]
    shifts = tuple(v - SHIFT_ORIGIN for v in packed["shifts"])
    sound = encoded(
        Latents(tuple(found[:0:-1]), found[0]), planes.size, packed["step"], support,
        packed["cell"], planes.components, packed["model"], shifts,
    )  # fmt: skip
    return replace(sound, where=where), count


def _cut(data: bytes) -> bytes:
    """A stream that does not promise more words than there are."""
    head = 5 + (4 << data[0] if data else 0)
    there = max(len(data) - head, 0) // 2
    words = min(int.from_bytes(data[head - 4 : head], "little"), there)
    return data[: head - 4] + words.to_bytes(4, "little") + data[head:] if there else data


def cells_of(size: tuple[int, int], cell: int) -> tuple[int, int]:
    """Rows and columns of cells of a raster."""
    return -(-size[1] >> cell), -(-size[0] >> cell)


def support_at(
    cells: NDArray[np.bool_], cell: int, size: tuple[int, int], level: int, levels: int
) -> NDArray[np.bool_]:
    """Positions of a level that have latents: those over a sample of a stored cell."""
    columns, rows = (-(-n >> levels) << levels for n in size)
    out = np.zeros((rows >> level, columns >> level), bool)
    if level < cell:
        fine = cells.repeat(1 << (cell - level), 0).repeat(1 << (cell - level), 1)
        h, w = -(-size[1] >> level), -(-size[0] >> level)
        out[:h, :w] = fine[:h, :w]
        return out
    by = level - cell
    i, j = np.nonzero(cells)
    out[i >> by, j >> by] = True
    return out


def _scale_of(plane: Ints) -> int:
    """Scale index for the differences of a lowest plane from their prediction.

    None is certain, unless all are 0.
    """
    error = np.abs(plane - (_predicted(plane) >> laplace.MEAN_BITS)).mean()
    least = laplace.CERTAIN + 1 if plane.any() else 0
    return int(np.clip(round(8 * (np.log(max(error, 1e-3)) + 4)), least, laplace.SCALES - 1))


def _predicted(plane: Ints) -> Ints:
    """Mean of the samples above and to the left, in 1/16."""
    up = np.concatenate([plane[:1] * 0, plane[:-1]])
    left = np.concatenate([plane[:, :1] * 0, plane[:, :-1]], 1)
    mean: Ints = 8 * (up + left)
    mean[0], mean[:, 0] = 16 * left[0], 16 * up[:, 0]
    return mean


class _Encoder:
    """Puts latents into a stream."""

    def __init__(self) -> None:
        self.stream = rans.Encoder()
        self._escapes: list[NDArray[np.int64]] = []

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        at = laplace.locate(mean, scale)
        there = at.row >= 0
        row, centre, shift = (v[there] for v in at)
        table = laplace.tables()
        kept = values[there]
        off = (kept >> shift) - centre
        reach = table.reach[row]
        escape = np.abs(off) > reach
        symbol = np.where(escape, 2 * reach + 1, off + reach)
        start = table.ends[row, symbol].astype(np.int64)
        self.stream.put(start, table.ends[row, symbol + 1] - start)
        deep = shift > 0
        if deep.any():
            width = rans.SCALE_BITS - shift[deep]
            low = kept[deep] & ((1 << shift[deep]) - 1)
            self.stream.put(low << width, 1 << width)
        if escape.any():
            self._escapes.append(off[escape])
        return np.where(there, values, 0)

    def level(self, at: context_native.Place, values: Ints | None) -> Ints:
        """Puts a whole level, in the compiled kernel."""
        assert values is not None
        latents, escapes = context_native.encode(at, values, self.stream)
        self._escapes.append(escapes)
        return latents

    def escapes(self) -> bytes:
        """The differences that have no symbol: zigzag, 7 bits a byte, low first."""
        out = bytearray()
        for value in np.concatenate(self._escapes).tolist() if self._escapes else ():
            n = 2 * value if value >= 0 else -2 * value - 1
            while n > 127:
                out.append(n & 127 | 128)
                n >>= 7
            out.append(n)
        return bytes(out)


class _Decoder:
    """Takes latents from a stream."""

    def __init__(self, data: bytes, escapes: bytes) -> None:
        self._stream = rans.Decoder(data)
        self._data, self._escapes, self._at = data, escapes, 0

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        at = laplace.locate(mean, scale)
        there = np.flatnonzero(at.row >= 0)
        out = np.zeros(len(mean), np.int64)
        if not len(there):
            return out
        row, centre, shift = (v[there] for v in at)
        table = laplace.tables()
        symbol = self._stream.lookup(table.ends, row)
        reach = table.reach[row]
        off = symbol - reach
        escape = np.flatnonzero(off > reach)
        deep = np.flatnonzero(shift)
        low = self._stream.raw(shift[deep]) if len(deep) else 0
        if len(escape):
            off[escape] = [self._escape() for _ in escape]
        off += centre
        off <<= shift
        off[deep] += low
        if (np.abs(off) >= context.LIMIT).any():
            raise FormatError(context.BAD_LATENT, rule="PYR-12")
        out[there] = off
        return out

    def level(self, at: context_native.Place, values: Ints | None) -> Ints:
        """Takes a whole level, in the compiled kernel."""
        latents, self._at = context_native.decode(at, self._stream, self._escapes, self._at)
        return latents

    def _escape(self) -> int:
        n = shift = 0
        while True:
            if self._at >= len(self._escapes) or shift > 21:
                raise FormatError(context.BAD_ESCAPES, rule="PYR-13")
            byte = self._escapes[self._at]
            self._at += 1
            n |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return -(n + 1) // 2 if n & 1 else n // 2

    def finish(self, where: str) -> None:
        """Checks that everything was used.

        Raises:
            FormatError: Something is left over.
        """
        self._stream.finish()
        for at, data, rule in (
            (self._at, self._escapes, "PYR-13"), (self._stream.end, self._data, "PYR-8"),
        ):  # fmt: skip
            if at != len(data):
                raise FormatError("bytes are left over after the latents", where, rule=rule)


def _code(
    coder: _Encoder | _Decoder, fields: Mapping[str, Any], cells: NDArray[np.bool_],
    values: Latents | None,
) -> Latents:  # fmt: skip
    """Codes all latents."""
    lowest, *found = _steps(coder, fields, cells, values)
    return Latents(tuple(found[::-1]), lowest)


def _steps(
    coder: _Encoder | _Decoder, fields: Mapping[str, Any], cells: NDArray[np.bool_],
    values: Latents | None,
) -> Iterator[Ints]:  # fmt: skip
    """Codes and gives the lowest planes, then each level, coarsest first."""
    weights = registered_model.registered(fields["model"])
    levels, step, size = fields["levels"], fields["step"], fields["size"]
    columns, rows = (-(-n >> levels) for n in size)
    lowest = _code_lowest(coder, fields, (rows, columns), values)
    yield lowest
    plain = lowest << 4
    parent = np.zeros((9, -(-rows // 2), -(-columns // 2)), np.int32)
    for level in range(levels, 0, -1):
        shifts = fields["shifts"][2 * level - 2 : 2 * level]
        here = context.LevelCoder(
            weights.context[min(level, registered_model.LEVEL_SETS) - 1],
            step,
            level <= fields["grey"],
            (shifts[0] - SHIFT_ORIGIN, shifts[1] - SHIFT_ORIGIN),
        )
        support = support_at(cells, fields["cell"], size, level, levels)
        given = None if values is None else values.levels[level - 1]
        if kernel.available():
            parent = coder.level(context_native.Place(here, plain, parent, support), given)
        else:
            parent = here.code(coder, plain, parent, support, given)
        yield parent
        if level > 1:
            plain = context.next_plain(plain, parent)


def _code_lowest(
    coder: context.Coder, fields: Mapping[str, Any], shape: tuple[int, int], values: Latents | None
) -> Ints:
    """Codes the lowest planes by x + y ascending, each predicted from above and left."""
    h, w = shape
    scale = np.array(fields["lowest"], np.int64)
    count = len(scale)
    out = np.zeros((3, h, w), np.int32)
    for t in range(h + w - 1):
        i = np.arange(max(t - w + 1, 0), min(t, h - 1) + 1)
        j = t - i
        up, left = out[:count, i - 1, j], out[:count, i, j - 1]
        mean = np.where(i == 0, 16 * left, np.where(j == 0, 16 * up, 8 * (up + left)))
        if t == 0:
            mean[:] = 0
        given = np.zeros((count, len(i)), np.int64)
        if values is not None:
            given[:] = values.lowest[:count, i, j]
        coded = coder.code(given.T.ravel(), mean.T.astype(np.int64).ravel(), np.tile(scale, len(i)))
        out[:count, i, j] = coded.reshape(-1, count).T
    return out
