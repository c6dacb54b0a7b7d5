"""Completion by reference: which places the hidden cells of a view copy.

A guess of what is hidden (`patches`) says roughly how it should look. Each hidden cell gets the
offset of a place that looks like that, whose rim fits what is around, and whose copy meets those of
its neighbours, as in shift maps (Pritch, Kav-Venaki and Peleg 2009). Labels of all cells are chosen
together by min-sum belief propagation.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...container.texr import CELLS_MAX, GRAIN_MAX
from ...texture.completion import Copies
from ...texture.network import Floats
from ...texture.planes import blocks
from .membrane import continued_from
from .patches import Guess, Pixels, Places, features_of, guessed, halved, whole

SIDE = 4
"""Side of a cell, in pixels of the size at which offsets are chosen."""

CELLS = 1500
"""Most hidden cells; the grain is the finest that has no more."""

CHOICES = 15
"""Most offsets among which is chosen, so that a source has 4 bits (`texr.sources_bits`)."""

TRIED = 120
"""Most offsets of the guess that are looked at."""

RIM, GUESS, SEAM = 2.0, 0.3, 0.5
"""Weights of squared differences from known pixels, from the guess, and between neighbours."""

PRICE = 6000.0
"""Price of two neighbours with different offsets."""

UNKNOWN = 2e4
"""Price of a hidden pixel that cannot be copied."""

FAR = 3 * 60.0**2
"""Squared difference from which on it does not matter how large it is."""

LARGE = 1 << 21
"""Pixels above which sizes of gradients are those of a reduced picture, to save memory."""

TURNS = 15
"""Rounds of belief propagation."""

SMOOTH = 2.5
"""Root mean square, in levels, of what the smooth fill misses beside the hole; where it misses
less, nothing is copied."""


class Cells(NamedTuple):
    """Hidden cells.

    Attributes:
        rows, columns: int64 [N] rows and columns of the cells.
        pairs: int64 [E, 2] numbers of neighbours, the upper or left one first.
        down: bool [E], True for neighbours above each other.
    """

    rows: Places
    columns: Places
    pairs: Places
    down: Pixels


def references(
    colours: Floats, known: Pixels, wanted: Pixels, seed: int, always: bool = False
) -> Copies | None:
    """Chooses what hidden samples copy.

    Args:
        colours: float32 [H, W, 3] in 0..255; those that are not known have no influence.
        known: bool [H, W], True for samples that may be copied.
        wanted: bool [H, W], True for hidden samples that are to be completed; none is known.
        seed: Seed of the random search.
        always: Whether to copy also where a smooth fill is as good.

    Returns:
        The references; None where nothing is hidden, there is nothing to copy from, or a smooth
        fill is as good.
    """
    y, x = np.flatnonzero(wanted.any(1)), np.flatnonzero(wanted.any(0))
    if not len(y):
        return None
    shape, grain = known.shape, 2
    while grain < GRAIN_MAX:
        some = blocks(wanted, grain)
        if some.sum() <= CELLS and some.size <= CELLS_MAX:
            break
        grain += 1
    margin = max(int(y[-1] - y[0]), int(x[-1] - x[0]), 64) + 1
    unit = 1 << grain
    top, left = max(y[0] - margin, 0) // unit * unit, max(x[0] - margin, 0) // unit * unit
    part = np.s_[top : y[-1] + margin, left : x[-1] + margin]
    features, seen, hole = colours[part], known[part], wanted[part]
    for level in range(grain - 1):
        if level:
            features, seen, hole = halved(features, True), halved(seen, True), halved(hole, False)
        if features.shape[2] == 3 and (seen.size <= LARGE or level == grain - 2):
            features = features_of(features, seen)
    hole &= ~seen
    if not hole.any() or not whole(seen).any() or not (always or _is_busy(features, seen, hole)):
        return None
    guess = guessed(features, seen, hole, seed)
    cells = _cells(hole)
    offsets, labels = _chosen(features, seen, guess, cells)
    sources = np.zeros([-(-n // unit) for n in shape], np.uint8)
    used, numbers = np.unique(labels, return_inverse=True)
    rows, columns = cells.rows + top // unit, cells.columns + left // unit
    inside = (rows < sources.shape[0]) & (columns < sources.shape[1])
    sources[rows[inside], columns[inside]] = numbers[inside] + 1
    return Copies(grain, (offsets[used] << (grain - 2)).astype(np.int32), sources)


def _is_busy(features: Floats, known: Pixels, hole: Pixels) -> bool:
    """Whether a smooth fill from farther out misses what is known beside the hole."""
    band = (cv2.dilate(hole.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0) & known
    if not band.any() or not (known & ~band).any():
        return False
    colours = features[..., :3]
    filled = continued_from(colours, known & ~band)
    return bool(np.sqrt(((filled - colours)[band] ** 2).mean()) >= SMOOTH)


def _cells(hole: Pixels) -> Cells:
    """Cells of `SIDE` pixels that hold a pixel of a hole."""
    some = blocks(hole, SIDE.bit_length() - 1)
    rows, columns = np.nonzero(some)
    number = np.full((some.shape[0] + 1, some.shape[1] + 1), -1)
    number[rows, columns] = np.arange(len(rows))
    pairs, down = [], []
    for dy, dx in ((0, 1), (1, 0)):
        other = number[rows + dy, columns + dx]
        one = np.flatnonzero(other >= 0)
        pairs.append(np.stack([one, other[one]], 1))
        down.append(np.full(len(one), dy == 1))
    return Cells(rows, columns, np.concatenate(pairs), np.concatenate(down))


def _chosen(
    features: Floats, known: Pixels, guess: Guess, cells: Cells
) -> tuple[Places, NDArray[np.intp]]:
    """Chooses offsets.

    Returns:
        int64 [K, 2] offsets dx, dy, and int [N] the number of that of each cell.
    """
    offsets = guess.offsets[:TRIED]
    cost = _own_costs(features, known, guess, cells, offsets)
    chosen = _few(cost)
    offsets, cost = offsets[chosen], np.ascontiguousarray(cost[:, chosen])
    return offsets, _propagated(cost, cells.pairs, _pair_costs(features, cells, offsets))


def _own_costs(
    features: Floats, known: Pixels, guess: Guess, cells: Cells, offsets: Places
) -> Floats:
    """Costs float32 [N, K] of giving a cell an offset, over the pixels that the cell weighs."""
    high, wide = known.shape
    reach = np.arange(-SIDE // 2, SIDE + SIDE // 2)
    tent = 1 - np.abs(reach + 0.5 - SIDE / 2) / SIDE
    weight = (tent[:, None] * tent).astype(np.float32)
    y = np.clip(cells.rows[:, None, None] * SIDE + reach[:, None], 0, high - 1)
    x = np.clip(cells.columns[:, None, None] * SIDE + reach, 0, wide - 1)
    seen, aim = known[y, x], guess.features[y, x]
    out = np.empty((len(cells.rows), len(offsets)), np.float32)
    for k, (dx, dy) in enumerate(offsets):
        v, u = y + dy, x + dx
        inside = (v >= 0) & (v < high) & (u >= 0) & (u < wide)
        v, u = np.clip(v, 0, high - 1), np.clip(u, 0, wide - 1)
        inside &= known[v, u]
        rough = np.minimum(((features[v, u] - aim) ** 2).sum(3), np.float32(FAR))
        found = rough * np.where(seen, np.float32(RIM), np.float32(GUESS)) * inside
        found += np.where(seen | inside, np.float32(0), np.float32(UNKNOWN))
        out[:, k] = (found * weight).sum((1, 2))
    return out


def _few(cost: Floats) -> list[int]:
    """Numbers of at most `CHOICES` offsets that together are best: the greedy choice."""
    least, chosen = cost.max(1), list[int]()
    while len(chosen) < min(CHOICES, cost.shape[1]):
        gain = np.maximum(least[:, None] - cost, 0).sum(0)
        best = int(gain.argmax())
        if gain[best] <= 0 and chosen:
            break
        chosen.append(best)
        least = np.minimum(least, cost[:, best])
    return chosen


def _pair_costs(features: Floats, cells: Cells, offsets: Places) -> Floats:
    """Costs float32 [E, K, K] of two neighbours with two offsets: how much their copies differ."""
    colours = features[..., :3]
    high, wide = colours.shape[:2]
    first, inner = cells.pairs[:, 0], np.arange(SIDE)
    half = SIDE // 2
    y = (cells.rows[first] * SIDE + half * cells.down)[:, None, None] + inner[:, None]
    x = (cells.columns[first] * SIDE + half * ~cells.down)[:, None, None] + inner
    y, x = np.broadcast_arrays(y, x)
    seen = np.empty((len(first), len(offsets), SIDE * SIDE * 3), np.float32)
    for k, (dx, dy) in enumerate(offsets):
        copy = colours[np.clip(y + dy, 0, high - 1), np.clip(x + dx, 0, wide - 1)]
        seen[:, k] = copy.reshape(len(first), -1)
    length = (seen**2).sum(2)
    cost = length[:, :, None] + length[:, None] - 2 * np.matmul(seen, seen.transpose(0, 2, 1))
    cost = np.maximum(cost, 0) * np.float32(SEAM) + np.float32(PRICE)
    same = np.arange(len(offsets))
    cost[:, same, same] = 0
    return np.asarray(cost)


def _propagated(own: Floats, pairs: Places, between: Floats) -> NDArray[np.intp]:
    """Labels of little cost by min-sum belief propagation: of all rounds the best.

    Args:
        own: float32 [N, K] costs of labels.
        pairs: int64 [E, 2] neighbours.
        between: float32 [E, K, K] costs of the labels of two neighbours.

    Returns:
        int [N] labels.
    """
    (count, labels), (one, other) = own.shape, pairs.T
    forth, back = np.zeros((2, len(pairs), labels), np.float32)
    everyone, each = np.arange(count), np.arange(len(pairs))
    best, least = own.argmin(1), np.inf
    for _ in range(TURNS):
        belief = own.copy()
        np.add.at(belief, other, forth)
        np.add.at(belief, one, back)
        label = belief.argmin(1)
        cost = float(own[everyone, label].sum() + between[each, label[one], label[other]].sum())
        if cost < least:
            best, least = label, cost
        to_other = ((belief[one] - back)[:, :, None] + between).min(1)
        to_one = ((belief[other] - forth)[:, None] + between).min(2)
        forth = (forth + to_other - to_other.min(1, keepdims=True)) / 2
        back = (back + to_one - to_one.min(1, keepdims=True)) / 2
    return np.asarray(best)
