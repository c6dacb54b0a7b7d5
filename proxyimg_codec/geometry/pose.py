"""Pose of a layer: the place, shape and colour that edits have given it.

A pose is applied to the geometry at rest: first the nodes are displaced, then an affine map is
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
"""Affine map a, b, c, d, e, f: x' = a x + c y + e, y' = b x + d y + f, in pixels (as in SVG)."""

MATRIX_BITS = 24
"""Fractional bits of the entries of the matrix."""

MATRIX_MAX = 1 << 31
"""Bound of the magnitude of matrix entries, in 2**-24: less than 128 times larger."""

SHIFT_MAX = 1 << 33
"""Bound of the magnitude of shifts, in 1/1024 canvas pixel."""

POINT_MAX = 1 << 30
"""Bound to which coordinates are clamped before they are mapped, in 1/1024 canvas pixel."""

NODE_BITS = 4
"""Fractional bits of displacements of nodes: they are in 1/16 canvas pixel."""

NODE_MAX = 1 << 24
"""Bound of the magnitude of displacements of nodes, in 1/16 canvas pixel."""

OPACITY_MAX = 65535
"""Opacity of a layer that is drawn in full."""

COLOUR_BITS = 12
"""Fractional bits of the entries of the colour matrix."""

COLOUR_MAX = 1 << 20
"""Largest magnitude of an entry of the colour matrix, in 2**-12."""

_UNIT = 1 << MATRIX_BITS


@dataclass(frozen=True, eq=False)
class Pose:
    """Result of all edits of place, shape and colour of a layer, and of its motion at a moment.

    Attributes:
        matrix: a, b, c, d of the affine map in 2**-24.
        shift: e, f of the affine map in 1/1024 canvas pixel.
        nodes: int64 [N, 2] displacement of each node in 1/16 canvas pixel, or None.
        places: int64 [N, 2] displacement of the texture point that each node shows, in 1/16 canvas
            pixel, or None.
        opacity: Opacity in 0..65535.
        hidden: Whether the layer is not drawn.
        colour: The 12 entries of a 3 x 4 matrix, row by row, in 2**-12, which maps (red, green,
            blue, 1) to colour; () for none.
        sway: int64 [N, 2] displacement of each node by the motion at a moment, in 1/1024 canvas
            pixel, in addition to `nodes`; or None.
        body: Number of the body that the layer moves with at that moment, or None; layers of one
            body move as one.
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
        """Whether the affine map is not the identity."""
        return self.matrix != (_UNIT, 0, 0, _UNIT) or self.shift != (0, 0)

    @property
    def mirrored(self) -> bool:
        """Whether the affine map has a negative determinant, so that it reverses orientation."""
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
        """Displacement of each node, int64 [N, 2] in 1/1024 canvas pixel; only if `displaced`."""
        parts = [v for v in (self.sway,) if v is not None]
        if self.nodes is not None:
            parts.append(self.nodes << (FRACTION_BITS - NODE_BITS))
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]

    @property
    def at_rest(self) -> bool:
        """Whether the pose changes nothing."""
        plain = self.opacity == OPACITY_MAX and not self.hidden and not self.colour
        return plain and not self.affine and not self.bent

    def still(self, other: Pose) -> bool:
        """Whether a layer in this pose and one in the pose `other` rest on each other [PYR-46].

        They do if both have moved and changed colour alike, neither has displacements by edits,
        and both are opaque. Whether they are drawn is left to the caller.
        """
        ours, theirs = ((p.matrix, p.shift, p.body, p.colour) for p in (self, other))
        return ours == theirs and not any(
            p.nodes is not None or p.places is not None or p.opacity != OPACITY_MAX
            for p in (self, other)
        )

    @property
    def floats(self) -> Matrix:
        """Affine map as floating-point numbers, in canvas pixels."""
        a, b, c, d = (v / _UNIT for v in self.matrix)
        e, f = (v / (1 << FRACTION_BITS) for v in self.shift)
        return a, b, c, d, e, f

    def apply(self, points: Ints) -> Ints:
        """Applies the affine map to points int64 [N, 2] in 1/1024 canvas pixel, rounded half up."""
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
        """Present positions of all nodes, int64 [N, 2] in 1/1024 canvas pixel."""
        return self.apply(refined.nodes + self.displacements if self.displaced else refined.nodes)

    def frozen(self) -> Pose:
        """Returns the pose with `sway` added to `nodes`, rounded half up to 1/16 canvas pixel."""
        if self.sway is None:
            return self
        shift = FRACTION_BITS - NODE_BITS
        nodes = (self.displacements + (1 << (shift - 1))) >> shift
        return replace(self, nodes=nodes if nodes.any() else None, sway=None, body=None)


