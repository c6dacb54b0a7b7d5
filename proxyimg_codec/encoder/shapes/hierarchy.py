"""Hierarchy of regions: basins of a boundary map, merged across the weakest boundaries first."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .maps import Maps
from .refine import spread

Floats = NDArray[np.float32]
Labels = NDArray[np.intp]

SIDE = 480
"""Longer side, in pixels, of the copy that is divided."""

SOFT = 0.8
"""Deviation, in pixels, of the blur of the boundary map before basins are sought."""

SMALL, SMALL_POWER = 0.02, 0.3
"""Boundaries of regions below the share `SMALL` of the picture count less, by a power of their
size, so that what is left last is large."""


SIDES = (
    ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
    ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
)
"""Pixels and their right neighbours, and pixels and those below, in a plane."""


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Basins, and the order in which they merge.

    Attributes:
        basins: int [h, w], number of the basin of each pixel, from 0.
        merges: int [N - 1, 2], numbers of the regions that each merge joins; a basin has its own
            number, merge k makes the region N + k. Fewer than N - 1 if parts are not connected.
        strengths: float32 [N - 1], strength of the boundary that each merge removes, never falling.
    """

    basins: Labels
    merges: Labels
    strengths: Floats

    @property
    def count(self) -> int:
        """Number of basins."""
        return int(self.basins.max()) + 1

    def of_basins(self, level: float) -> Labels:
        """Region of each basin, int [N], numbered from 0, without boundaries below a strength."""
        above = np.arange(self.count + len(self.merges))
        for k, (a, b) in enumerate(self.merges):
            if self.strengths[k] >= level:
                break
            above[a] = above[b] = self.count + k
        for node in range(len(above) - 1, -1, -1):
            above[node] = above[above[node]]
        return np.unique(above[: self.count], return_inverse=True)[1]

    def cut(self, level: float) -> Labels:
        """Regions, int [h, w], numbered from 0, without boundaries below a strength."""
        return np.asarray(self.of_basins(level)[self.basins])


def hierarchy(boundary: Floats, inside: NDArray[np.bool_] | None = None) -> Hierarchy:
    """Divides a picture.

    Args:
        boundary: float32 [h, w] in 0..1, strength of boundaries.
        inside: bool [h, w], False for pixels whose boundaries count as strongest; None for none.
    """
    if inside is not None:
        boundary = np.where(inside, boundary, np.float32(1))
    basins = _basins(boundary)
    return merged(basins, boundary)


