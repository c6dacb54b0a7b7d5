"""Dragging a mesh: as rigid as possible against bounded biharmonic weights.

    OMP_NUM_THREADS=1 python -m benchmarks.deform [DATA] [--nodes N] [--amount A]

Meshes are jittered lattices inside four silhouettes, and inside the alpha of three cliparts if DATA
is given. All methods get the same handles. A line has the means, over meshes, of the distorted
area, of the largest and smallest stretch (singular values of the maps of triangles), of the number
of folded triangles, and of CPU time; and the largest distance of a handle from its target.

Points are complex numbers x + iy in pixels.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import header
from proxyimg_codec.edit import deform
from proxyimg_codec.edit.deform import Complex, Index, Real
from proxyimg_codec.edit.deform import _Body as Body
from proxyimg_codec.io import raster

Inside = Callable[[Complex], NDArray[np.bool_]]
Method = Callable[[Complex, Index, Complex, Complex], Complex]

AXES = np.array([1, 1j])

SILHOUETTES: dict[str, tuple[complex, Inside]] = {
    "bar": (300 + 100j, lambda z: (abs(z.real - 150) < 140) & (abs(z.imag - 50) < 40)),
    "ring": (240 + 240j, lambda z: abs(abs(z - 120 - 120j) - 85) < 25),
    "star": (
        240 + 240j,
        lambda z: abs(z - 120 - 120j) < 70 + 40 * np.cos(5 * np.angle(z - 120 - 120j)),
    ),
    "leg": (
        180 + 270j,
        lambda z: (abs(z - 90 - 80j) < 70) | ((abs(z.real - 100) < 18) & (abs(z.imag - 170) < 90)),
    ),
}


def lattice(size: complex, inside: Inside, pitch: float) -> tuple[Complex, Index]:
    """Makes a mesh of the triangles of a jittered lattice whose centres are inside a shape.

    Args:
        size: Width and height of the lattice.
        inside: Whether points are inside the shape.
        pitch: Distance of nodes in pixels.

    Returns:
        complex128 [N] nodes and int64 [T, 3] triangles of the largest connected part.
    """
    rise = pitch * np.sqrt(0.75)
    across, down = int(size.real / pitch) + 2, int(size.imag / rise) + 2
    y, x = np.mgrid[:down, :across]
    z = ((x + y % 2 / 2) * pitch + 1j * y * rise).ravel()
    z += np.random.default_rng(0).uniform(-0.2, 0.2, (z.size, 2)) * pitch @ AXES
    a = (y * across + x)[:-1, :-1].ravel()
    b, c, d = a + 1, a + across, a + across + 1
    odd = (y % 2)[:-1, :-1].ravel() == 1
    upper = np.stack([a, np.where(odd, d, b), c], 1)
    lower = np.stack([np.where(odd, a, b), np.where(odd, b, d), np.where(odd, d, c)], 1)
    triangles = np.concatenate([upper, lower])
    triangles = triangles[inside(z[triangles].mean(1))]
    used, index = np.unique(triangles, return_inverse=True)
    z, triangles = z[used], index.reshape(-1, 3)
    label = deform._components(len(z), triangles)
    largest = label == np.bincount(label).argmax()
    return z[largest], (np.cumsum(largest) - 1)[triangles[largest[triangles[:, 0]]]]


def meshes(count: int, data: Path | None) -> Iterator[tuple[Complex, Index]]:
    """Yields a mesh of about `count` nodes for each shape."""
    shapes = list(SILHOUETTES.values())
    for path in sorted((data / "clipart").glob("*.png"))[:3] if data else []:
        alpha = raster.read(path).pixels[..., 3] > 127
        shapes.append((complex(*alpha.shape[::-1]), _within(alpha)))
    for size, inside in shapes:
        pitch = abs(size) / 20
        for _ in range(4):
            pitch *= np.sqrt(len(lattice(size, inside, pitch)[0]) / count)
        yield lattice(size, inside, pitch)


def _within(alpha: NDArray[np.bool_]) -> Inside:
    height, width = alpha.shape
    return lambda z: alpha[
        np.clip(z.imag, 0, height - 1).astype(int), np.clip(z.real, 0, width - 1).astype(int)
    ]


def drags(z: Complex, triangles: Index, amount: float) -> Iterator[tuple[str, Complex, Complex]]:
    """Yields tests: name, handle points [H] and their targets [H].

    Tests that are not random have handles at both ends of the long axis, some with a pin between.

    Args:
        z: complex128 [N] nodes.
        triangles: int64 [T, 3] triangles.
        amount: Standard deviation of random moves, relative to the length of the shape.
    """
    centres = z[triangles].mean(1)
    offset = centres - centres.mean()
    axis = np.exp(0.5j * np.angle((offset**2).sum()))
    low, high = (centres[f((offset / axis).real)] for f in (np.argmin, np.argmax))
    middle = centres[np.abs(centres - (low + high) / 2).argmin()]
    span = high - low
    p = np.array([low, middle, high])
    yield "mild", p, p + span * np.array([0, 0, 0.1j])
    yield "bend 90", p, np.array([low, middle, middle + 1j * (high - middle)])
    yield "stretch 1.5", p[[0, 2]], np.array([low, low + 1.5 * span])
    ends = list(p[[0, 2]])
    for _ in range(3):
        ends.append(centres[np.abs(centres[:, None] - ends).min(1).argmax()])
    p = np.array(ends)
    yield "push in", p, p + 0.6 * (centres.mean() - p) * (np.arange(5) == 2)
    rng = np.random.default_rng(1)
    for _ in range(4):
        chosen = [rng.choice(centres)]
        while len(chosen) < 4:
            c = rng.choice(centres)
            if np.abs(c - chosen).min() > 0.1 * abs(span):
                chosen.append(c)
        p = np.array(chosen)
        yield "random", p, p + rng.normal(scale=amount * abs(span), size=(4, 2)) @ AXES


class ByVertex(Body):
    """Body with one rotation for each node and the edges around it (Sorkine & Alexa 2007)."""

    def turns(self, z: Complex) -> Complex:
        """Mean of the rotations of the two nodes of each edge, complex128 [T, 3]."""
        pull = (self.weight * np.conj(self.edge) * (z[self.end] - z[self.start])).ravel()
        node = np.zeros(self.count, complex)
        np.add.at(node, self.start.ravel(), pull)
        np.add.at(node, self.end.ravel(), pull)
        node /= np.maximum(np.abs(node), 1e-300)
        return np.asarray((node[self.start] + node[self.end]) / 2)


class Uniform(Body):
    """Body with the same weight for all edges."""

    def stiffen(self, factor: Real) -> None:
        """Sets equal cotangents, then stiffens as `Body` does."""
        self.cotangent = np.full_like(self.cotangent, np.sqrt(1 / 3))
        super().stiffen(factor)


def rigid(kind: type[Body], substeps: int = 1, stiffen: bool = False) -> Method:
    """Makes an as-rigid-as-possible method.

    Args:
        kind: Class of the body.
        substeps: Number of steps in which handles approach their targets.
        stiffen: Whether to stiffen triangles that nearly fold, as the package does, instead.
    """

    def run(z: Complex, triangles: Index, points: Complex, targets: Complex) -> Complex:
        body = kind(z, triangles, *deform._attach(z, triangles, points))
        at, now = (deform._rigid(points, targets, v) for v in (points, z))
        if stiffen:
            return deform._settle(body, now, targets)
        for k in range(1, substeps + 1):
            now = deform._alternate(body, now, at + k / substeps * (targets - at), deform.STEPS)
        return now

    return run


def weights(body: Body, z: Complex) -> Real:
    """Bounded biharmonic weights of each handle (Jacobson et al. 2011), float64 [N, H].

    ADMM solves the quadratic program: minimal w' L M^-1 L w with 0 <= w <= 1 and C w = identity.
    """
    n, handles = body.count, len(body.rows)
    laplacian = np.zeros((n, n))
    for a, b, w in zip(body.start.ravel(), body.end.ravel(), body.weight.ravel(), strict=True):
        laplacian[[a, b, a, b], [a, b, b, a]] += w, w, -w, -w
    mass = np.bincount(body.triangles.ravel(), np.repeat(np.abs(body.double_area), 3), n)
    bilaplacian = laplacian / mass @ laplacian
    penalty = 1e-4 * np.trace(bilaplacian) / n
    inverse = np.linalg.inv(bilaplacian + penalty * np.eye(n))
    pull = inverse @ body.rows.T
    force = np.linalg.pinv(body.rows @ pull)
    bounded, multiplier = np.full((n, handles), 1 / handles), np.zeros((n, handles))
    for _ in range(200):
        free = penalty * inverse @ (bounded - multiplier)
        free += pull @ (force @ (np.eye(handles) - body.rows @ free))
        bounded = np.clip(free + multiplier, 0, 1)
        multiplier = multiplier + free - bounded
    return np.asarray(bounded / bounded.sum(1, keepdims=True))


def biharmonic(
    z: Complex, triangles: Index, points: Complex, targets: Complex, turning: bool = False
) -> Complex:
    """Deforms a mesh by bounded biharmonic weights.

    They blend the displacements of handles, in addition to the best rigid motion of all of them.

    Args:
        z: complex128 [N] nodes.
        triangles: int64 [T, 3] triangles.
        points: complex128 [H] handle points.
        targets: complex128 [H] their targets.
        turning: Whether each handle also turns and scales, so that the mesh is as rigid as possible
            (Jacobson et al. 2012, "Fast automatic skinning transformations").

    Returns:
        complex128 [N] moved nodes.
    """
    body = Body(z, triangles, *deform._attach(z, triangles, points))
    blend = weights(body, z)
    at, start = (deform._rigid(points, targets, v) for v in (points, z))
    now = start + blend @ (targets - at)
    if not turning:
        return now
    arms = blend * (z[:, None] - points)  # what a adds in the motion a (z - point) + target
    fixed = blend @ targets

    def spread(v: Complex) -> Complex:
        return deform._complex(body.load(v[body.end] - v[body.start]))

    forces = np.stack([spread(arms[:, k]) for k in range(len(points))], 1)
    solve = np.linalg.pinv(np.conj(arms.T) @ forces) @ np.conj(arms.T)
    for _ in range(deform.STEPS):
        wanted = deform._complex(body.load(body.turns(now) * body.edge))
        now = fixed + arms @ (solve @ (wanted - spread(fixed)))
    return np.asarray(now)


def shipped(z: Complex, triangles: Index, points: Complex, targets: Complex) -> Complex:
    """Deforms a mesh by the function of the package."""
    nodes, p, t = map(deform._columns, (z, points, targets))
    return deform._complex(deform.drag(nodes, triangles.astype(np.int32), p, t))


METHODS: dict[str, Method] = {
    "BBW": biharmonic,
    "BBW, turning": partial(biharmonic, turning=True),
    "ARAP, vertices": rigid(ByVertex),
    "same, stiffened": rigid(ByVertex, stiffen=True),
    "ARAP, uniform": rigid(Uniform),
    "ARAP, triangles": rigid(Body),
    "same, 8 sub-steps": rigid(Body, 8),
    "shipped": shipped,
}


def judge(
    z: Complex, triangles: Index, points: Complex, targets: Complex, method: Method
) -> list[float]:
    """Measures a method on one test.

    Returns:
        Distorted area in percent, largest and smallest stretch, number of folded triangles, largest
        distance of a handle from its target in pixels, and CPU milliseconds.
    """
    begin = time.process_time()
    moved = method(z, triangles, points, targets)
    spent = 1e3 * (time.process_time() - begin)

    def edges(v: Complex) -> Real:
        e = v[triangles[:, 1:]] - v[triangles[:, :1]]
        return np.stack([e.real, e.imag], 1)

    jacobian = edges(moved) @ np.linalg.inv(edges(z))
    stretch = np.linalg.svd(jacobian, compute_uv=False)
    growth = np.linalg.det(jacobian)
    area = np.abs(np.linalg.det(edges(z)))
    holders, weight = deform._attach(z, triangles, points)
    error = np.abs((weight * moved[triangles[holders]]).sum(1) - targets).max()
    changed = 100 * (area * np.abs(growth - 1)).sum() / area.sum()
    folds = np.count_nonzero(growth <= 0)
    return [changed, stretch.max(), stretch.min(), folds, float(error), spent]


def main() -> None:
    """Runs the command line."""
    p = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    p.add_argument("data", type=Path, nargs="?", help="folder with clipart, for three more shapes")
    p.add_argument("--nodes", type=int, default=600)
    p.add_argument("--amount", type=float, default=0.1, help="random moves, in parts of the shape")
    args = p.parse_args()
    threads = os.environ.get("OMP_NUM_THREADS", "not set")
    print(header(args.data or Path("none")), f"OMP_NUM_THREADS {threads}", sep="; ")
    cases = [
        (name, z, triangles, points, targets)
        for z, triangles in meshes(args.nodes, args.data)
        for name, points, targets in drags(z, triangles, args.amount)
    ]
    sizes = {len(z) for _, z, _, _, _ in cases}
    print(f"nodes: {min(sizes)} to {max(sizes)}; cases: {len(cases)}")
    print(f"{'':31s}area %  stretch, least  folds  handle px  CPU ms")
    for kind in dict.fromkeys(name for name, *_ in cases):
        for method, run in METHODS.items():
            if args.nodes > 2000 and method.startswith("BBW"):
                continue  # their dense matrices take too long
            rows = [judge(*case[1:], run) for case in cases if case[0] == kind]
            area, large, small, folds, _, spent = np.mean(rows, 0)
            error = max(row[4] for row in rows)
            print(
                f"{kind:12s}{method:19s}{area:6.1f}  {large:7.2f} {small:6.2f} {folds:6.2f}"
                f"  {error:9.1e} {spent:7.0f}"
            )


if __name__ == "__main__":
    main()
