"""Planes of the pyramid coder: latents <-> PLAN, and the raster that they decode to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..container.plan import TILE_MIN
from ..entropy import arrays, laplace
from ..errors import FormatError
from ..native import kernel
from . import context, registered_model, synthesis
from .context import SHIFT_ORIGIN, Ints
from .decoding import Decoding
from .grid import Grid, Window
from .latents import Latents, encode
from .network import Floats

LARGE = 1 << 20
"""Samples from which on a raster has tiles by default."""

TILES, TILE_BYTES, TILES_SHARE = (7, 8, 9), 13, 0.005
"""Binary logarithms of sides of tiles, bytes that a tile costs, and the share of all that tiles
may cost: the smallest tiles are taken that cost no more."""

DETAIL_UNIT, DETAIL_MAX = 8, 255
"""Unit of `details` in 1/8-bit levels, and their largest value."""


@dataclass(frozen=True, eq=False)
class Planes:
    """Coded latents of one raster.

    Attributes:
        packed: Values of PLAN.
        where: Name of the chunk in error messages.
    """

    packed: Mapping[str, Any]
    where: str = "chunk PLAN"

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what was decoded."""
        return {k: v for k, v in self.__dict__.items() if not isinstance(v, Decoding)}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the raster in samples."""
        columns, rows = self.packed["size"]
        return columns, rows

    @property
    def components(self) -> int:
        """Components of a sample: 1 for grey, 3 for colour."""
        return int(self.packed["components"])

    @property
    def details(self) -> tuple[float, ...]:
        """Root mean square, in 8-bit levels, that each level adds, from level 1; () if unknown."""
        return tuple(v / DETAIL_UNIT for v in self.packed["details"])

    @cached_property
    def support(self) -> NDArray[np.bool_]:
        """Cells that have latents, bool [rows, columns].

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
    def stored(self) -> NDArray[np.bool_]:
        """Samples in cells that have latents, bool [rows, columns].

        Raises:
            FormatError: The stream is corrupt.
        """
        side, (columns, rows) = 1 << self.packed["cell"], self.size
        if not self.packed["support"]:
            return np.ones((rows, columns), bool)
        return self.support.repeat(side, 0)[:rows].repeat(side, 1)[:, :columns]

    @property
    def latents(self) -> Latents:
        """Latents; decoded again at each call, because only the raster is kept in memory.

        Raises:
            FormatError: The stream is corrupt.
        """
        return Decoding(self.packed, self.support, self.where).latents()

    @kernel.Computed
    def _decoding(self) -> Decoding:
        return Decoding(self.packed, self.support, self.where)

    def samples(self, window: Window) -> Floats:
        """Decodes a part of the raster.

        Args:
            window: The samples that are needed.

        Returns:
            float32 [rows, columns, components] in 0..1: all samples, of which those in the window
            are decoded.

        Raises:
            FormatError: The stream is corrupt.
            UnsupportedError: The model is unknown.
        """
        return self._decoding.samples(0, window)

    def reduced(self, level: int, window: Window) -> Floats:
        """Decodes a part of the raster without its finest levels.

        Args:
            level: Number of the levels to leave out, 1..`levels`.
            window: Rows and columns that are needed of a raster that is 2**level times smaller.

        Returns:
            float32 [rows, columns, components] in 0..1. Row i, counted from the top of the raster,
            lies on row 2**level i of the samples.

        Raises:
            FormatError: The stream is corrupt.
            UnsupportedError: The model is unknown.
        """
        return self._decoding.samples(level, window)

    def shape(self, level: int) -> tuple[int, int]:
        """Rows and columns of the raster without its `level` finest levels."""
        return Grid.of(self.packed).at(level) if level else self.size[::-1]

    @property
    def raster(self) -> Floats:
        """All samples, float32 [rows, columns, components] in 0..1.

        Raises:
            FormatError: The stream is corrupt.
            UnsupportedError: The model is unknown.
        """
        columns, rows = self.size
        return self.samples(Window.whole((rows, columns)))


def unpack(fields: Mapping[str, Any], where: str = "chunk PLAN") -> Planes:
    """Creates planes from PLAN; the streams are decoded when they are first needed.

    Args:
        fields: Values of PLAN.
        where: Name of the chunk in error messages.

    Raises:
        FormatError: The fields contradict each other.
        UnsupportedError: The model is unknown.
    """
    registered_model.registered(fields["model"])
    levels, components = fields["levels"], fields["components"]
    if components == 2:
        raise FormatError("2 components: they are 1 or 3", where, rule="PYR-2")
    if fields["grey"] > levels or (components == 1 and fields["grey"] < levels):
        raise FormatError("more levels without chroma than there are levels", where, rule="PYR-2")
    if len(fields["lowest"]) != components or len(fields["shifts"]) != 2 * levels:
        raise FormatError("scales or shifts do not fit the levels", where, rule="PYR-2")
    tile, details = fields["tile"], fields["details"]
    if 0 < tile < TILE_MIN or len(details) not in (0, levels):
        raise FormatError("a tile is too small, or details do not fit the levels", where,
                          rule="PYR-54")  # fmt: skip
    return Planes(fields, where)


