"""Cache of computed colours, so that rendering after an edit only computes what has changed."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

BYTES_MAX = 1 << 27
"""Most bytes of the colours in a cache; the least recently used go first."""

SAMPLES_MAX = 1 << 21
"""Most samples of a view that is cached: the tiles of a larger one would displace each other."""


class Sheet:
    """Coverage and colours of one layer on the rows of a rectangle of samples that it may cover.

    Samples are numbered row by row in the rectangle.

    Attributes:
        coverage: float32 [stop - start] in 0..1; None for a layer that covers everything.
        start: Number of the first sample.
        stop: Number of the sample after the last.
        known: bool [stop - start], True where `colour` is computed.
        colour: float32 [stop - start, 4] premultiplied colour and alpha, before opacity and the
            colour matrix; 0 where it is not known.
    """

    def __init__(self, coverage: NDArray[np.float32] | None, start: int, stop: int) -> None:
        self.coverage, self.start, self.stop = coverage, start, stop
        self.known = np.zeros(stop - start, bool)
        self.colour = np.zeros((stop - start, 4), np.float32)


class Cache:
    """Sheets of an image and its edited copies; a key holds everything that a sheet depends on."""

    def __init__(self) -> None:
        self._sheets: OrderedDict[Hashable, Sheet] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Sheet | None:
        """Returns the sheet of a key, or None."""
        with self._lock:
            sheet = self._sheets.get(key)
            if sheet is not None:
                self._sheets.move_to_end(key)
            return sheet

    def put(self, key: Hashable, sheet: Sheet) -> None:
        """Stores a sheet, and drops the least recently used ones above `BYTES_MAX`."""
        with self._lock:
            if key not in self._sheets:
                self._bytes += sheet.colour.nbytes
            self._sheets[key] = sheet
            while self._bytes > BYTES_MAX and len(self._sheets) > 1:
                self._bytes -= self._sheets.popitem(last=False)[1].colour.nbytes

    def clear(self) -> None:
        """Drops all sheets."""
        with self._lock:
            self._sheets.clear()
            self._bytes = 0
