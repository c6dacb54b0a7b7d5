"""Colours that were computed before, so that an edit costs only what it changed."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

BYTES_MAX = 1 << 27
"""Memory of a cache; what was not used for longest goes first."""

SAMPLES_MAX = 1 << 21
"""Larger views are not cached: they would only push each other out."""


class Sheet:
    """One layer on one rectangle of samples: the rows that it may cover.

    Attributes:
        coverage: float32 [stop - start] in 0..1, or None for a layer that covers everything.
        start: First sample, in rows of the rectangle.
        stop: The sample after the last.
        known: bool [stop - start] where `colour` is computed.
        colour: float32 [stop - start, 4] premultiplied, before opacity and the colour matrix; 0
            where not known.
    """

    def __init__(self, coverage: NDArray[np.float32] | None, start: int, stop: int) -> None:
        self.coverage, self.start, self.stop = coverage, start, stop
        self.known = np.zeros(stop - start, bool)
        self.colour = np.zeros((stop - start, 4), np.float32)


class Cache:
    """The sheets of an image and of those made from it by edits, by what they depend on."""

    def __init__(self) -> None:
        self._sheets: OrderedDict[Hashable, Sheet] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Sheet | None:
        """The sheet of a key."""
        with self._lock:
            sheet = self._sheets.get(key)
            if sheet is not None:
                self._sheets.move_to_end(key)
            return sheet

    def put(self, key: Hashable, sheet: Sheet) -> None:
        """Keeps a sheet, and forgets others if there is too much."""
        with self._lock:
            if key not in self._sheets:
                self._bytes += sheet.colour.nbytes
            self._sheets[key] = sheet
            while self._bytes > BYTES_MAX and len(self._sheets) > 1:
                self._bytes -= self._sheets.popitem(last=False)[1].colour.nbytes

    def clear(self) -> None:
        """Forgets everything."""
        with self._lock:
            self._sheets.clear()
            self._bytes = 0
