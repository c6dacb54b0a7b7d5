"""Which samples of a view show, and which tell what is hidden, where boundaries at rest say it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.boundary import Boundary
from ..geometry.coverage import FULL, coverage, to_output
from .implicit import Box

BAND = 1 << 18
"""Pixels whose coverage is computed at a time; bounds memory."""

REACH = 2
"""Samples that a boundary spoils on either side of itself, by blur and by coding."""

Samples = NDArray[np.bool_]


class Moved(NamedTuple):
    """What no longer lies to a view as it did when its samples were mixed.

    Attributes:
        fronts: Those of `Occlusion.fronts` that do not.
        behind: Boundaries of what lay behind, front to back, None being everywhere, each with
            whether it still lies as it did; empty if all do.
    """

    fronts: frozenset[Boundary] = frozenset()
    behind: tuple[tuple[Boundary | None, bool], ...] = ()


ALL_IN_PLACE = Moved()
"""All is as it was."""

ALL_REMOVED = ((None, False),)
"""`Moved.behind` if nothing is left of what lay behind."""


@dataclass(frozen=True, eq=False)
class Occlusion:
    """What boundaries leave of a view whose samples lie on the canvas pixels of a box.

    Boundaries are those of layers when the view was made: what becomes of these changes nothing.

    Attributes:
        own: The layer's boundary, outside of which it has no samples; None cuts nothing off.
        fronts: Boundaries of layers in front of it, inside of which it has no samples.
        box: x, y, width, height of the view in canvas pixels.
        within: The samples that a mask leaves, bool [height, width]; None = all.
    """

    own: Boundary | None
    fronts: tuple[Boundary, ...]
    box: Box
    within: Samples | None = None

    @staticmethod
    def of(
        numbers: Sequence[int],
        layer: int,
        boundaries: Sequence[Boundary | None],
        box: Box,
        within: Samples | None = None,
    ) -> Occlusion | None:
        """The cuts by layers `numbers`, of a view that layer `layer` shows in `box`.

        Args:
            numbers: Layers with a boundary, `layer` itself or in front of it; empty gives None.
            layer: Number of the layer.
            boundaries: Of all layers, back to front.
            box: Where the view lies.
            within: The samples that a mask leaves; None = all.
        """
        if not numbers:
            return None
        fronts = (boundaries[n] for n in numbers if n > layer)
        own = boundaries[layer] if layer in numbers else None
        return Occlusion(own, tuple(b for b in fronts if b is not None), box, within)

    def numbers(self, layer: int, boundaries: Sequence[Boundary | None]) -> list[int] | None:
        """Ascending numbers for `of`; None if a boundary is not, or no longer, where it was."""
        found = self._matched(layer, boundaries)
        if len(found) < len({*self.fronts}) or not self._owns(boundaries[layer]):
            return None
        return sorted({*found.values(), *([] if self.own is None else [layer])})

    def removed(
        self, layer: int, boundaries: Sequence[Boundary | None]
    ) -> tuple[Moved, Occlusion | None]:
        """What is gone of the boundaries, and the cuts by those that are left, if any."""
        found = self._matched(layer, boundaries)
        owns = self._owns(boundaries[layer])
        gone = Moved(
            frozenset(f for f in self.fronts if f not in found), () if owns else ALL_REMOVED
        )
        left = Occlusion(
            self.own if owns else None, tuple(f for f in self.fronts if f in found), self.box
        )
        return gone, left if left.own or left.fronts else None

    def moved(
        self,
        layer: int,
        boundaries: Sequence[Boundary | None],
        still: Sequence[bool],
        raster: Sequence[bool],
    ) -> Moved:
        """What has moved away from a view that layer `layer` was cut for.

        Args:
            layer: Number of the layer.
            boundaries: Of all layers, back to front.
            still: Whether each lies to who shows the view as it did at rest.
            raster: Whether each shows something of the same raster.
        """
        found = self._matched(layer, boundaries)
        fronts = (f for f in self.fronts if f not in found or not still[found[f]])
        behind: tuple[tuple[Boundary | None, bool], ...] = ALL_REMOVED
        if self._owns(boundaries[layer]):
            below = [] if self.own is None else range(layer - 1, -1, -1)
            behind = tuple((boundaries[k], still[k]) for k in below if raster[k])
            if all(rests for _, rests in behind):
                behind = ()
        return Moved(frozenset(fronts), behind)

    def _owns(self, boundary: Boundary | None) -> bool:
        """Whether the layer's own boundary, if it cuts, is this one."""
        return self.own is None or _equal(self.own, boundary)

    def _matched(self, layer: int, boundaries: Sequence[Boundary | None]) -> dict[Boundary, int]:
        """The layers in front of layer `layer` that have the boundaries of `fronts`.

        Of equal boundaries the hindmost is named, those that are not only equal but the same
        object before others.
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
        """The samples that are taken as they are, bool [height, width]; `within` if none would be.

        Those that no front covers wholly, and of which `own` covers something: all that the layer
        contributes to where nothing was moved, mixed with what is beside it or not.
        """
        shown = self._left(ALL_IN_PLACE)
        if shown.any():
            return shown
        return ~shown if self.within is None else self.within

    @cached_property
    def trusted(self) -> Samples:
        """The samples that others are filled from, bool [height, width]; `shown` if none would be.

        Those further than `REACH` from samples that a front covers, or `own` does not, in part.
        """
        return self.kept(self.everything)

    @property
    def everything(self) -> Moved:
        """All that cuts, as if it had moved."""
        return Moved(frozenset(self.fronts), ALL_REMOVED)

    def kept(self, moved: Moved) -> Samples:
        """The samples to take as they are, bool [height, width]; `shown` if none would be.

        Near what has moved they are the trusted ones: mixed ones fit nothing that is left there.
        """
        return _kept(self, moved)

    def _left(self, moved: Moved) -> Samples:
        """The samples that are not cut off as a whole, nor near a cut by what has moved.

        Unlike what is made of them, they may be none.
        """
        _, _, width, height = self.box
        left, clear = np.ones((2, height, width), np.bool_)
        if self.within is not None:
            left &= self.within
        for boundary in self.fronts:
            some, whole = self._covered(boundary)
            left &= ~whole
            if boundary in moved.fronts:
                clear &= ~some
        if self.own is not None:
            some, whole = self._covered(self.own)
            left &= some
            if moved.behind:
                clear &= whole | ~self._bared(moved)
        return left & _eroded(clear)

    def _bared(self, moved: Moved) -> Samples:
        """The samples of which the first thing behind has moved; that may cover them in part."""
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
        """The samples of which a boundary covers something, and all."""
        _, _, width, height = self.box
        some, whole = np.full((2, height, width), boundary is None)
        if boundary is not None:
            for at, covered in self._coverage(boundary):
                some[at], whole[at] = covered > 0, covered == FULL
        return some, whole

    def _coverage(
        self, boundary: Boundary
    ) -> Iterator[tuple[tuple[slice, slice], NDArray[np.int32]]]:
        """Parts of the box that a boundary may cover, and the coverage of their pixels."""
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
    """`Occlusion.kept`; what has moved often stays the same while it is dragged."""
    kept = cuts._left(moved)
    return kept if kept.any() else cuts.shown


def _eroded(samples: Samples) -> Samples:
    """Those of which no sample within `REACH`, across and down, is missing."""
    for axis, size in enumerate(samples.shape):
        beside = [(REACH, REACH) if k == axis else (0, 0) for k in (0, 1)]
        padded = np.pad(samples, beside, constant_values=True)
        shifted = (np.arange(size) + k for k in range(2 * REACH + 1))
        samples = np.logical_and.reduce([padded.take(at, axis) for at in shifted])
    return samples


def _equal(one: Boundary | None, other: Boundary | None) -> bool:
    """Whether boundaries are stored alike."""
    if one is other:
        return True
    return (
        one is not None
        and other is not None
        and one.unit == other.unit
        and one.segments == other.segments
        and all((p == q).all() for p, q in zip(one.paths, other.paths, strict=True))
    )
