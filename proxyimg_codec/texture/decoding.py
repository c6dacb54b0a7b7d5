"""Decoding of planes as far as it is asked for: levels, and windows of them, each once.

All arrays are as large as the whole level, and made when a part of one is first needed. What was
never asked for takes no memory, as systems hand out pages when they are written.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from ..progress import worked
from . import registered_model, synthesis
from .context import BAD_ESCAPES, REACH, Ints, Place, next_plain
from .grid import Bands, Grid, Window
from .latents import Decoder, Latents, above, code_lowest
from .network import Floats

BLOCK = 5
"""Binary logarithm of the side of the squares that are made at once."""

STRIP = 256
"""Rows that are made at once, which bounds memory."""

AROUND = 3
"""Positions around a window, on all sides, that its synthesis depends on."""


class _Made:
    """Blocks of a plane that are made."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        rows, columns = (-(-n >> BLOCK) for n in shape)
        self._blocks = np.zeros((rows, columns), bool)

    def lacking(self, window: Window) -> Iterator[Window]:
        """Yields windows, in whole blocks, that together lack nothing else of a window."""
        top, left = window.top >> BLOCK, window.left >> BLOCK
        blocks = self._blocks[top : -(-window.bottom >> BLOCK), left : -(-window.right >> BLOCK)]
        if blocks.all():
            return
        lacks, row, side = ~blocks, 0, 1 << BLOCK
        while row < len(lacks):
            end = row + 1
            while end < len(lacks) and (lacks[end] == lacks[row]).all():
                end += 1
            edges = np.flatnonzero(np.diff(lacks[row], prepend=False, append=False))
            for start, stop in edges.reshape(-1, 2).tolist():
                found = ((top + row) * side, (top + end) * side, (left + start) * side,
                         (left + stop) * side)  # fmt: skip
                yield Window(*found).common(Window.whole(self._shape))
            row = end

    def add(self, window: Window) -> None:
        """Takes the blocks of a window of `lacking` as made."""
        top, left = window.top >> BLOCK, window.left >> BLOCK
        self._blocks[top : -(-window.bottom >> BLOCK), left : -(-window.right >> BLOCK)] = True

    @property
    def whole(self) -> bool:
        """Whether all are."""
        return bool(self._blocks.all())


