"""Visible and trusted samples of a view that is cut by boundaries [PYR-40, PYR-41, PYR-46, PYR-52].

A view is the part of a raster that a layer shows. The raster is the flat picture, so only a part of
it belongs to the layer: the view is *cut* by the layer's own boundary and by those of layers in
front. The remaining samples *show*: they are used as they are. Samples on a boundary are mixtures
of two layers. The samples at some distance from all cuts are *trusted*: hidden ones are filled from
these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.boundary import Boundary
from ..geometry.coverage import FULL, coverage, to_output
from .implicit import Box

BAND = 1 << 18
"""Pixels whose coverage is computed at a time, which bounds memory."""

REACH = 2
"""Distance in samples up to which a boundary mixes colours, by blur and by coding."""

Samples = NDArray[np.bool_]


class Moved(NamedTuple):
    """Neighbours of a view that have moved relative to it since it was cut, or look different.

    Attributes:
        fronts: Boundaries among `Occlusion.fronts` that have moved or are gone.
        behind: Layers behind, front to back: the boundary at rest, None for the whole canvas, and
            whether it still rests in its place. Empty if all do.
        apart: Whether the view has a matte, and something that may shine through has come to lie
            behind its layer.
    """

    fronts: frozenset[Boundary] = frozenset()
    behind: tuple[tuple[Boundary | None, bool], ...] = ()
    apart: bool = False


class Edge(NamedTuple):
    """Samples of a view at its own boundary behind which something has changed [PYR-52].

    Attributes:
        shown: bool [height, width], True for all samples of the view that show.
        core: intp [N] ascending numbers of the samples at the boundary that are unmixed.
        share: float64 [N] share, 0.5..1, that they have of the colour of the layer.
        outer: intp [M] ascending numbers of those beyond, which continue the colours of `core`.
        free: bool [height, width], True for samples whose colour is that of what is behind.
    """

    shown: Samples
    core: NDArray[np.intp]
    share: NDArray[np.float64]
    outer: NDArray[np.intp]
    free: Samples


ALL_IN_PLACE = Moved()
"""Value for a view of which no neighbour has moved."""

ALL_REMOVED = ((None, False),)
"""Value of `Moved.behind` that counts everything behind as moved."""


@dataclass(frozen=True, eq=False)
class Occlusion:
    """Cuts of a view, whose samples lie on the canvas pixels of a box.

    The boundaries are those that the layers had when the view was made. Later changes of the layers
    do not change them.

    Attributes:
        own: Boundary of the layer itself, which cuts off everything outside; None cuts nothing.
        fronts: Boundaries of layers in front, which cut off everything inside.
        box: Rectangle of the view: x, y, width, height in canvas pixels.
        within: bool [height, width], True for the samples in the mask of the view; None = all.
        unmix: Whether samples at the layer's own boundary are unmixed, not filled [PYR-52].
    """

    own: Boundary | None
    fronts: tuple[Boundary, ...]
    box: Box
    within: Samples | None = None
    unmix: bool = True

    @staticmethod
    def of(
        numbers: Sequence[int],
        layer: int,
        boundaries: Sequence[Boundary | None],
        box: Box,
        within: Samples | None = None,
    ) -> Occlusion | None:
        """Makes the cuts of a view from the numbers of the layers that cut it.

        Args:
            numbers: Ascending numbers of layers with a boundary: `layer` itself, or in front of it.
            layer: Number of the layer that shows the view.
            boundaries: Boundaries of all layers at rest, back to front.
            box: Rectangle of the view in canvas pixels.
            within: bool [height, width], True for the samples in the mask; None = all.

        Returns:
            The cuts; None if `numbers` is empty.
        """
        if not numbers:
            return None
        fronts = (boundaries[n] for n in numbers if n > layer)
        own = boundaries[layer] if layer in numbers else None
        return Occlusion(own, tuple(b for b in fronts if b is not None), box, within)

    def numbers(self, layer: int, boundaries: Sequence[Boundary | None]) -> list[int] | None:
        """Finds the numbers of the layers that cut the view; the inverse of `of`.

        Args:
            layer: Number of the layer that shows the view.
            boundaries: Boundaries of all layers at rest, back to front.

        Returns:
            The ascending numbers; None if a boundary in `fronts` no longer belongs to a layer in
            front, or `own` no longer to the layer itself.
        """
        found = self._matched(layer, boundaries)
        if len(found) < len({*self.fronts}) or not self._owns(boundaries[layer]):
            return None
        return sorted({*found.values(), *([] if self.own is None else [layer])})

    def removed(
        self, layer: int, boundaries: Sequence[Boundary | None]
    ) -> tuple[Moved, Occlusion | None]:
        """Separates the cuts by boundaries that no longer belong to a layer from the others.

        Args:
            layer: Number of the layer that shows the view.
            boundaries: Boundaries of all layers at rest, back to front.

        Returns:
            The boundaries that are gone, and the cuts that are left, or None.
        """
        found = self._matched(layer, boundaries)
        owns = self._owns(boundaries[layer])
        gone = Moved(
            frozenset(f for f in self.fronts if f not in found), () if owns else ALL_REMOVED
        )
        fronts = tuple(f for f in self.fronts if f in found)
        left = replace(self, own=self.own if owns else None, fronts=fronts, within=None)
        return gone, left if left.own or left.fronts else None

    def moved(
        self,
        layer: int,
        boundaries: Sequence[Boundary | None],
        still: Sequence[bool],
        soft: frozenset[int] = frozenset(),
    ) -> Moved:
        """Finds the neighbours that have moved relative to the layer that shows the view.

        Args:
            layer: Number of the layer for which the view was cut.
            boundaries: Boundaries of all layers at rest, back to front.
            still: For each layer, whether it rests on the layer that shows the view.
            soft: Numbers of layers that show a matte, and so need not hide what is behind them.
        """
        found = self._matched(layer, boundaries)
        fronts = (f for f in self.fronts if f not in found or not still[found[f]])
        behind: tuple[tuple[Boundary | None, bool], ...] = ALL_REMOVED
        if self._owns(boundaries[layer]):
            below = [] if self.own is None else range(layer - 1, -1, -1)
            behind = tuple((boundaries[k], still[k]) for k in below if not (still[k] and k in soft))
            if all(rests for _, rests in behind):
                behind = ()
        return Moved(frozenset(fronts), behind)

    def _owns(self, boundary: Boundary | None) -> bool:
        """Whether `own`, if there is one, equals the present boundary of the layer."""
        return self.own is None or _equal(self.own, boundary)

    def _matched(self, layer: int, boundaries: Sequence[Boundary | None]) -> dict[Boundary, int]:
        """Finds layers in front of layer `layer` that have the boundaries in `fronts`.

        A layer with the same boundary object is preferred to one with an equal boundary, and among
        several the rearmost.

        Returns:
            Numbers of the layers by boundary, for the boundaries that were found.
        """
        found: dict[Boundary, int] = {}
        wanted = set(self.fronts)
        for n in range(len(boundaries) - 1, layer, -1):
            boundary = boundaries[n]
            if boundary in wanted:
                found[boundary] = n
        for front in wanted - found.keys():
            later = range(layer + 1, len(boundaries))
            number = next((n for n in later if _equal(front, boundaries[n])), None)
            if number is not None:
                found[front] = number
        return found

    @cached_property
    def shown(self) -> Samples:
        """Samples that show if nothing has moved, bool [height, width] [PYR-41].

        They are in the mask, no boundary in front covers them fully, and the layer's own covers
        them at least in part. So the layer contributes to each. If there are none, all in the mask
        show.
        """
        shown = self._left(ALL_IN_PLACE)
        if shown.any():
            return shown
        return ~shown if self.within is None else self.within

    @cached_property
    def trusted(self) -> Samples:
        """Samples that hidden ones are filled from, bool [height, width] [PYR-41].

        They show, and no sample within `REACH` of them is cut even in part. If there are none,
        those that show are trusted.
        """
        return self.kept(self.everything)

    @property
    def everything(self) -> Moved:
        """Value of `Moved` as if everything that cuts the view had moved."""
        return Moved(frozenset(self.fronts), ALL_REMOVED)

    def kept(self, moved: Moved) -> Samples:
        """Samples without a trace of neighbours that have moved, bool [height, width].

        Near a boundary that has moved, samples are mixtures with a colour that is no longer beside
        them. So only trusted ones are left there. If there are none at all, it is `shown`.
        """
        return _kept(self, moved)

    def edge(self, moved: Moved) -> Edge | None:
        """Samples at the layer's own boundary that are to be unmixed; None if there are none."""
        if self.own is None or not self.unmix or not moved.behind:
            return None
        return _edge(self, moved)

    def seen(self, moved: Moved) -> Samples:
        """Samples that show when neighbours have moved, bool [height, width] [PYR-46, PYR-52].

        They are those of `kept`, and those that are unmixed at the layer's own boundary.
        """
        if self.own is None or not self.unmix or not moved.behind:
            return self.kept(moved)
        edge = self.edge(moved)
        return self.shown if edge is None else edge.shown

    def loose(self, moved: Moved) -> Samples:
        """Samples near others behind which something has changed, bool [height, width] [PYR-53].

        These are all if no boundary of the layer itself cuts the view, or one moved behind it.
        """
        if self.own is None or moved.apart:
            return np.ones(self.box[:1:-1], np.bool_)
        return ~_eroded(~self._bared(moved))

    def _left(self, moved: Moved) -> Samples:
        """Samples that are not cut off fully, and not near a cut by a neighbour that has moved.

        There may be none.
        """
        left = self._open(moved)
        if self.own is not None:
            some, whole = self._covered(self.own)
            left &= some
            if moved.behind:
                left &= _eroded(whole | ~self._bared(moved))
        return left

    def _open(self, moved: Moved) -> Samples:
        """Samples of the mask that layers in front leave, as `_left`."""
        _, _, width, height = self.box
        left, clear = np.ones((2, height, width), np.bool_)
        if self.within is not None:
            left &= self.within
        for boundary in self.fronts:
            some, whole = self._covered(boundary)
            left &= ~whole
            if boundary in moved.fronts:
                clear &= ~some
        return left & _eroded(clear)

    def _bared(self, moved: Moved) -> Samples:
        """Samples behind which a layer has moved that no resting one in between covers fully."""
        _, _, width, height = self.box
        bared, hidden = np.zeros((2, height, width), np.bool_)
        for boundary, rests in moved.behind:
            some, whole = self._covered(boundary)
            if rests:
                hidden |= whole
            else:
                bared |= some & ~hidden
        return bared

    def _covered(self, boundary: Boundary | None) -> tuple[Samples, Samples]:
        """Samples that a boundary covers at least in part, and samples that it covers fully."""
        _, _, width, height = self.box
        some, whole = np.full((2, height, width), boundary is None)
        if boundary is not None:
            for at, covered in self._coverage(boundary):
                some[at], whole[at] = covered > 0, covered == FULL
        return some, whole

    def _coverage(
        self, boundary: Boundary
    ) -> Iterator[tuple[tuple[slice, slice], NDArray[np.int32]]]:
        """Yields parts of the box that a boundary may cover, with the coverage of their pixels."""
        x, y, width, height = self.box
        left, top, right, bottom = boundary.bounds()
        x0, x1 = max(left, x), min(right, x + width)
        y0, y1 = max(top, y), min(bottom, y + height)
        if x0 >= x1 or y0 >= y1:
            return
        paths = [
            np.stack([to_output(p[:, k], boundary.unit, 0, 1, 1) for k in (0, 1)], axis=1)
            for p in boundary.paths
        ]
        columns, step = slice(x0 - x, x1 - x), max(BAND // (x1 - x0), 1)
        for row in range(y0, y1, step):
            rows = min(step, y1 - row)
            at = slice(row - y, row - y + rows), columns
            yield at, coverage(paths, x0, row, x1 - x0, rows)


@lru_cache(maxsize=64)
def _kept(cuts: Occlusion, moved: Moved) -> Samples:
    """Computes `Occlusion.kept`; cached, as `moved` stays the same while a layer is dragged."""
    kept = cuts._left(moved)
    return kept if kept.any() else cuts.shown


@lru_cache(maxsize=16)
def _edge(cuts: Occlusion, moved: Moved) -> Edge | None:
    """Computes `Occlusion.edge`."""
    assert cuts.own is not None, "the layer has a boundary"
    covered = np.zeros(cuts.box[:1:-1], np.int32)
    for at, values in cuts._coverage(cuts.own):
        covered[at] = values
    left = cuts._open(moved)
    near = left & ~_eroded((covered == FULL) | ~cuts._bared(moved), 1)
    outer = near & (2 * covered < FULL)
    shown = left & (covered > 0) & ~outer
    if not shown.any():
        return None
    free = _eroded(covered == 0, 1)
    if cuts.within is not None:
        free &= cuts.within
    for boundary in cuts.fronts:
        free &= ~cuts._covered(boundary)[0]
    core = np.flatnonzero(near & ~outer)
    share = np.maximum(_smooth(covered).ravel()[core] / (36 * FULL), 0.5)
    return Edge(shown, core, share, np.flatnonzero(outer), free)


def _smooth(covered: NDArray[np.int32]) -> NDArray[np.int64]:
    """Coverage [h, w] weighed 1, 4, 1 across and down; beyond the array it is that at the edge."""
    padded = np.pad(covered.astype(np.int64), 1, mode="edge")
    rows = padded[:-2] + 4 * padded[1:-1] + padded[2:]
    return np.asarray(rows[:, :-2] + 4 * rows[:, 1:-1] + rows[:, 2:])


def _eroded(samples: Samples, reach: int | None = None) -> Samples:
    """Mask eroded across and down, by default by `REACH`; True beyond the array."""
    if samples.all():
        return samples
    reach = REACH if reach is None else reach
    for axis, size in enumerate(samples.shape):
        beside = [(reach, reach) if k == axis else (0, 0) for k in (0, 1)]
        padded = np.pad(samples, beside, constant_values=True)
        shifted = (np.arange(size) + k for k in range(2 * reach + 1))
        samples = np.logical_and.reduce([padded.take(at, axis) for at in shifted])
    return samples


def _equal(one: Boundary | None, other: Boundary | None) -> bool:
    """Whether two boundaries are the same, or have equal units and control points."""
    if one is other:
        return True
    return (
        one is not None
        and other is not None
        and one.unit == other.unit
        and one.segments == other.segments
        and all((p == q).all() for p, q in zip(one.paths, other.paths, strict=True))
    )
