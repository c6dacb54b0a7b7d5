"""Free deformation of a triangle mesh by dragging a few points of it.

As rigid as possible (Sorkine & Alexa 2007, "As-rigid-as-possible surface modeling"), with one
rotation a triangle (Liu et al. 2008, "A local/global approach to mesh parameterization"). The plane
is that of the complex numbers: a point is z = x + iy, a rotation is a unit number r. Over the three
edges d of every rest triangle, with weights w, the energy

    E(z, r) = sum w |d' - r d|^2,    C z = targets

is lowered in turn over r (closed form: the direction of sum w conj(d) d') and over z (one linear
system, factored once). Row h of C holds the barycentric weights of handle h. The main constants
are measured in docs/decisions/005-deformation.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from .solver import BlockTridiagonal

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]

COTANGENT = (0.05, 10.0)
"""Range that edge weights are clamped to, so that obtuse and sliver triangles do no harm."""

STEPS = 150
"""Most steps of the alternation."""

STRIDE, MOMENTUM = 1.5, 0.6
"""Factors of a step (heavy ball method); they save about two thirds of the steps."""

STILL = 1e-5
"""Movement in a step, in extents of the mesh, below which the alternation has converged."""

ROUNDS, ROUND_STEPS = 32, 10
"""Most rounds of stiffening, and steps in each."""

OPPOSITE = np.array([[0, 2, 1], [2, 0, 0], [1, 0, 0]])
"""Corner that lies opposite to the edge between two other corners."""

FOLDING, SQUEEZED = 0.02, 0.25
"""Least stretch of a mesh below which stiffening starts; that of triangles which are stiffened."""


def drag(
    nodes: Real,
    triangles: NDArray[np.int32],
    points: Real,
    targets: Real,
    rest: Real | None = None,
) -> Real:
    """Moves a mesh so that some of its points arrive at their targets and the rest follows.

    Each connected component is treated by itself. A single handle translates it. Several handles
    deform it as little as they allow; handles that do not move are pins. A component without a
    handle keeps its shape and follows its surroundings: it takes the rigid motion that fits the
    moved nodes of the other components best, near ones with more weight. A handle outside the mesh
    holds the nearest point of the mesh at an unchanged offset. Contradictory targets are met in the
    sense of least squares.

    Triangles that would fold are made stiffer in rounds, until none folds or no way is found.

    Args:
        nodes: float64 [N, 2] present positions of the nodes in pixels.
        triangles: int32 [T, 3] nodes of each triangle, in any orientation; they may be degenerate.
        points: float64 [H, 2] points of the present mesh that the handles hold, in pixels.
        targets: float64 [H, 2] positions that the handles move to, in pixels.
        rest: float64 [N, 2] positions in pixels whose local shape is kept; `nodes` by default.

    Returns:
        float64 [N, 2] new positions of the nodes in pixels.

    Raises:
        UsageError: Shapes do not fit, a number is not finite, a triangle names a node that does not
            exist, or there are handles but no triangles to hold.
        LimitError: More than `WIDEST` nodes are equally far (in edges) from one end of the mesh, as
            in a fan of that many triangles; in an ordinary mesh of N nodes it is about sqrt(N).
    """
    rest = nodes if rest is None else rest
    mesh = _checked(nodes, triangles, points, targets, rest)
    if not len(points):
        return np.array(nodes, np.float64)
    return _columns(_dragged(mesh, *map(_complex, (nodes, rest, points, targets))))


def distances(nodes: Real, triangles: NDArray[np.int32], points: Real) -> Real:
    """Distances of points from a mesh, float64 [H] in pixels; 0 inside.

    Args:
        nodes: float64 [N, 2] positions of the nodes in pixels.
        triangles: int32 [T, 3] nodes of each triangle, at least one.
        points: float64 [H, 2] points in pixels.
    """
    mesh, z, at = triangles.astype(np.int64), _complex(nodes), _complex(points)
    holders, weights = _attach(z, mesh, at)
    return np.asarray(np.abs(at - (weights * z[mesh[holders]]).sum(1)))


def _dragged(mesh: Index, z: Complex, rest: Complex, points: Complex, targets: Complex) -> Complex:
    """Does the work of `drag` on complex numbers, one component after the other."""
    holders, weights = _attach(z, mesh, points)
    held = (weights * z[mesh[holders]]).sum(1)
    t = targets - (points - held)
    component = _components(len(z), mesh)
    grabbed = component[mesh[holders, 0]]  # by each handle
    moved = z.copy()
    for c in np.unique(grabbed):
        mine = grabbed == c
        if mine.sum() == 1:
            moved[component == c] += (t - held)[mine]
            continue
        inside = np.flatnonzero(component == c)
        body = _body_of(inside, rest, mesh, holders[mine], weights[mine])
        start = _rigid(held[mine], t[mine], z[inside])
        moved[inside] = _settle(body, start, t[mine])
    _follow(z, moved, component, grabbed)
    return moved


def _body_of(inside: Index, rest: Complex, mesh: Index, holders: Index, weights: Real) -> _Body:
    """Component of the nodes `inside`, which ascend, and the handles that hold it."""
    which = np.isin(mesh[:, 0], inside)
    local = np.searchsorted(inside, mesh[which])
    return _Body(rest[inside], local, np.cumsum(which)[holders] - 1, weights)


def _checked(
    nodes: Real, triangles: NDArray[np.int32], points: Real, targets: Real, rest: Real
) -> Index:
    """Checks the arguments of `drag`; returns the triangles as int64 [T, 3].

    Raises:
        UsageError: See `drag`.
    """
    arrays = {"nodes": nodes, "points": points, "targets": targets, "rest": rest}
    for name, values in arrays.items():
        if values.ndim != 2 or values.shape[1] != 2:
            raise UsageError(f"{name}: shape {values.shape}, expected two columns, x and y")
        if not np.isfinite(values).all():
            raise UsageError(f"{name}: not all numbers are finite; pass positions in px")
    if len(points) != len(targets):
        raise UsageError(f"{len(points)} points but {len(targets)} targets; pass one for each")
    if len(nodes) != len(rest):
        raise UsageError(f"{len(nodes)} nodes but {len(rest)} in rest; pass the same mesh")
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise UsageError(f"triangles: shape {triangles.shape}, expected three columns")
    if len(points) and not len(triangles):
        raise UsageError("the mesh has no triangles, so there is nothing to hold")
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(nodes):
        raise UsageError(f"triangles: an index is outside 0 .. {len(nodes) - 1}")
    return triangles.astype(np.int64)


def _attach(z: Complex, triangles: Index, points: Complex) -> tuple[Index, Real]:
    """Triangle nearest to each point, int64 [H], and barycentric weights in it, float64 [H, 3]."""
    corner = z[triangles]
    edge = np.roll(corner, -2, 1) - np.roll(corner, -1, 1)  # opposite to each corner
    double_area = _cross(edge[:, 0], edge[:, 1])
    solid = np.abs(double_area) > 1e-9 * (np.abs(edge) ** 2).max(1)
    double_area = np.where(solid, double_area, 1.0)[:, None]
    length = np.maximum(np.abs(edge) ** 2, 1e-300)
    holders, weights = np.empty(len(points), np.int64), np.empty((len(points), 3))
    for h, point in enumerate(points):
        from_start = point - np.roll(corner, -1, 1)
        bary = _cross(edge, from_start) / double_area
        within = solid & (bary.min(1) >= 0)
        if within.any():
            holders[h] = k = int(within.argmax())
            weights[h] = bary[k]
            continue
        along = np.clip((np.conj(edge) * from_start).real / length, 0, 1)
        gap = np.abs(from_start - along * edge)
        k, side = divmod(int(gap.argmin()), 3)
        holders[h] = k
        weights[h, [side, (side + 1) % 3, (side + 2) % 3]] = 0, 1 - along[k, side], along[k, side]
    return holders, weights


def _complex(points: Real) -> Complex:
    """Converts points [N, 2] to complex numbers x + iy [N]."""
    return np.asarray(points @ np.array([1, 1j]))


def _columns(z: Complex) -> Real:
    """Converts complex numbers x + iy [N] to points [N, 2]."""
    return np.stack([z.real, z.imag], 1)


def _cross(u: Complex, v: Complex) -> Real:
    """Cross product of two plane vectors, as its z component."""
    return (np.conj(u) * v).imag


def _components(count: int, triangles: Index) -> Index:
    """Component of each node, [N], as the lowest node that triangles connect it to."""
    label = np.arange(count)
    while True:
        low = label.copy()
        np.minimum.at(low, triangles, label[triangles].min(1)[:, None])
        low = low[low]
        if (low == label).all():
            return label
        label = low


def _rigid(before: Complex, after: Complex, z: Complex, weights: Real | None = None) -> Complex:
    """Applies to `z` the rigid motion that maps `before` to `after` best (least squares)."""
    centre, goal = (np.average(v, weights=weights) for v in (before, after))
    turn = np.average(np.conj(before - centre) * (after - goal), weights=weights)
    size = np.average(np.abs(before - centre) ** 2, weights=weights)
    return goal + (turn / abs(turn) if abs(turn) > 1e-9 * size else 1) * (z - centre)


def _follow(z: Complex, moved: Complex, component: Index, grabbed: Index) -> None:
    """Moves the components without a handle, in place (moving least squares, Schaefer 2006)."""
    leads = np.isin(component, grabbed)
    for c in np.setdiff1d(component, grabbed):
        own = component == c
        distance = np.abs(z[leads] - z[own].mean())
        weights = 1 / (distance**2 + 1) ** 2
        moved[own] = _rigid(z[leads], moved[leads], z[own], weights)


class _Body:
    """Connected component with its handles and the linear system of the global step."""

    def __init__(self, rest: Complex, triangles: Index, holders: Index, weights: Real) -> None:
        self.triangles, self.count = triangles, len(rest)
        self.start, self.end = np.roll(triangles, -1, 1), np.roll(triangles, -2, 1)
        self.edge = rest[self.end] - rest[self.start]  # opposite to each corner [T, 3]
        self.extent = float(np.abs(rest - rest.mean()).max())
        corner = -np.conj(np.roll(self.edge, -1, 1)) * np.roll(self.edge, -2, 1)
        self.double_area = _cross(self.edge[:, 0], self.edge[:, 1])
        self.solid = np.abs(self.double_area) > 1e-6 * (np.abs(self.edge) ** 2).max(1)
        cotangents = corner.real / np.maximum(np.abs(corner.imag), 1e-300)
        self.cotangent = np.clip(cotangents, *COTANGENT)
        self.rows = np.zeros((len(holders), self.count))
        np.add.at(self.rows, (np.arange(len(holders))[:, None], triangles[holders]), weights)
        # The handles' own terms make the matrix definite; they vanish where handles are met.
        self.handles = weights[:, :, None] * weights[:, None, :]
        self.matrix = BlockTridiagonal(self.count, triangles, triangles[holders])
        self.stiffen(np.ones(len(triangles)))

    def stiffen(self, factor: Real) -> None:
        """Multiplies the energy of each triangle by `factor` [T], and factors the system."""
        self.weight = w = self.cotangent * factor[:, None]
        laplacian = -w[:, OPPOSITE] * (1 - np.eye(3))
        laplacian -= laplacian.sum(2, keepdims=True) * np.eye(3)
        self.matrix.factor(np.concatenate([laplacian, self.handles]))
        self.pull = self.matrix.solve(np.ascontiguousarray(self.rows.T))
        # Two handles at one place make this singular: the pseudo-inverse shares between them.
        self.force = np.linalg.pinv(self.rows @ self.pull, rcond=1e-10, hermitian=True)

    def turns(self, z: Complex) -> Complex:
        """Rotation of each triangle, [T, 1], that maps its rest edges best to those of `z`."""
        turn = (self.weight * np.conj(self.edge) * (z[self.end] - z[self.start])).sum(1)
        turn[turn == 0] = 1
        return np.asarray((turn / np.abs(turn))[:, None])

    def load(self, edges: Complex) -> Real:
        """Right-hand side, float64 [N, 2], of the linear system of the global step.

        Its solution minimizes the weighted sum of squares of d' - `edges`.

        Args:
            edges: complex128 [T, 3] wanted edges d' of each triangle.
        """
        flow = (self.weight * edges).ravel()
        a, b, n = self.start.ravel(), self.end.ravel(), self.count
        sums = [np.bincount(b, f, n) - np.bincount(a, f, n) for f in (flow.real, flow.imag)]
        return np.stack(sums, 1)

    def step(self, z: Complex, targets: Complex) -> Complex:
        """Positions [N] of least energy for the rotations that fit `z` best; handles are met."""
        goal = _columns(targets)
        x = self.matrix.solve(self.load(self.turns(z) * self.edge) + self.rows.T @ goal)
        x += self.pull @ (self.force @ (goal - self.rows @ x))
        return _complex(x)

    def least_stretch(self, z: Complex) -> Real:
        """Smaller singular value of each triangle's map from rest, [T]; negative if it is folded.

        For the map d' = a d + b conj(d) it is |a| - |b|. Degenerate triangles have 1.
        """
        d0, d1 = self.edge[:, 0], self.edge[:, 1]
        e = z[self.end[:, :2]] - z[self.start[:, :2]]
        scale = 2 * np.where(self.solid, self.double_area, 1)
        a = np.abs(e[:, 1] * np.conj(d0) - e[:, 0] * np.conj(d1))
        b = np.abs(e[:, 1] * d0 - e[:, 0] * d1)
        return np.where(self.solid, (a - b) / np.abs(scale), 1.0)


def _settle(body: _Body, z: Complex, targets: Complex) -> Complex:
    """Minimizes the energy from `z`; then stiffens folded triangles while that unfolds some.

    Returns:
        The state with the fewest folded triangles.
    """
    z = best = _alternate(body, z, targets, STEPS)
    squeeze = body.least_stretch(z)
    fewest, factor = np.count_nonzero(squeeze <= 0), np.ones(len(body.triangles))
    for _ in range(ROUNDS):
        if squeeze.min() > FOLDING:
            break
        factor = np.where(squeeze < SQUEEZED, 2 * factor, factor)
        body.stiffen(factor)
        z = _alternate(body, z, targets, ROUND_STEPS)
        squeeze = body.least_stretch(z)
        folds = np.count_nonzero(squeeze <= 0)
        if folds <= fewest:
            best, fewest = z, folds
    return best


def _alternate(body: _Body, z: Complex, targets: Complex, steps: int) -> Complex:
    """Alternates local and global steps until nothing moves; all but the last have momentum."""
    before = z = body.step(z, targets)
    for _ in range(steps):
        ahead = z + STRIDE * (body.step(z, targets) - z) + MOMENTUM * (z - before)
        before, z = z, ahead
        if np.abs(z - before).max() <= STILL * body.extent:
            break
    return body.step(z, targets)
