"""The present state of a layer: where it was moved, how it was bent, how it is shown.

A pose stands over the geometry at rest: first its nodes are displaced, then an affine map is
applied. Both are fixed-point, so that moving there and back is exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError
from . import deltas
from .mesh import FRACTION_BITS, Mesh, Refined

Ints = NDArray[np.int64]
Matrix = tuple[float, float, float, float, float, float]
"""a, b, c, d, e, f: x' = a x + c y + e, y' = b x + d y + f, in canvas pixels (as in SVG)."""

MATRIX_BITS = 24
MATRIX_MAX = 1 << 31
"""Matrix entries are in 2**-24 and below 2**31: less than 128 times larger."""

SHIFT_MAX = 1 << 33
"""Shifts are in 1/1024 px and below 2**33."""

POINT_MAX = 1 << 30
"""Points are clamped to that many 1/1024 px before they are mapped."""

NODE_BITS = 4
"""Displacements of nodes are in 1/16 px."""

NODE_MAX = 1 << 24

OPACITY_MAX = 65535
COLOUR_BITS = 12
COLOUR_MAX = 1 << 20
"""Entries of the colour matrix are in 2**-12 and at most 2**20 in magnitude."""

_UNIT = 1 << MATRIX_BITS


@dataclass(frozen=True, eq=False)
class Pose:
    """What edits have done to a layer.

    Attributes:
        matrix: a, b, c, d of the affine map in 2**-24.
        shift: e, f of the affine map in 1/1024 canvas pixel.
        nodes: int64 [N, 2] displacement of each node in 1/16 canvas pixel, or None.
        places: int64 [N, 2] displacement of the point of the texture that each node shows, in
            1/16 canvas pixel, or None.
        opacity: 0..65535.
        hidden: Whether the layer is not drawn.
        colour: Rows of a 3 x 4 matrix in 2**-12 that maps colour and one to colour, or ().
        sway: int64 [N, 2] further displacement of each node in 1/1024 canvas pixel, at a moment of
            a timeline, or None.
        body: The body that it sways with, or None: layers of one body sway as one.
    """

    matrix: tuple[int, int, int, int] = (_UNIT, 0, 0, _UNIT)
    shift: tuple[int, int] = (0, 0)
    nodes: Ints | None = None
    places: Ints | None = None
    opacity: int = OPACITY_MAX
    hidden: bool = False
    colour: tuple[int, ...] = ()
    sway: Ints | None = None
    body: int | None = None

    @property
    def affine(self) -> bool:
        """Whether the affine map does anything."""
        return self.matrix != (_UNIT, 0, 0, _UNIT) or self.shift != (0, 0)

    @property
    def mirrored(self) -> bool:
        """Whether the affine map exchanges left and right turns."""
        a, b, c, d = self.matrix
        return a * d < b * c

    @property
    def bent(self) -> bool:
        """Whether the mesh is needed to draw the layer."""
        return self.displaced or self.places is not None

    @property
    def displaced(self) -> bool:
        """Whether nodes are displaced before the affine map."""
        return self.nodes is not None or self.sway is not None

    @property
    def displacements(self) -> Ints:
        """int64 [N, 2] displacement of each node in 1/1024 canvas pixel, where `displaced`."""
        parts = [v for v in (self.sway,) if v is not None]
        if self.nodes is not None:
            parts.append(self.nodes << (FRACTION_BITS - NODE_BITS))
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]

    @property
    def at_rest(self) -> bool:
        """Whether nothing was done at all."""
        plain = self.opacity == OPACITY_MAX and not self.hidden and not self.colour
        return plain and not self.affine and not self.bent

    def still(self, other: Pose) -> bool:
        """Whether layers in these poses lie to each other as at rest, and are drawn in full."""
        alike = (self.matrix, self.shift, self.body) == (other.matrix, other.shift, other.body)
        return alike and not any(
            p.nodes is not None or p.places is not None or p.hidden or p.opacity != OPACITY_MAX
            for p in (self, other)
        )

    @property
    def floats(self) -> Matrix:
        """The affine map in canvas pixels."""
        a, b, c, d = (v / _UNIT for v in self.matrix)
        e, f = (v / (1 << FRACTION_BITS) for v in self.shift)
        return a, b, c, d, e, f

    def apply(self, points: Ints) -> Ints:
        """Maps points [N, 2] in 1/1024 canvas pixel; exact, half up."""
        if not self.affine:
            return points
        x, y = np.clip(points, -POINT_MAX, POINT_MAX).T
        a, b, c, d = self.matrix
        half = 1 << (MATRIX_BITS - 1)
        return np.stack(
            [
                ((a * x + c * y + half) >> MATRIX_BITS) + self.shift[0],
                ((b * x + d * y + half) >> MATRIX_BITS) + self.shift[1],
            ],
            axis=1,
        )

    def present(self, refined: Refined) -> Ints:
        """Present positions [N, 2] of all nodes in 1/1024 canvas pixel."""
        return self.apply(refined.nodes + self.displacements if self.displaced else refined.nodes)

    def frozen(self) -> Pose:
        """The pose with its sway among the displacements of its nodes, in 1/16 px, half up."""
        if self.sway is None:
            return self
        shift = FRACTION_BITS - NODE_BITS
        nodes = (self.displacements + (1 << (shift - 1))) >> shift
        return replace(self, nodes=nodes if nodes.any() else None, sway=None, body=None)


REST = Pose()


def inverse(matrix: Matrix) -> Matrix:
    """The inverse of an affine map; its determinant must not be 0."""
    a, b, c, d, e, f = matrix
    # Exact: in floating point the determinant of a map that is not singular can become 0.
    det = float(Fraction(a) * Fraction(d) - Fraction(b) * Fraction(c))
    a, b, c, d = d / det, -b / det, -c / det, a / det
    return a, b, c, d, -(a * e + c * f), -(b * e + d * f)


def product(outer: Matrix, inner: Matrix) -> Matrix:
    """The affine map that does `inner` first, then `outer`."""
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    return (
        a * p + c * q, b * p + d * q, a * r + c * s, b * r + d * s,
        a * t + c * u + e, b * t + d * u + f,
    )  # fmt: skip


def fixed(matrix: Matrix) -> tuple[tuple[int, int, int, int], tuple[int, int]] | None:
    """Matrix and shift of a pose, rounded; None if it is singular or leaves the range."""
    if not all(map(math.isfinite, matrix)):
        return None
    a, b, c, d = (round(v * _UNIT) for v in matrix[:4])
    e, f = (round(v * (1 << FRACTION_BITS)) for v in matrix[4:])
    if max(map(abs, (a, b, c, d))) >= MATRIX_MAX or max(abs(e), abs(f)) >= SHIFT_MAX:
        return None
    return None if a * d == b * c else ((a, b, c, d), (e, f))


def encode(pose: Pose, mesh: Mesh | None) -> dict[str, Any]:
    """The fields of POSE, without the layer; a sway is rounded to displacements of nodes."""
    pose = pose.frozen()
    out: dict[str, Any] = {
        "matrix": list(pose.matrix), "shift": list(pose.shift), "opacity": pose.opacity,
        "hidden": int(pose.hidden), "colour": list(pose.colour),
    }  # fmt: skip
    for name, values in (("node", pose.nodes), ("place", pose.places)):
        classes = raw = b""
        if values is not None:
            assert mesh is not None, "displacements need a mesh"
            classes, raw = deltas.encode(residuals(values, mesh.refined).T)
        out |= {f"{name}_classes": classes, f"{name}_deltas": raw}
    return out


def decode(fields: Mapping[str, Any], mesh: Mesh | None, where: str) -> Pose:
    """Inverse of `encode`.

    Raises:
        FormatError: Corrupt streams, displacements without a mesh, a singular matrix, or a pose
            that does nothing.
    """
    a, b, c, d = fields["matrix"]
    if a * d == b * c:
        raise FormatError("the matrix is singular", where, rule="MSH-16")
    if len(fields["colour"]) not in (0, 12):
        raise FormatError("the colour matrix does not have 12 entries", where, rule="CHK-11")
    arrays: list[Ints | None] = []
    for name in ("node", "place"):
        coded, raw = fields[f"{name}_classes"], fields[f"{name}_deltas"]
        if not coded and raw:
            raise FormatError("displacements have raw bits without classes", where, rule="MSH-17")
        if not coded:
            arrays.append(None)
            continue
        if mesh is None:
            raise FormatError("displacements need a mesh", where, rule="MSH-17")
        refined = mesh.refined
        values = restored(deltas.decode(coded, raw, 2, len(refined.nodes), where).T, refined)
        if np.abs(values).max() >= NODE_MAX:
            raise FormatError("a displacement is out of range", where, rule="MSH-19")
        if not values.any():
            raise FormatError("displacements are all zero", where, rule="MSH-19")
        arrays.append(values)
    pose = Pose(
        (a, b, c, d), (fields["shift"][0], fields["shift"][1]), arrays[0], arrays[1],
        fields["opacity"], bool(fields["hidden"]), tuple(fields["colour"]),
    )  # fmt: skip
    if pose.at_rest:
        raise FormatError("the pose does nothing", where, rule="CHK-11")
    return pose


def residuals(values: Ints, refined: Refined) -> Ints:
    """Values [N, C] of nodes less their prediction from others.

    That is the vertex before, or the mean, rounded down, of the ends that a midpoint lies between.
    """
    own = refined.parents[:, 0] == refined.parents[:, 1]
    before = np.concatenate([values[:1] * 0, values[:-1]])
    mean = (values[refined.parents[:, 0]] + values[refined.parents[:, 1]]) >> 1
    return values - np.where(own[:, None], before, mean)


def restored(residuals: Ints, refined: Refined) -> Ints:
    """Inverse of `residuals`."""
    count = int((refined.parents[:, 0] == refined.parents[:, 1]).sum())
    out = residuals.copy()
    out[:count] = np.cumsum(residuals[:count], axis=0)
    done = count
    while done < len(out):
        # Midpoints are numbered by level: those whose ends are known come next.
        ready = (refined.parents[done:] < done).all(1)
        stop = len(out) if ready.all() else done + int(np.argmin(ready))
        ends = refined.parents[done:stop]
        out[done:stop] += (out[ends[:, 0]] + out[ends[:, 1]]) >> 1
        done = stop
    return out
