"""Stream of latents: the lowest planes, then the levels, each in the context of those before.

`steps` goes through the stream for both `Encoder` and `Decoder`. At each place, an encoder writes
the given latents, and a decoder reads them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..entropy import laplace, rans
from ..errors import FormatError
from ..native import kernel
from . import context, context_native, registered_model
from .context import Ints
from .grid import Grid

SHIFT_ORIGIN = 8
"""Number added to a shift of the scale index when it is stored."""


class Latents(NamedTuple):
    """Integers that a raster is decoded from.

    Attributes:
        levels: int32 [9, h, w] latents of level 1, 2, and so on; channel is 3 * colour + band.
        lowest: int32 [3, h, w] lowest planes.
    """

    levels: tuple[Ints, ...]
    lowest: Ints


def encode(
    fields: Mapping[str, Any], cells: NDArray[np.bool_], latents: Latents
) -> tuple[bytes, bytes]:
    """Encodes latents.

    Args:
        fields: Values of PLAN except for the two returned.
        cells: bool [rows, columns] cells that have latents.
        latents: The latents.

    Returns:
        `data` and `escapes` of PLAN: the entropy-coded stream, and the values that have no symbol.
    """
    coder = Encoder()
    for _ in steps(coder, fields, cells, latents):
        pass
    return coder.stream.finish(), coder.escapes()


def decode(fields: Mapping[str, Any], cells: NDArray[np.bool_], where: str) -> Latents:
    """Decodes latents.

    Args:
        fields: Values of PLAN.
        cells: bool [rows, columns] cells that have latents.
        where: Name of the chunk in error messages.

    Raises:
        FormatError: The stream is corrupt.
        UnsupportedError: The model is unknown.
    """
    coder = Decoder(fields["data"], fields["escapes"])
    lowest, *found = steps(coder, fields, cells, None)
    coder.finish(where)
    return Latents(tuple(found[::-1]), lowest)


def steps(
    coder: Encoder | Decoder, fields: Mapping[str, Any], cells: NDArray[np.bool_],
    values: Latents | None,
) -> Iterator[Ints]:  # fmt: skip
    """Codes the lowest planes, then each level, the coarsest first.

    Args:
        coder: The encoder or decoder.
        fields: Values of PLAN.
        cells: bool [rows, columns] cells that have latents.
        values: Latents to encode; None for a decoder.

    Yields:
        The lowest planes, int32 [3, h, w], then the latents of each level, int32 [9, h, w].

    Raises:
        FormatError: The stream is corrupt.
        UnsupportedError: The model is unknown.
    """
    weights = registered_model.registered(fields["model"])
    grid, step = Grid.of(fields), fields["step"]
    rows, columns = grid.at(grid.levels)
    lowest = _code_lowest(coder, fields, (rows, columns), values)
    yield lowest
    plain = lowest << 4
    parent = np.zeros((9, -(-rows // 2), -(-columns // 2)), np.int32)
    for level in range(grid.levels, 0, -1):
        shifts = fields["shifts"][2 * level - 2 : 2 * level]
        here = context.LevelCoder(
            weights.context[min(level, registered_model.LEVEL_SETS) - 1],
            step,
            level <= fields["grey"],
            (shifts[0] - SHIFT_ORIGIN, shifts[1] - SHIFT_ORIGIN),
        )
        bands = grid.bands(cells, fields["cell"], level)
        given = None if values is None else values.levels[level - 1]
        if kernel.available():
            parent = coder.level(context_native.Place(here, plain, parent, bands), given)
        else:
            parent = here.code(coder, plain, parent, bands, given)
        yield parent
        if level > 1:
            plain = context.next_plain(plain, parent, grid.at(level - 1))


def _code_lowest(
    coder: context.Coder, fields: Mapping[str, Any], shape: tuple[int, int], values: Latents | None
) -> Ints:
    """Codes the lowest planes by ascending x + y, each value predicted from above and left."""
    if isinstance(coder, Decoder) and kernel.available():
        return coder.lowest(fields["lowest"], shape)
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


class Encoder:
    """Writes latents to a stream."""

    def __init__(self) -> None:
        self.stream = rans.Encoder()
        self._escapes: list[NDArray[np.int64]] = []

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Writes a set of latents.

        Args:
            values: int64 [N] latents.
            mean: int64 [N] predicted means in 1/16.
            scale: int64 [N] scale indices.

        Returns:
            int64 [N] latents as a decoder reads them: 0 where a latent is certain and is not coded.
        """
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
        """Writes a whole level with the compiled kernel; returns its latents as decoded."""
        assert values is not None, "an encoder is given what to put"
        latents, escapes = context_native.encode(at, values, self.stream)
        self._escapes.append(escapes)
        return latents

    def escapes(self) -> bytes:
        """Differences that have no symbol, zigzag-coded, 7 bits a byte, the low bits first."""
        out = bytearray()
        for value in np.concatenate(self._escapes).tolist() if self._escapes else ():
            n = 2 * value if value >= 0 else -2 * value - 1
            while n > 127:
                out.append(n & 127 | 128)
                n >>= 7
            out.append(n)
        return bytes(out)


class Decoder:
    """Reads latents from a stream.

    Args:
        data: The entropy-coded stream, `data` of PLAN.
        escapes: The values that have no symbol, `escapes` of PLAN.

    Raises:
        FormatError: The stream is truncated or corrupt.
    """

    def __init__(self, data: bytes, escapes: bytes) -> None:
        self._stream = rans.Decoder(data)
        self._data, self._escapes, self._at = data, escapes, 0

    def code(
        self, values: NDArray[np.int64], mean: NDArray[np.int64], scale: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Reads a set of latents.

        Args:
            values: Ignored; it is there because an encoder has it.
            mean: int64 [N] predicted means in 1/16.
            scale: int64 [N] scale indices.

        Returns:
            int64 [N] latents.

        Raises:
            FormatError: The stream is corrupt.
        """
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

    def lowest(self, scales: list[int], shape: tuple[int, int]) -> Ints:
        """Reads the lowest planes with the compiled kernel: int32 [3, h, w].

        Raises:
            FormatError: The stream is corrupt.
        """
        planes, self._at = context_native.decode_lowest(
            scales, shape, self._stream, self._escapes, self._at
        )
        return planes

    def level(self, at: context_native.Place, values: Ints | None) -> Ints:
        """Reads a whole level with the compiled kernel; `values` is ignored.

        Raises:
            FormatError: The stream is corrupt.
        """
        latents, self._at = context_native.decode(at, self._stream, self._escapes, self._at)
        return latents

    def _escape(self) -> int:
        """Reads a value that has no symbol."""
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
        """Checks that the stream and the escapes are used up.

        Raises:
            FormatError: Something is left over.
        """
        self._stream.finish()
        for at, data, rule in (
            (self._at, self._escapes, "PYR-13"), (self._stream.end, self._data, "PYR-8"),
        ):  # fmt: skip
            if at != len(data):
                raise FormatError("bytes are left over after the latents", where, rule=rule)
