"""Lifts of cells: what is added to their copies, so that neighbours agree in light [PYR-51].

As gain compensation does for the pictures of a panorama: each two cells that touch say how much
their copies differ between their centres, each cell at the rim says how much it misses what is
known, and all are balanced by successive over-relaxation, in integers.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

LIFT, APART = 24 << 8, 48 << 8
"""Largest difference that counts, in 1/256 level; what is more than `APART` is another thing."""

LIFT_MOST = 32640
"""Largest lift, so that sums stay below 2^31."""

TURNS = 64
"""Rounds of balancing."""

RIM_WEIGHT = 4
"""Weight of what is known beside a cell, where there is a whole cell of it."""

BAND = 1 << 18
"""Samples that are compared at a time, which bounds memory."""

Values = NDArray[np.int32]
Numbers = NDArray[np.intp]


class Copier:
    """Copies of cells.

    Args:
        values: int32 [C, H, W] samples.
        known: bool [H, W], True for those that may be copied.
        offsets: int32 [N, 2] offsets dx, dy.
        sources: uint8 [rows, columns], for each cell 1 + the number of its offset, or 0.
        side: Side of a cell in samples.
    """

    def __init__(
        self, values: Values, known: NDArray[np.bool_], offsets: NDArray[np.int32],
        sources: NDArray[np.uint8], side: int,
    ) -> None:  # fmt: skip
        self.values, self.known, self.side = values, known, side
        self.rows, self.columns = np.nonzero(sources)
        self.shift = offsets[sources[self.rows, self.columns].astype(np.intp) - 1]
        self.number = np.full((sources.shape[0] + 1, sources.shape[1] + 1), -1)
        self.number[self.rows, self.columns] = np.arange(len(self.rows))

    def pieces(self, cells: Numbers, size: int) -> Iterator[Numbers]:
        """Splits cells into pieces whose squares of `size` samples fit `BAND`."""
        step = max(BAND // size**2, 1)
        return (cells[i : i + step] for i in range(0, len(cells), step))

    def square(
        self, cells: Numbers, start: tuple[int, int], size: int
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Samples of squares that begin `start` rows and columns after each cell.

        Returns:
            Rows [n, size, 1], columns [n, 1, size], and whether they lie in the part.
        """
        reach = np.arange(size)
        y = (self.rows[cells] * self.side + start[0])[:, None, None] + reach[:, None]
        x = (self.columns[cells] * self.side + start[1])[:, None, None] + reach
        high, wide = self.known.shape
        return y, x, (y >= 0) & (y < high) & (x >= 0) & (x < wide)

    def copies(
        self, cells: Numbers, y: NDArray[np.int64], x: NDArray[np.int64]
    ) -> tuple[Values, NDArray[np.bool_]]:
        """Copies int32 [C, n, h, w] of cells [n] at samples, and where there are any."""
        high, wide = self.known.shape
        v = y + self.shift[cells, 1][:, None, None]
        u = x + self.shift[cells, 0][:, None, None]
        there = (v >= 0) & (v < high) & (u >= 0) & (u < wide)
        v, u = np.clip(v, 0, high - 1), np.clip(u, 0, wide - 1)
        return self.values[:, v, u], there & self.known[v, u]


def lifts_of(copier: Copier) -> Values:
    """Balances the lifts of all cells with a source: int32 [C, n]."""
    count = len(copier.rows)
    everyone = np.arange(count)
    aim, weight = _rim(copier, everyone)
    beside = [copier.number[copier.rows + j, copier.columns + i] for j, i in ((0, 1), (1, 0))]
    # For each of the four neighbours: its number, and by how much the cell shall exceed its lift.
    links: list[tuple[Numbers, NDArray[np.int64]]] = []
    for down, other in enumerate(beside):
        differ, some = _between(copier, everyone, other, down)
        links.append((np.where(some, other, -1), -differ))
        back, over = np.full(count, -1), np.zeros_like(differ)
        back[other[some]] = everyone[some]
        over[:, other[some]] = differ[:, some]
        links.append((back, over))
    total = weight + sum((other >= 0).astype(np.int64) for other, _ in links)
    even = (copier.rows + copier.columns) % 2 == 0
    lift = np.zeros(aim.shape, np.int64)
    for turn in range(2 * TURNS):
        at = np.flatnonzero((even if turn % 2 == 0 else ~even) & (total > 0))
        wanted = weight[at] * aim[:, at]
        for other, over in links:
            linked = other[at] >= 0
            wanted += linked * (lift[:, other[at]] + over[:, at])
        missing = 7 * (wanted - total[at] * lift[:, at])
        lift[:, at] += (missing + 2 * total[at]) // (4 * total[at])
        np.clip(lift, -LIFT_MOST, LIFT_MOST, out=lift)
    return lift.astype(np.int32)


def _rim(copier: Copier, cells: Numbers) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Differences of known samples from copies of the cells around them, [C, n]; weights [n]."""
    side, size = copier.side, 2 * copier.side - copier.side % 2
    start = -(side // 2), -(side // 2)
    aims, weights = [], []
    for some in copier.pieces(cells, size):
        y, x, inside = copier.square(some, start, size)
        high, wide = copier.known.shape
        y, x = np.clip(y, 0, high - 1), np.clip(x, 0, wide - 1)
        found, there = copier.copies(some, y, x)
        there &= inside & copier.known[y, x]
        aim, count = _mean(copier.values[:, y, x] - found, there)
        aims.append(aim)
        weights.append(-(-RIM_WEIGHT * np.minimum(count, side**2) // side**2))
    return np.concatenate(aims, 1), np.concatenate(weights)


def _between(
    copier: Copier, cells: Numbers, other: Numbers, down: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Excess of copies of cells over those of their neighbours to the right, or below.

    Returns:
        int64 [C, n], and bool [n], False where there is no neighbour, or nothing to compare.
    """
    side = copier.side
    start = (side // 2, 0) if down else (0, side // 2)
    differ = np.zeros((len(copier.values), len(cells)), np.int64)
    some = np.zeros(len(cells), np.bool_)
    for one in copier.pieces(cells[other >= 0], side):
        y, x, inside = copier.square(one, start, side)
        first, there = copier.copies(one, y, x)
        second, also = copier.copies(other[one], y, x)
        differ[:, one], count = _mean(first - second, there & also & inside)
        some[one] = count > 0
    return differ, some


def _mean(differ: Values, where: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Means [C, n] of differences [C, n, h, w] over some samples, bounded, and their number.

    Where those of a component are `APART`, both are 0.
    """
    count = where.sum((1, 2)).astype(np.int64)
    total = (differ.astype(np.int64) * where).sum((2, 3))
    mean = (2 * total + count) // np.maximum(2 * count, 1)
    alike = (np.abs(mean) <= APART).all(0)
    return np.clip(mean, -LIFT, LIFT) * alike, count * alike
