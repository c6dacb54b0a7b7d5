"""Which samples of a view show, and which tell what is hidden, where boundaries at rest say it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

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


@dataclass(frozen=True, eq=False)
class Cuts:
    """What boundaries leave of a view whose samples lie on the canvas pixels of a box.

    Boundaries are those of layers when the view was made: what becomes of these changes nothing.

    Attributes:
        own: The layer's boundary, outside of which it has no samples; None cuts nothing off.
        fronts: Boundaries of layers in front of it, inside of which it has no samples.
        box: x, y, width, height of the view in canvas pixels.
    """

    own: Boundary | None
    fronts: tuple[Boundary, ...]
    box: Box

    @staticmethod
    def of(
        numbers: Sequence[int], layer: int, boundaries: Sequence[Boundary | None], box: Box
    ) -> Cuts | None:
        """The cuts by layers `numbers`, of a view that layer `layer` shows in `box`.

        Args:
            numbers: Layers with a boundary, `layer` itself or in front of it; empty gives None.
            layer: Number of the layer.
            boundaries: Of all layers, back to front.
            box: Where the view lies.
        """
        if not numbers:
            return None
        fronts = (boundaries[n] for n in numbers if n > layer)
        own = boundaries[layer] if layer in numbers else None
        return Cuts(own, tuple(b for b in fronts if b is not None), box)

    def numbers(self, layer: int, boundaries: Sequence[Boundary | None]) -> list[int] | None:
        """Ascending numbers for `of`; None if a boundary is not, or no longer, where it was.

        Of equal boundaries the hindmost in front of the layer is named, those that are not only
        equal but the same object before others.
        """
        if self.own is not None and not _equal(self.own, boundaries[layer]):
            return None
        found: dict[Boundary, int] = {}
        wanted = set(self.fronts)
        for n in range(len(boundaries) - 1, layer, -1):
            boundary = boundaries[n]
            if boundary in wanted:
                found[boundary] = n
        for front in self.fronts:
            if front not in found:
                later = range(layer + 1, len(boundaries))
                number = next((n for n in later if _equal(front, boundaries[n])), None)
                if number is None:
                    return None
                found[front] = number
        return sorted({*found.values(), *([] if self.own is None else [layer])})

    @cached_property
    def shown(self) -> Samples:
        """The samples that are taken as they are, bool [height, width]; all if none would be.

        Those that no front covers wholly, and of which `own` covers something: all that the layer
        contributes to where nothing was moved, mixed with what is beside it or not.
        """
        shown = self._left(mixed=True)
        return shown if shown.any() else ~shown

    @cached_property
    def trusted(self) -> Samples:
        """The samples that others are filled from, bool [height, width]; `shown` if none would be.

        Those further than `REACH` from samples that a front covers, or `own` does not, in part.
        """
        trusted = self._left(mixed=False)
        return trusted if trusted.any() else self.shown

    def lasting(self, own: Boundary | None, fronts: Collection[Boundary | None]) -> Samples:
        """The samples to keep, bool [height, width], once some boundaries are gone; never none.

        At these they are the trusted ones: no layer is left that mixed ones would fit.

        Args:
            own: The boundary that the layer has now.
            fronts: Those that are in front of it now.
        """

        def only(left: bool) -> Cuts:
            kept = (f for f in self.fronts if any(_equal(f, v) for v in fronts) == left)
            return Cuts(self.own if _equal(self.own, own) == left else None, (*kept,), self.box)

        kept = only(True)._left(mixed=True) & only(False)._left(mixed=False)
        return kept if kept.any() else self.shown

    def _left(self, mixed: bool) -> Samples:
        """The samples that are not cut off as a whole, or if not `mixed`, that have none cut near.

        Unlike what is made of them, they may be none.
        """
        _, _, width, height = self.box
        left = np.ones((height, width), np.bool_)
        for k, boundary in enumerate((self.own, *self.fronts)):
            if boundary is not None:
                clear = np.full((height, width), k > 0)
                for at, covered in self._coverage(boundary):
                    lost = covered if k else FULL - covered
                    clear[at] = lost < FULL if mixed else lost == 0
                left &= clear
        return left if mixed else _eroded(left)

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