REST = Pose()
"""Pose that changes nothing."""


def inverse(matrix: Matrix) -> Matrix:
    """Inverse of an affine map, whose determinant must not be 0."""
    a, b, c, d, e, f = matrix
    # Exact, because in floating point the determinant of a map that is not singular can become 0.
    det = float(Fraction(a) * Fraction(d) - Fraction(b) * Fraction(c))
    a, b, c, d = d / det, -b / det, -c / det, a / det
    return a, b, c, d, -(a * e + c * f), -(b * e + d * f)


def product(outer: Matrix, inner: Matrix) -> Matrix:
    """Affine map that applies `inner` first, then `outer`."""
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    return (
        a * p + c * q, b * p + d * q, a * r + c * s, b * r + d * s,
        a * t + c * u + e, b * t + d * u + f,
    )  # fmt: skip


def fixed(matrix: Matrix) -> tuple[tuple[int, int, int, int], tuple[int, int]] | None:
    """Rounds an affine map to `matrix` and `shift` of a pose.

    Returns:
        Matrix and shift; None if they are singular, out of range or not finite.
    """
    if not all(map(math.isfinite, matrix)):
        return None
    a, b, c, d = (round(v * _UNIT) for v in matrix[:4])
    e, f = (round(v * (1 << FRACTION_BITS)) for v in matrix[4:])
    if max(map(abs, (a, b, c, d))) >= MATRIX_MAX or max(abs(e), abs(f)) >= SHIFT_MAX:
        return None
    return None if a * d == b * c else ((a, b, c, d), (e, f))


def encode(pose: Pose, mesh: Mesh | None) -> dict[str, Any]:
    """Encodes a pose as the fields of POSE, without the number of the layer.

    A motion at a moment (`sway`) becomes displacements of nodes; see `Pose.frozen`.

    Args:
        pose: The pose.
        mesh: Mesh of the layer; needed if the pose has displacements.
    """
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
    """Decodes a pose.

    Args:
        fields: Values of POSE.
        mesh: Mesh of the layer, or None.
        where: Name of the chunk in error messages.

    Raises:
        FormatError: A stream or the mesh is corrupt, displacements have no mesh, the matrix is
            singular, or the pose changes nothing.
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
    """Subtracts from values of nodes their prediction from other nodes.

    A vertex is predicted by the vertex before it, the first one by 0. A midpoint is predicted by
    the mean, rounded down, of the two nodes that it lies between.

    Args:
        values: int64 [N, C] values of the nodes.
        refined: The mesh of the nodes.

    Returns:
        int64 [N, C] residuals.
    """
    own = refined.parents[:, 0] == refined.parents[:, 1]
    before = np.concatenate([values[:1] * 0, values[:-1]])
    mean = (values[refined.parents[:, 0]] + values[refined.parents[:, 1]]) >> 1
    return values - np.where(own[:, None], before, mean)


def restored(residuals: Ints, refined: Refined) -> Ints:
    """Restores the values int64 [N, C] from `residuals`."""
    count = int((refined.parents[:, 0] == refined.parents[:, 1]).sum())
    out = residuals.copy()
    out[:count] = np.cumsum(residuals[:count], axis=0)
    done = count
    while done < len(out):
        # Midpoints are numbered by level, so those with known ends come first.
        ready = (refined.parents[done:] < done).all(1)
        stop = len(out) if ready.all() else done + int(np.argmin(ready))
        ends = refined.parents[done:stop]
        out[done:stop] += (out[ends[:, 0]] + out[ends[:, 1]]) >> 1
        done = stop
    return out
