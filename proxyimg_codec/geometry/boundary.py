"""A layer's boundary: closed cubic Bézier paths with integer control points, and their coding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..entropy import arrays
from ..errors import FormatError

COORDINATE_MAX = 1 << 26
"""Control points lie strictly within -COORDINATE_MAX .. COORDINATE_MAX units."""

_ESCAPE = 15
"""Class of deltas of 15 bits and more, whose magnitude takes 31 raw bits."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Closed paths filled by the nonzero rule.

    Attributes:
        unit: Coordinates are multiples of 2**-unit canvas pixels, 0..6.
        paths: For each path int64 [3 m, 2] control points (x, y): P0, C1, C2, P1, C3, C4, ...;
            segment k runs through points 3k, 3k + 1, 3k + 2 and 3k + 3 modulo 3m.
    """

    unit: int
    paths: tuple[NDArray[np.int64], ...]

    @property
    def segments(self) -> list[int]:
        """Number of Bézier segments of each path."""
        return [len(p) // 3 for p in self.paths]

    def bounds(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 of whole canvas pixels that hold all control points."""
        points = np.concatenate(self.paths)
        low = points.min(0) >> self.unit
        high = -(-points.max(0) >> self.unit)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def encode(boundary: Boundary | None) -> dict[str, Any]:
    """The fields unit, segments, classes and deltas of LAYR; None is the whole canvas."""
    if boundary is None:
        return {"unit": 0, "segments": [], "classes": b"", "deltas": b""}
    starts = np.array([p[0] for p in boundary.paths])
    deltas = []
    for path, origin in zip(boundary.paths, [np.zeros(2, np.int64), *starts[:-1]], strict=True):
        deltas.append(np.diff(path, axis=0, prepend=origin[None]).reshape(-1, 6))
    flat = np.concatenate(deltas).T
    bits = np.where(flat == 0, 0, np.floor(np.log2(np.maximum(np.abs(flat), 1))) + 1).astype(
        np.int64
    )
    classes = np.minimum(bits, _ESCAPE)
    coded = arrays.encode(classes[:, None, :], 4, np.ones((1, flat.shape[1]), bool))
    raw = "".join(
        f"{int(d < 0)}{_magnitude(int(abs(d)), int(c))}"
        for d, c in zip(flat.ravel(), classes.ravel(), strict=True)
        if c
    )
    raw += "0" * (-len(raw) % 8)
    packed = int(raw, 2).to_bytes(len(raw) // 8, "big") if raw else b""
    return {
        "unit": boundary.unit,
        "segments": boundary.segments,
        "classes": coded,
        "deltas": packed,
    }


def _magnitude(value: int, klass: int) -> str:
    if klass == _ESCAPE:
        return f"{value:031b}"
    return f"{value:b}"[1:]


def decode(fields: Mapping[str, Any], where: str) -> Boundary | None:
    """Inverse of `encode`.

    Raises:
        FormatError: Corrupt streams or coordinates out of range.
    """
    if not fields["segments"]:
        if fields["classes"] or fields["deltas"] or fields["unit"]:
            raise FormatError("a layer without segments has boundary data", where)
        return None
    total = sum(fields["segments"])
    stored = np.ones((1, total), bool)
    classes = arrays.decode(fields["classes"], (6, 1, total), 4, stored).ravel().astype(np.int64)
    flat = _read_deltas(fields["deltas"], classes, where).reshape(6, total).T
    paths = []
    origin = np.zeros(2, np.int64)
    for part in np.split(flat, np.cumsum(fields["segments"])[:-1]):
        path = np.cumsum(part.reshape(-1, 2), axis=0) + origin
        if np.abs(path).max() >= COORDINATE_MAX:
            raise FormatError("a control point is out of range", where)
        paths.append(path)
        origin = path[0]
    return Boundary(fields["unit"], tuple(paths))


def _read_deltas(data: bytes, classes: NDArray[np.int64], where: str) -> NDArray[np.int64]:
    """Signed deltas [N] from the raw bits after each class [N]."""
    width = np.where(classes == _ESCAPE, 32, classes)
    ends = np.cumsum(width)
    total = int(ends[-1])
    if len(data) != (total + 7) // 8:
        raise FormatError("the raw bits of the boundary have the wrong length", where)
    bits = np.unpackbits(np.frombuffer(data, np.uint8)).astype(np.int64)
    if bits[total:].any():
        raise FormatError("padding bits of the boundary are not zero", where)
    out = np.zeros(len(classes), np.int64)
    for k in np.unique(classes[classes > 0]):
        at = np.flatnonzero(classes == k)
        n = 31 if k == _ESCAPE else int(k) - 1
        first = ends[at] - n
        weights = np.int64(1) << np.arange(n - 1, -1, -1, dtype=np.int64)
        value = bits[first[:, None] + np.arange(n)] @ weights
        if k == _ESCAPE and (value < 1 << (_ESCAPE - 1)).any():
            raise FormatError("a delta is coded in a larger class than it needs", where)
        value += 0 if k == _ESCAPE else 1 << n
        out[at] = np.where(bits[first - 1] == 1, -value, value)
    return out
