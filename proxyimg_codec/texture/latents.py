"""Stream of latents: the lowest planes, then the levels, each in the context of those before.

The same code serves `Encoder` and `Decoder`: at each place, an encoder writes the given latents,
and a decoder reads them. Fine levels may be coded in tiles, each with a stream of its own, so that
`decoding` can begin at any of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..entropy import laplace, rans
from ..errors import FormatError
from ..native import kernel
from . import context, context_native
from .context import Ints, Place
from .grid import Grid


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
        `data` and `escapes` of PLAN: the entropy-coded streams, and the values of the first one
        that have no symbol.
    """
    coder, grid, tiles = Encoder(), Grid.of(fields), []
    lowest = code_lowest(coder, fields, grid.at(grid.levels), latents)
    plain, parent = lowest << 4, above(grid)
    for level in range(grid.levels, 0, -1):
        given = latents.levels[level - 1]
        here = Place.of(fields, level, plain, parent, grid.bands(cells, fields["cell"], level))
        if windows := grid.tiles(level, fields["tile"]):
            parent = np.zeros_like(given)
            for window in windows:
                if here.bands[window.at].any():
                    part, outer = here.tile(window)
                    own = Encoder()
                    coded = own.level(part, given[:, *outer.at])
                    parent[:, *window.at] = coded[:, *window.inside(outer).at]
                    tiles.append(own.tile())
        else:
            parent = coder.level(here, given)
        if level > 1:
            plain = context.next_plain(plain, parent, grid.at(level - 1))
    return b"".join([coder.stream.finish(), *tiles]), coder.escapes()


def above(grid: Grid) -> Ints:
    """Latents above those of the coarsest level, which there are none of: zeros [9, h, w]."""
    rows, columns = grid.at(grid.levels)
    return np.zeros((9, -(-rows // 2), -(-columns // 2)), np.int32)


def code_lowest(
    coder: context.Coder, fields: Mapping[str, Any], shape: tuple[int, int],
    values: Latents | None, cut: bool = False,
) -> Ints:  # fmt: skip
    """Codes the lowest planes by ascending x + y, each value predicted from above and left.

    Args:
        coder: The encoder or decoder.
        fields: Values of PLAN.
        shape: Rows and columns of the planes.
        values: Latents to encode; None for a decoder.
        cut: Whether the stream may end early; what is missing is as predicted.

    Returns:
        int32 [3, h, w] lowest planes.

    Raises:
        FormatError: The stream is corrupt, or has not even the first values.
    """
    if isinstance(coder, Decoder) and kernel.available() and not cut:
        return coder.lowest(fields["lowest"], shape)
    h, w = shape
    scale = np.array(fields["lowest"], np.int64)
    count = len(scale)
    out = np.zeros((3, h, w), np.int32)
    over = False
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
        expected = mean.T.astype(np.int64).ravel()
        coded = (expected + 8) >> laplace.MEAN_BITS
        if not over:
            try:
                coded = coder.code(given.T.ravel(), expected, np.tile(scale, len(i)))
            except FormatError:
                if not cut or t == 0:
                    raise
                over = True
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

    def level(self, at: Place, values: Ints) -> Ints:
        """Writes a level; returns its latents as decoded."""
        if not kernel.available():
            return at.coder.code(self, at.low, at.parent, at.bands, values)
        latents, escapes = context_native.encode(at, values, self.stream)
        self._escapes.append(escapes)
        return latents

    def tile(self) -> bytes:
        """Everything written, as a tile: the number of bytes of its escapes, they, its stream."""
        escapes = self.escapes()
        return _varying(len(escapes)) + escapes + self.stream.finish()

    def escapes(self) -> bytes:
        """Differences that have no symbol, zigzag-coded, 7 bits a byte, the low bits first."""
        values = np.concatenate(self._escapes).tolist() if self._escapes else ()
        return b"".join(_varying(2 * v if v >= 0 else -2 * v - 1) for v in values)


def _varying(number: int) -> bytes:
    """Number >= 0 in as many bytes as it takes, 7 bits each, the low ones first."""
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])


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

    def level(self, at: Place, out: Ints) -> None:
        """Reads a level.

        Args:
            at: The level.
            out: int32 [9, h, w] zeros that are replaced by the latents; by those that were read
                before an error, too.

        Raises:
            FormatError: The stream is corrupt.
        """
        if kernel.available():
            self._at = context_native.decode(at, self._stream, self._escapes, self._at, out)
        else:
            at.coder.code(self, at.low, at.parent, at.bands, None, out)

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