class Decoding:
    """Planes of a PLAN, decoded as far as was asked for.

    Args:
        fields: Values of PLAN.
        cells: bool [rows, columns] cells that have latents.
        where: Name of the chunk in error messages.
        cut: Whether the streams may be cut off: what is missing of them is an error only when it
            is needed.
    """

    def __init__(
        self, fields: Mapping[str, Any], cells: NDArray[np.bool_], where: str, cut: bool = False
    ) -> None:
        self._fields, self._cells, self._where, self._cut = fields, cells, where, cut
        self._grid = Grid.of(fields)
        self._model = registered_model.registered(fields["model"])
        self._lock = threading.RLock()
        self._arrays: dict[tuple[str, int], NDArray[Any]] = {}
        self._made: dict[tuple[str, int], _Made] = {}
        self._read = self._grid.levels + 1  # finest level that the first stream was read of
        self._coder: Decoder | None = None
        self._spoilt: set[int] = set()  # levels whose latents were read up to an error
        self._streams: list[tuple[bytes, bytes]] | None = None
        self._tiles: dict[int, list[tuple[Window, int]]] = {}

    def samples(self, level: int, window: Window) -> Floats:
        """Makes samples of the raster, or of one that is 2**level times smaller.

        Args:
            level: Number of the finest levels that are left out, 0..`levels`.
            window: The samples that are needed.

        Returns:
            float32 [rows, columns, components] samples in 0..1: of level 0 all of the raster, of
            which the window is made; otherwise those of the window.

        Raises:
            FormatError: The stream is corrupt.
        """
        with self._lock:
            step, components = self._fields["step"], self._fields["components"]
            if level:
                small = np.empty((*window.shape, components), np.float32)
                low = self._low(level, window)[window.at]
                synthesis.put_samples(self._model, low, step, level, small)
                return small
            columns, rows = self._grid.size
            out = self._array("samples", 0, (rows, columns, components), np.float32)
            made = self._made["samples", 0]
            for part in list(made.lacking(window)):
                for strip in _strips(part):
                    self._make(0, strip, out[strip.at])
                made.add(part)
            if made.whole:
                for key in [k for k in self._arrays if k[0] in ("latents", "plain", "bands")]:
                    del self._arrays[key]
                    self._made.pop(key, None)
                self._coder = None
                self._tiles.clear()
            return out

    def latents(self) -> Latents:
        """Decodes all latents.

        Raises:
            FormatError: The stream is corrupt.
        """
        with self._lock:
            levels = range(1, self._grid.levels + 1)
            found = [self._latents(k, Window.whole(self._grid.at(k))) for k in levels[::-1]]
            return Latents(tuple(found[::-1]), self._lowest())

    def salvaged(self) -> tuple[Latents, int]:
        """Decodes the latents that can be decoded; others are 0.

        Returns:
            The latents, and the number of levels, coarsest first, that are whole.

        Raises:
            FormatError: Not even the lowest planes can be decoded.
        """
        lowest, count = self._lowest(), 0
        levels = range(self._grid.levels, 0, -1)
        for level in levels:
            try:
                self._latents(level, Window.whole(self._grid.at(level)))
            except FormatError:
                break
            count += 1
        found = [self._array("latents", k, (9, *self._grid.at(k)), np.int32) for k in levels]
        return Latents(tuple(found[::-1]), lowest), count

    def _array(
        self, kind: str, level: int, shape: tuple[int, ...], dtype: type[np.generic]
    ) -> NDArray[Any]:
        """Array of a kind and level; zeros when it is new."""
        key = kind, level
        if key not in self._arrays:
            self._arrays[key] = np.zeros(shape, dtype)
            height, width = shape[:2] if dtype is np.float32 else shape[1:]
            self._made[key] = _Made((height, width))
        return self._arrays[key]

    def _lowest(self) -> Ints:
        """Lowest planes int32 [3, h, w]."""
        if self._coder is None:
            first = self._fields["data"]
            if self._fields["tile"]:
                first = first[: length(first, 0, self._cut)]
            if self._cut:
                first = _shortened(first)
            shape = self._grid.at(self._grid.levels)
            coder = Decoder(first, self._fields["escapes"])
            self._arrays["lowest", 0] = code_lowest(coder, self._fields, shape, None, self._cut)
            self._coder, self._read = coder, self._grid.levels + 1
        return self._arrays["lowest", 0]

    def _latents(self, level: int, window: Window) -> Ints:
        """Latents int32 [9, h, w] of a level, of which a window is decoded."""
        if level > self._grid.levels:
            return above(self._grid)
        out = self._array("latents", level, (9, *self._grid.at(level)), np.int32)
        if not self._grid.tiles(level, self._fields["tile"]):
            self._lowest()
            for number in range(self._read - 1, level - 1, -1):
                self._read_level(number)
            return out
        left = []
        for tile, number in self._tiles_of(level):
            if max(tile.top, window.top) < min(tile.bottom, window.bottom) and max(
                tile.left, window.left
            ) < min(tile.right, window.right):
                self._read_tile(level, tile, number, out)
            else:
                left.append((tile, number))
        self._tiles[level] = left
        return out

    def _place(self, level: int, window: Window) -> Place:
        """Place of a level, with what the context of a window depends on."""
        parent = self._latents(level + 1, window.halved())
        return Place.of(self._fields, level, self._plain(level, window), parent, self._bands(level))

    def _bands(self, level: int) -> Bands:
        """Latents of a level that are coded, uint8 [h, w]."""
        key = "bands", level
        if key not in self._arrays:
            self._arrays[key] = self._grid.bands(self._cells, self._fields["cell"], level)
        return self._arrays[key]

    def _read_level(self, level: int) -> None:
        """Reads the next level of the first stream."""
        whole = Window.whole(self._grid.at(level))
        out = self._array("latents", level, (9, *whole.shape), np.int32)
        place = self._place(level, whole)
        coder, self._coder = self._coder, None  # it is of no use after an error
        assert coder is not None, "the lowest planes are read"
        if level in self._spoilt:
            out[:] = 0
        self._spoilt.add(level)
        coder.level(place, out)
        self._spoilt.remove(level)
        if level == 1 or self._grid.tiles(level - 1, self._fields["tile"]):
            coder.finish(self._where)
        self._coder, self._read = coder, level

    def _tiles_of(self, level: int) -> list[tuple[Window, int]]:
        """Tiles of a level that are not read yet, and the numbers of their streams."""
        if self._streams is None:
            data = self._fields["data"]
            self._streams = list(split(data, length(data, 0, self._cut), self._cut))
            self._index()
        return self._tiles[level]

    def _index(self) -> None:
        number = 0
        for level in range(self._grid.levels, 0, -1):
            tiles = self._grid.tiles(level, self._fields["tile"])
            if tiles:
                coded = [t for t in tiles if self._bands(level)[t.at].any()]
                self._tiles[level] = [(t, number + k) for k, t in enumerate(coded)]
                number += len(coded)
        assert self._streams is not None, "they are split"
        if not self._cut and number != len(self._streams):
            raise FormatError(
                f"there are {len(self._streams)} streams of {number} tiles", self._where,
                rule="PYR-54",
            )  # fmt: skip

    def _read_tile(self, level: int, tile: Window, number: int, out: Ints) -> None:
        """Reads a tile into the latents of a level."""
        assert self._streams is not None, "they are split"
        if number >= len(self._streams):
            raise FormatError("the stream of a tile is missing", self._where, rule="PYR-54")
        outer = tile.grown(REACH, self._grid.at(level))
        place, outer = self._place(level, outer).tile(tile)
        escapes, stream = self._streams[number]
        coder = Decoder(stream, escapes)
        found = np.zeros((9, *outer.shape), np.int32)
        try:
            coder.level(place, found)
            coder.finish(self._where)
        finally:
            out[:, *tile.at] = found[:, *tile.inside(outer).at]

    def _plain(self, level: int, window: Window) -> Ints:
        """Plain planes int32 [3, h, w] of a level, of which a window is made."""
        grid = self._grid
        if level == grid.levels:
            return self._lowest() << 4
        out = self._array("plain", level, (3, *grid.at(level)), np.int32)
        made = self._made["plain", level]
        for part in list(made.lacking(window)):
            for strip in _strips(part):
                above = strip.halved().grown(AROUND, grid.at(level + 1))
                low = self._plain(level + 1, above)[:, *above.at]
                high = self._latents(level + 1, above)[:, *above.at]
                under = above.doubled(grid.at(level))
                found = next_plain(low, high, under.shape)
                out[:, *strip.at] = found[:, *strip.inside(under).at]
                worked(0)  # it takes little time, but enough to be asked to stop
            made.add(part)
        return out

    def _low(self, level: int, window: Window) -> Floats:
        """Planes float32 [h, w, 3] above a level, of which a window is made."""
        grid = self._grid
        if level == grid.levels:
            return np.ascontiguousarray(self._lowest().transpose(1, 2, 0), np.float32)
        out = self._array("low", level, (*grid.at(level), 3), np.float32)
        made = self._made["low", level]
        for part in list(made.lacking(window)):
            for strip in _strips(part):
                self._make(level, strip, out[strip.at])
            made.add(part)
        return out

    def _make(self, level: int, window: Window, out: Floats) -> None:
        """Makes a window of the planes above a level, or of the samples if that is 0.

        Args:
            level: Number of the level, from 0.
            window: Rows and columns that are made.
            out: float32 [rows, columns, 3 or components] array for them.
        """
        grid = self._grid
        above = window.halved().grown(AROUND, grid.at(level + 1))
        under = above.doubled(grid.at(level))
        high = self._latents(level + 1, above)[:, *above.at]
        low = self._low(level + 1, above)[above.at]
        synthesis.finer(
            self._model, level + 1, low, high, self._fields["step"], under.shape,
            window.inside(under), out, shown=level == 0,
        )  # fmt: skip


