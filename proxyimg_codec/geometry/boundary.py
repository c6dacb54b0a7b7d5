"""Boundary of a layer: closed cubic Bézier paths with integer control points, and their coding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from . import deltas

COORDINATE_MAX = 1 << 26
"""Bound of coordinates: control points are less than this in magnitude, in units."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Closed paths, filled by the nonzero rule.

    Attributes:
        unit: Coordinates are multiples of 2**-unit canvas pixels; 0..6 in a file.
        paths: For each path of m segments int64 [3 m, 2] control points (x, y): P0, C1, C2, P1, C3,
            C4, ... Segment k has the control points 3k, 3k + 1, 3k + 2 and 3k + 3 modulo 3m.
    """

    unit: int
    paths: tuple[NDArray[np.int64], ...]

    @property
    def segments(self) -> list[int]:
        """Number of Bézier segments of each path."""
        return [len(p) // 3 for p in self.paths]

    def bounds(self) -> tuple[int, int, int, int]:
        """Smallest rectangle x0, y0, x1, y1 of whole pixels that holds all control points."""
        points = np.concatenate(self.paths)
        low = points.min(0) >> self.unit
        high = -(-points.max(0) >> self.unit)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def encode(boundary: Boundary | None) -> dict[str, Any]:
    """Encodes a boundary as the fields unit, segments, classes and deltas of LAYR.

    Args:
        boundary: Boundary at rest; None for the whole canvas.
    """
    if boundary is None:
        return {"unit": 0, "segments": [], "classes": b"", "deltas": b""}
    starts = np.array([p[0] for p in boundary.paths])
    steps = []
    for path, origin in zip(boundary.paths, [np.zeros(2, np.int64), *starts[:-1]], strict=True):
        steps.append(np.diff(path, axis=0, prepend=origin[None]).reshape(-1, 6))
    classes, raw = deltas.encode(np.concatenate(steps).T)
    return {
        "unit": boundary.unit,
        "segments": boundary.segments,
        "classes": classes,
        "deltas": raw,
    }


def decode(fields: Mapping[str, Any], where: str) -> Boundary | None:
    """Decodes the boundary of a layer.

    Args:
        fields: Values of LAYR.
        where: Name of the chunk in error messages.

    Returns:
        The boundary at rest; None for the whole canvas.

    Raises:
        FormatError: A stream is corrupt, or a coordinate is out of range.
    """
    if not fields["segments"]:
        if fields["classes"] or fields["deltas"] or fields["unit"]:
            raise FormatError("a layer without segments has boundary data", where, rule="CHK-8")
        return None
    total = sum(fields["segments"])
    flat = deltas.decode(fields["classes"], fields["deltas"], 6, total, where).T
    paths = []
    origin = np.zeros(2, np.int64)
    for part in np.split(flat, np.cumsum(fields["segments"])[:-1]):
        path = np.cumsum(part.reshape(-1, 2), axis=0) + origin
        if np.abs(path).max() >= COORDINATE_MAX:
            raise FormatError("a control point is out of range", where, rule="GEO-6")
        paths.append(path)
        origin = path[0]
    return Boundary(fields["unit"], tuple(paths))