def _basins(boundary: Floats) -> Labels:
    """Watershed of the minima of a boundary map, int [h, w] from 0."""
    levels = np.rint(cv2.GaussianBlur(boundary, (0, 0), SOFT) * 255).astype(np.uint8)
    low = cv2.erode(levels, np.ones((5, 5), np.uint8)) == levels
    markers = cv2.connectedComponents(low.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)[1]
    # OpenCV's watershed leaves the frame without a label, and lines between basins.
    padded = cv2.copyMakeBorder(markers, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    ground = cv2.copyMakeBorder(levels, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    flooded = cv2.watershed(cv2.merge([ground] * 3), padded)[1:-1, 1:-1]
    labels = spread(np.where(flooded <= 0, -1, flooded))
    return np.unique(labels, return_inverse=True)[1].reshape(labels.shape)


def borders(labels: Labels, boundary: Floats) -> tuple[Labels, Labels, NDArray[np.float64]]:
    """Shared borders of regions.

    Args:
        labels: int [h, w] from 0.
        boundary: float32 [h, w].

    Returns:
        Pairs int [P, 2], the first smaller; length of each border in pixels int [P]; and the
        strength summed along it, float64 [P].
    """
    keys, strengths = [], []
    count = int(labels.max()) + 1
    for one, two in SIDES:
        a, b = labels[one], labels[two]
        apart = a != b
        low, high = np.minimum(a, b)[apart], np.maximum(a, b)[apart]
        keys.append(low * count + high)
        strengths.append(np.maximum(boundary[one], boundary[two])[apart])
    pairs, which = np.unique(np.concatenate(keys), return_inverse=True)
    lengths = np.bincount(which, minlength=len(pairs))
    sums = np.asarray(np.bincount(which, np.concatenate(strengths), len(pairs)), np.float64)
    return np.stack(np.divmod(pairs, count), 1), lengths, sums


def merged(
    basins: Labels, boundary: Floats, kinds: Labels | None = None, look: Floats | None = None
) -> Hierarchy:
    """Merges regions across the weakest boundary until none is left.

    Args:
        basins: int [h, w], numbers of the regions from 0.
        boundary: float32 [h, w], strength of boundaries.
        kinds: int [N], kind of each region; those of different kinds never merge. None for one.
        look: float32 [h, w, C]; differences of means of regions add to their boundary. None: none.
    """
    pairs, lengths, sums = borders(basins, boundary)
    if kinds is not None:
        alike = kinds[pairs[:, 0]] == kinds[pairs[:, 1]]
        pairs, lengths, sums = pairs[alike], lengths[alike], sums[alike]
    count = int(basins.max()) + 1
    area = np.bincount(basins.ravel(), minlength=count).tolist() + [0] * count
    least = SMALL * basins.size
    sums_of = np.zeros((2 * count, 0 if look is None else look.shape[2]))
    if look is not None:
        for c in range(look.shape[2]):
            sums_of[:count, c] = np.bincount(basins.ravel(), look[..., c].ravel(), count)
    seen = sums_of.tolist()
    near: list[dict[int, tuple[int, float]]] = [{} for _ in range(2 * count)]

    def cost(a: int, b: int) -> float:
        length, total = near[a][b]
        share = min(1.0, min(area[a], area[b]) / least)
        away = sum(abs(p / area[a] - q / area[b]) for p, q in zip(seen[a], seen[b], strict=True))
        return float((total / length + away) * share**SMALL_POWER)

    for (a, b), length, total in zip(pairs.tolist(), lengths.tolist(), sums.tolist(), strict=True):
        near[a][b] = near[b][a] = (length, total)
    heap = [(cost(a, b), a, b) for a, b in pairs.tolist()]
    heapq.heapify(heap)
    merges, strengths, highest = list[tuple[int, int]](), list[float](), 0.0
    while heap:
        strength, a, b = heapq.heappop(heap)
        if not near[a] or b not in near[a]:
            continue
        new = count + len(merges)
        merges.append((a, b))
        highest = max(highest, strength)
        strengths.append(highest)
        area[new] = area[a] + area[b]
        seen[new] = [p + q for p, q in zip(seen[a], seen[b], strict=True)]
        joined = {n: near[a].get(n, (0, 0.0)) for n in {**near[a], **near[b]} if n not in (a, b)}
        for other, (length, total) in joined.items():
            more = near[b].get(other, (0, 0.0))
            near[new][other] = near[other][new] = (length + more[0], total + more[1])
            near[other].pop(a, None)
            near[other].pop(b, None)
        near[a], near[b] = {}, {}
        for other in near[new]:
            heapq.heappush(heap, (cost(other, new), other, new))
    joins = np.array(merges, np.intp).reshape(-1, 2)
    return Hierarchy(basins, joins, np.array(strengths, np.float32))


def reduced(plane: Floats, side: int = SIDE) -> Floats:
    """Reduces a map, float32 [H, W] or [H, W, C], to at most `side` pixels a side."""
    height, width = plane.shape[:2]
    scale = min(1.0, side / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)


def partitions(maps: Maps, levels: list[float]) -> list[Labels]:
    """Label maps int [H, W] of a picture without boundaries below each level; fine to coarse."""
    tree = hierarchy(reduced(maps.boundary))
    size = maps.boundary.shape[::-1]
    nearest = cv2.INTER_NEAREST
    cuts = (cv2.resize(tree.cut(v).astype(np.int32), size, interpolation=nearest) for v in levels)
    return [np.asarray(cut, np.intp) for cut in cuts]
