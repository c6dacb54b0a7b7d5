"""Meshers TriWild and fTetWild, each in a process of its own that may fail.

They crash on some input, may never end, and their results differ from run to run. So they are given
polygons that are known to be simple, and the meshes that they return are snapped to the lattice and
checked.

Y. Hu et al., "TriWild: robust triangulation with curve constraints", 2019;
Y. Hu et al., "Fast tetrahedral meshing in the wild", 2020.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, UnsupportedError
from ...geometry import mesher
from ...geometry.boundary import Boundary
from ...geometry.mesh import Base
from ...geometry.outline import CELLS, Outline, outline
from ...geometry.polygons import apart, winding

SECONDS = 120.0
"""Seconds after which a mesher is stopped."""

BOX = 14
"""Least side of the square that the input of TriWild extends over, in target edge lengths."""

SLAB = 0.25
"""Thickness of the slab that fTetWild fills, in target edge lengths."""

TOLERANCE = 1.0
"""Largest displacement of outlines by a mesher, in canvas pixels; a thousandth of the extent of
the input if that is less."""

MISSING = 3
"""Exit status of the process if its mesher is not installed."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def triwild(boundary: Boundary | None, size: tuple[int, int], edge: float) -> Base:
    """Meshes the shape of a layer with TriWild.

    TriWild starts from a grid with cells of a tenth of the box around its input, and stops as soon
    as all triangles are well shaped. So the edge length has no effect on plain shapes. Two tiny
    triangles far outside make the grid coarse, and the optimization necessary. TriWild sometimes
    misjudges what is inside small shapes, so this function decides it by winding numbers.

    Args:
        boundary: Boundary that encloses the shape; None for the whole canvas.
        size: Width and height of the canvas in pixels; only used if `boundary` is None.
        edge: Target edge length relative to the diagonal of the shape, as for
            `geometry.mesher.delaunay`, 0.01..1.

    Raises:
        UsageError: `edge` is out of range.
        UnsupportedError: `wildmeshing` is not installed.
        InputError: TriWild fails on this shape, or takes longer than `SECONDS`.
    """
    shape = outline(boundary, size, edge)
    places = [loop * shape.scale for loop in shape.loops]
    corners = np.concatenate(places)
    low, high = corners.min(0), corners.max(0)
    away = np.maximum((high - low) / 2 + 2 * shape.length, BOX / 2 * shape.length)
    tiny = np.array([[0, 0], [1, 0], [0, 1]]) * shape.length / 10
    places += [(low + high) / 2 + away + tiny, (low + high) / 2 - away - tiny]
    ends = np.cumsum([len(p) for p in places])
    after = np.arange(ends[-1]) + 1
    after[ends - 1] = ends - [len(p) for p in places]
    edges = np.stack([np.arange(ends[-1]), after], axis=1)
    points = np.concatenate(places)
    vertices, triangles = _run("triwild", points, edges, shape)
    inside = winding(vertices[triangles].mean(1) / shape.scale, shape.loops) > 0
    return _snapped("triwild", vertices, triangles[inside], shape)


def ftetwild(boundary: Boundary | None, size: tuple[int, int], edge: float) -> Base:
    """Meshes the shape of a layer with fTetWild.

    fTetWild fills a thin slab of the shape with tetrahedra; one side of the slab is the mesh.

    Args:
        boundary: Boundary that encloses the shape; None for the whole canvas.
        size: Width and height of the canvas in pixels; only used if `boundary` is None.
        edge: Target edge length relative to the diagonal of the shape, as for
            `geometry.mesher.delaunay`, 0.01..1.

    Raises:
        UsageError: `edge` is out of range.
        UnsupportedError: `pytetwild` is not installed.
        InputError: fTetWild fails on this shape, or takes longer than `SECONDS`.
    """
    shape = outline(boundary, size, edge)
    flat = mesher.fill(shape, np.zeros((0, 2), np.int64))
    count, height = len(flat.vertices), SLAB * shape.length
    side = [
        part
        for loop in mesher.rim(flat.triangles) or []
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True)
        for part in ((a, b, b + count), (a, b + count, a + count))
    ]
    place = flat.vertices * shape.scale
    points = np.concatenate([np.insert(place, 2, z, axis=1) for z in (0, height)])
    faces = np.concatenate([flat.triangles[:, ::-1], flat.triangles + count, np.array(side)])
    vertices, cells = _run("ftetwild", points, faces, shape)
    surface = np.concatenate([cells[:, k] for k in ([1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1])])
    _, first, times = np.unique(
        np.sort(surface, axis=1), axis=0, return_index=True, return_counts=True
    )
    surface = surface[first[times == 1]]
    top = (vertices[surface][..., 2] > height / 2).all(1)
    return _snapped("ftetwild", vertices[:, :2], surface[top], shape)


