"""Meshes and the shapes they are made for."""

import numpy as np

from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Base
from proxyimg_codec.geometry.mesher import rim
from proxyimg_codec.geometry.polygons import winding


def lattice(columns, rows, keep=None, step=(412, 400)):
    """A mesh of triangles on a sheared lattice; `keep` chooses some of them."""
    points = [(12 * i + 6 * (j % 2), 10 * j) for j in range(rows) for i in range(columns)]
    triangles = []
    for j in range(rows - 1):
        for i in range(columns - 1):
            a, b = j * columns + i, j * columns + i + 1
            c, d = a + columns, b + columns
            triangles += [(a, b, c), (b, d, c)] if j % 2 == 0 else [(a, b, d), (a, d, c)]
    chosen = np.array(triangles)[slice(None) if keep is None else keep]
    used, renumbered = np.unique(chosen, return_inverse=True)
    return Base(
        (-3, 5),
        step,
        np.array(points, np.uint8)[used],
        renumbered.reshape(-1, 3).astype(np.int32),
    )


def square(x0, y0, x1, y1):
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    return Boundary(2, (np.repeat(corners * 4, 3, axis=0) + np.array([2, 1]),))


def polygon(points):
    """A path of straight segments, in quarters of a pixel."""
    return np.repeat(np.rint(points).astype(np.int64), 3, axis=0)


def box(x, y, width, height):
    return polygon([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def disc(x, y, radius, way=1):
    a = way * np.linspace(0, 2 * np.pi, 48, endpoint=False)
    return polygon(np.stack([x + radius * np.cos(a), y + radius * np.sin(a)], axis=1))


def specks(count):
    rng = np.random.default_rng(1)
    return [box(*rng.integers(0, (7900, 5100)), *rng.integers(2, 20, 2)) for _ in range(count)]


def star(points):
    a = np.linspace(0, 2 * np.pi, 2 * points, endpoint=False)
    r = np.where(np.arange(2 * points) % 2, 1900, 300)
    return polygon(np.stack([2000 + r * np.cos(a), 2000 + r * np.sin(a)], axis=1))


SHAPES = {
    "pixel": [box(40, 40, 4, 4)],
    "point": [box(40, 40, 0, 0)],
    "horizontal line": [box(0, 40, 8000, 4)],
    "vertical line": [box(40, 0, 4, 5200)],
    "slanting line": [polygon([(0, 0), (4, 0), (8000, 5200), (7996, 5200)])],
    "disc": [disc(600, 700, 512)],
    "ring": [disc(600, 700, 500), disc(600, 700, 420, -1)],
    "beyond the canvas": [disc(-2000, 6000, 600), box(900, 5500, 1500, 40)],
    "star": [star(24)],
    "specks": specks(60),
    "hourglass": [polygon([(0, 0), (900, 900), (900, 0), (0, 900)])],
    # Wound both ways, so that areas within a lattice cell cancel.
    "twisted hair": [polygon([(0, 0), (4000, 5), (8000, 0), (8000, 5), (4000, 0), (0, 5)])],
}


def check(mesh):
    """Asserts what holds for every mesh."""
    vertices, triangles = mesh.vertices.astype(int), mesh.triangles
    assert (mesh.vertices.dtype, triangles.dtype) == (np.uint8, np.int32)
    assert all(s > 0 and s % 4 == 0 for s in mesh.step)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    assert (np.unique(triangles) == np.arange(len(vertices))).all()
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    doubled = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    assert (doubled > 0).all()
    loops = rim(triangles)
    assert loops is not None
    # Nothing is covered twice: at most one triangle winds round each.
    assert set(winding((a + b + c), [3 * vertices[p] for p in loops]).tolist()) == {1}


def spare(mesh, paths):
    """The distance of covered pixel centres from the rim, all of which must lie inside."""
    places = mesh.vertices * (np.array(mesh.step) / 1024) + mesh.origin
    low, high = np.floor(places.min(0)).astype(int), np.ceil(places.max(0)).astype(int)
    scaled = [p * (cover.ONE // 4) - low * cover.ONE for p in paths]
    covered = whole = cover.coverage(scaled, 0, 0, *(high - low)) > 0
    for axis in (0, 1):  # pixels among covered ones are never the nearest to the rim
        whole = whole & np.roll(covered, 1, axis) & np.roll(covered, -1, axis)
    rows, columns = np.nonzero(covered & ~whole)
    centres = np.stack([columns, rows], axis=1) + 0.5 + low
    loops = [places[p] for p in rim(mesh.triangles)]
    assert (winding(centres, loops) == 1).all()
    best = np.inf
    for loop in loops if len(centres) else []:
        for a, b in zip(loop, np.roll(loop, -1, 0), strict=True):
            t = np.clip((centres - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
            best = min(best, np.hypot(*(centres - a - t[:, None] * (b - a)).T).min())
    return best


def lengths(mesh):
    """Lengths of edges in canvas pixels."""
    places = mesh.vertices * (np.array(mesh.step) / 1024)
    corners = places[mesh.triangles]
    return np.hypot(*np.moveaxis(corners - np.roll(corners, 1, 1), -1, 0))