def encoded(
    latents: Latents, size: tuple[int, int], step: int, support: NDArray[np.bool_] | None = None,
    cell: int = 3, components: int = 3, number: int = 2,
    shifts: tuple[int, ...] | None = None, tile: int | None = None, likely: float | None = None,
) -> Planes:  # fmt: skip
    """Encodes latents as planes.

    Args:
        latents: The latents. Those that are not coded are taken as 0.
        size: Width and height of the raster in samples.
        step: Quantization step in 1/64 octave: it is 2**(step / 64) levels of 8 bits.
        support: bool [rows, columns] cells that have latents; None for all.
        cell: Binary logarithm of the side of a cell in samples.
        components: 1 for grey, 3 for colour.
        number: Number of the registered model.
        shifts: Shifts of the scale index: luma and chroma of level 1, then of level 2, and so on;
            by default 0.
        tile: Binary logarithm of the side of a tile in positions, 0 = no tiles; by default large
            rasters have tiles that cost little.
        likely: Estimate of the bytes of the streams, by which tiles are chosen; by default they are
            coded without tiles first, to know.

    Raises:
        ValueError: The magnitude of a latent is `context.LIMIT` or more.
        UnsupportedError: The model is unknown.
    """
    if any(max(y.max(), -y.min()) >= context.LIMIT for y in (*latents.levels, latents.lowest)):
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
    details = synthesis.details(registered_model.registered(number), latents.levels, step, size)
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
        "tile": tile or 0,
        "details": [min(round(DETAIL_UNIT * v), DETAIL_MAX) for v in details],
    }
    if tile is None and likely is not None:
        tile = fields["tile"] = _tile_of(Grid.of(fields), likely)
    data, escapes = encode(fields, support, latents)
    if tile is None and (side := _tile_of(Grid.of(fields), len(data))):
        fields["tile"] = side
        data, escapes = encode(fields, support, latents)
    return Planes({**fields, "escapes": escapes, "data": data})


def _tile_of(grid: Grid, size: float) -> int:
    """Binary logarithm of the side of tiles for a stream of a size; 0 if it shall have none."""
    levels = range(1, grid.levels + 1)
    large = grid.size[0] * grid.size[1] >= LARGE
    for side in TILES if large else ():
        count = sum(len(grid.tiles(level, side)) for level in levels)
        if count * TILE_BYTES <= TILES_SHARE * size:
            return side
    return 0


def salvaged(planes: Planes, truncated: bool) -> tuple[Planes, int]:
    """Keeps the levels that can be decoded from a stream that is cut off or damaged.

    Of the level in which a stream ends that is cut off, what comes before is kept. If the stream is
    damaged elsewhere, a level in which it fails is dropped, with all finer ones; if it can be
    decoded but does not end where it should, the finest level is: wherever the damage is, the last
    symbols are wrong.

    Args:
        planes: Planes as they were read; `data` may be shorter than its header says.
        truncated: Whether they are cut off, and not damaged elsewhere.

    Returns:
        Planes with a sound stream, and the number of levels that are whole; the latents that are
        missing are 0. If nothing is wrong, the same planes and the number of all levels.

    Raises:
        FormatError: Not even the lowest planes can be decoded.
    """
    packed, support = planes.packed, planes.support
    try:
        found, count = Decoding(packed, support, planes.where, cut=True).salvaged()
    except FormatError as error:
        raise FormatError(
            f"none of the planes can be decoded: {error}", planes.where, rule=error.rule
        ) from None
    left = packed["levels"] - count
    if not left:
        return planes, count
    if not truncated:
        found = found._replace(levels=(*(y * 0 for y in found.levels[:left]), *found.levels[left:]))
    shifts = tuple(v - SHIFT_ORIGIN for v in packed["shifts"])
    sound = encoded(
        found, planes.size, packed["step"], support, packed["cell"], planes.components,
        packed["model"], shifts, packed["tile"],
    )  # fmt: skip
    return replace(sound, where=planes.where), count


def cells_of(size: tuple[int, int], cell: int) -> tuple[int, int]:
    """Rows and columns of cells of a raster.

    Args:
        size: Width and height of the raster in samples.
        cell: Binary logarithm of the side of a cell in samples.
    """
    return -(-size[1] >> cell), -(-size[0] >> cell)


def blocks(
    samples: NDArray[np.bool_], cell: int, shape: tuple[int, int] | None = None
) -> NDArray[np.bool_]:
    """Cells that hold any sample of a mask, bool [rows, columns].

    Args:
        samples: bool [height, width].
        cell: Binary logarithm of the side of a cell in samples.
        shape: Rows and columns of cells; by default those that cover the mask.
    """
    height, width = samples.shape
    rows, columns = shape or cells_of((width, height), cell)
    side = 1 << cell
    whole = np.pad(samples, ((0, rows * side - height), (0, columns * side - width)))
    return np.asarray(whole.reshape(rows, side, columns, side).any((1, 3)))


def _scale_of(plane: Ints) -> int:
    """Scale index for the differences between a lowest plane and its prediction.

    It is never one that takes a latent as certain, unless the whole plane is 0.
    """
    error = np.abs(plane - (_predicted(plane) >> laplace.MEAN_BITS)).mean()
    least = laplace.CERTAIN + 1 if plane.any() else 0
    return int(np.clip(round(8 * (np.log(max(error, 1e-3)) + 4)), least, laplace.SCALES - 1))


def _predicted(plane: Ints) -> Ints:
    """Prediction of a plane: mean of the values above and to the left, in 1/16."""
    up = np.concatenate([plane[:1] * 0, plane[:-1]])
    left = np.concatenate([plane[:, :1] * 0, plane[:, :-1]], 1)
    mean: Ints = 8 * (up + left)
    mean[0], mean[:, 0] = 16 * left[0], 16 * up[:, 0]
    return mean