def worker() -> list[str]:
    """Command that runs `main` in another process, but for the name of the mesher at its end."""
    return [sys.executable, "-m", __name__]


def _run(name: str, points: Floats, parts: Ints, shape: Outline) -> tuple[Floats, Ints]:
    """Runs a mesher in another process.

    Args:
        name: ``triwild`` or ``ftetwild``.
        points: float64 [N, 2] or [N, 3] points, in canvas pixels.
        parts: int64 [M, 2] edges, or [M, 3] faces of a closed surface.
        shape: Outline that the points are made from.

    Returns:
        float64 [V, 2] points and int64 [T, 3] triangles, or [V, 3] points and [T, 4] tetrahedra.
    """
    paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    with tempfile.TemporaryDirectory() as folder:
        np.savez(
            Path(folder, "in.npz"),
            points=points,
            parts=parts.astype(np.int32),
            length=shape.length,
            tolerance=min(TOLERANCE / math.hypot(*np.ptp(points, axis=0)), 1e-3),
        )
        try:
            ran = subprocess.run(
                [*worker(), name],
                cwd=folder,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                timeout=SECONDS,
            )
        except subprocess.TimeoutExpired:
            raise _failure(name, f"took longer than {SECONDS:g} seconds") from None
        said = " ".join(ran.stderr.decode(errors="replace").splitlines()[-1:])[:200]
        if ran.returncode == MISSING:
            raise UnsupportedError(
                f"mesher {name} cannot be started ({said}); "
                "install it with pip install 'proxyimg-codec[meshers]', or use --mesh delaunay"
            )
        if ran.returncode:
            raise _failure(name, f"broke off with status {ran.returncode} ({said})")
        try:
            with np.load(Path(folder, "out.npz")) as data:
                places, elements = data["points"], data["parts"]
        except (OSError, ValueError, LookupError, EOFError, BadZipFile):
            raise _failure(name, "returned nothing that can be read") from None
    corners = 3 if points.shape[1] == 2 else 4
    if (
        places.dtype.kind != "f"
        or places.shape[1:] != points.shape[1:]
        or not np.isfinite(places).all()
        or elements.dtype.kind not in "iu"
        or elements.shape[1:] != (corners,)
        or not elements.size
        or elements.min() < 0
        or elements.max() >= len(places)
    ):
        raise _failure(name, "returned no mesh")
    return places, elements.astype(np.int64)


def _failure(name: str, what: str) -> InputError:
    return InputError(f"mesher {name} {what} on the shape of a layer; use --mesh delaunay")


def _snapped(name: str, places: Floats, triangles: Ints, shape: Outline) -> Base:
    """Snaps the nodes of a mesh to the lattice of a shape.

    If the snapped mesh is folded or does not cover the shape, its nodes are triangulated anew.

    Args:
        name: Name of the mesher.
        places: float64 [N, 2] nodes in canvas pixels, from the corner of the lattice.
        triangles: int64 [T, 3] triangles of any orientation.
        shape: Outline that was meshed.
    """
    if not len(triangles):
        raise _failure(name, "returned no triangles")
    (ux, uy), (vx, vy) = (places[triangles[:, k]].T - places[triangles[:, 0]].T for k in (1, 2))
    triangles = np.where((ux * vy < uy * vx)[:, None], triangles[:, ::-1], triangles)
    points = np.clip(np.rint(places / shape.scale), 0, CELLS).astype(np.int64)
    points, number = np.unique(points, axis=0, return_inverse=True)
    triangles = number.ravel()[triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(1)
    mesh = mesher.base(shape, points, triangles[whole])
    if mesher.sound(mesh, shape.covered):
        return mesh
    return mesher.fill(shape, points[apart(points, shape.loops, shape.scale, shape.length / 4)])


def main(name: str) -> int:
    """Runs a mesher on ``in.npz`` in the current folder and writes ``out.npz`` there.

    Args:
        name: ``triwild`` or ``ftetwild``.

    Returns:
        Exit status: 0, or `MISSING` if the mesher is not installed.
    """
    with np.load("in.npz") as data:
        points, parts = data["points"], data["parts"]
        length, tolerance = float(data["length"]), float(data["tolerance"])
    try:
        if name == "triwild":
            from wildmeshing import triangulate_data
        else:
            from pytetwild.pytetwild import tetrahedralize
    except ImportError as error:
        print(error, file=sys.stderr)
        return MISSING
    if name == "triwild":
        places, elements = triangulate_data(
            points,
            parts,
            target_edge_len=length,
            epsilon=tolerance,
            mute_log=True,
        )[:2]
    else:
        places, elements = tetrahedralize(
            points,
            parts,
            edge_length_abs=length,
            epsilon=tolerance,
            coarsen=True,
            num_threads=1,
        )
    np.savez("out.npz", points=places, parts=elements)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