def _strips(window: Window) -> Iterator[Window]:
    """Yields the window in strips of rows."""
    for top in range(window.top, window.bottom, STRIP):
        yield window._replace(top=top, bottom=min(top + STRIP, window.bottom))


def length(data: bytes, at: int, cut: bool) -> int:
    """Finds the bytes of the rANS stream that begins at a place of some data.

    Args:
        data: The data.
        at: The place.
        cut: Whether the stream may be cut off; then it has all bytes that follow.

    Raises:
        FormatError: The stream is cut off, and may not be.
    """
    head = 1 + (4 << data[at]) + 4 if at < len(data) and data[at] <= 10 else 0
    words = int.from_bytes(data[at + head - 4 : at + head], "little") if head else 0
    size = head + 2 * words
    if head and at + size <= len(data):
        return size
    if cut:
        return len(data) - at
    raise FormatError("entropy-coded stream is truncated", rule="ENT-4")


def split(data: bytes, at: int, cut: bool) -> Iterator[tuple[bytes, bytes]]:
    """Yields escapes and stream of each tile from a place of some data on.

    Args:
        data: The data.
        at: The place.
        cut: Whether the last one may be cut off.

    Raises:
        FormatError: The last one is cut off, and may not be.
    """
    while at < len(data):
        number = data[at : at + 5]
        digits = next((k for k, byte in enumerate(number, 1) if byte < 128), 0)
        count = sum((byte & 127) << (7 * k) for k, byte in enumerate(number[:digits]))
        if (not digits or at + digits + count > len(data)) and not cut:
            raise FormatError(BAD_ESCAPES, rule="PYR-54")
        at += digits or len(number)
        escapes = data[at : at + count]
        at += len(escapes)
        size = length(data, at, cut)
        stream = data[at : at + size]
        yield escapes, _shortened(stream) if cut else stream
        at += size


def _shortened(data: bytes) -> bytes:
    """Lowers the number of words in the header of a stream to the number that is there."""
    head = 5 + (4 << data[0] if data and data[0] <= 10 else 0)
    there = max(len(data) - head, 0) // 2
    words = min(int.from_bytes(data[head - 4 : head], "little"), there)
    return data[: head - 4] + words.to_bytes(4, "little") + data[head:] if there else data
