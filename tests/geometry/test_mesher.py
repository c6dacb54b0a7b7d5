import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesher import delaunay, rim, sound
from proxyimg_codec.geometry.outline import outline, triangles_max
from tests.support.meshes import SHAPES, box, check, disc, lengths, polygon, spare, specks

CANVAS = (2000, 1300)


def angles(mesh):
    """The smallest angle of each triangle in degrees."""
    length = np.sort(lengths(mesh), axis=1)
    a, b, c = length.T
    return np.degrees(np.arccos((b * b + c * c - a * a) / (2 * b * c)))


@pytest.mark.parametrize("edge", [0.05, 0.4])
@pytest.mark.parametrize("name", SHAPES)
def test_meshes_are_valid_bounded_and_reach_beyond_the_shape(name, edge):
    shape = Boundary(2, tuple(SHAPES[name]))
    mesh = delaunay(shape, CANVAS, edge)
    check(mesh)
    assert spare(mesh, shape.paths) >= 2
    assert sound(mesh, outline(shape, CANVAS, edge).covered)
    assert len(mesh.triangles) <= triangles_max(edge)


@given(st.integers(0, 2**32 - 1), st.sampled_from([10, 200, 4000]), st.sampled_from([1, 0.02]))
@settings(max_examples=25, deadline=None)
def test_any_curves_are_covered(seed, extent, aspect):
    rng = np.random.default_rng(seed)
    spread = np.array([extent, max(extent * aspect, 2)])
    paths = [
        (rng.random((3 * rng.integers(1, 6), 2)) * spread - spread / 3).astype(np.int64)
        for _ in range(rng.integers(1, 6))
    ]
    edge = float(rng.choice([0.03, 0.05, 0.2, 0.6]))
    mesh = delaunay(Boundary(2, tuple(paths)), CANVAS, edge)
    check(mesh)
    assert spare(mesh, paths) >= 2


@pytest.mark.parametrize("size", [(1, 1), (1, 500), (768, 512), (2000, 1300)])
def test_the_whole_canvas(size):
    mesh = delaunay(None, size, 0.2)
    check(mesh)
    reach = np.array(mesh.origin) + 255 * np.array(mesh.step) / 1024
    assert max(mesh.origin) <= -2
    assert (reach >= np.array(size) + 2).all()
    assert spare(mesh, [box(0, 0, 4 * size[0], 4 * size[1])]) >= 2


@pytest.mark.parametrize("shape", [None, Boundary(2, (disc(600, 700, 512),))])
def test_the_edge_length_acts(shape):
    size = (768, 512)
    diagonal = np.hypot(*size) if shape is None else 256 * np.sqrt(2)
    for edge in (0.03, 0.05, 0.1, 0.2):
        mesh = delaunay(shape, size, edge)
        assert 0.85 < np.median(lengths(mesh)) / (edge * diagonal) < 1.2, edge
        assert angles(mesh).min() > 8, edge
        assert np.mean(angles(mesh) < 20) < 0.02, edge
    for edge, least, most in ((0.05, 150, 500), (0.2, 20, 60)):
        assert least <= len(delaunay(shape, size, edge).triangles) <= most


def test_triangles_are_delaunay_on_the_canvas():
    """Not on the lattice, whose cells are five times as wide as high here."""
    a = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    wide = polygon(np.stack([4000 + 3500 * np.cos(a), 2000 + 700 * np.sin(a)], axis=1))
    mesh = delaunay(Boundary(2, (wide,)), CANVAS, 0.05)
    places = mesh.vertices * (np.array(mesh.step) / 1024)
    opposite = {}
    for a, b, c in mesh.triangles.tolist():
        for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
            u, v = places[x] - places[z], places[y] - places[z]
            opposite[x, y] = np.degrees(np.arccos(u @ v / np.hypot(*u) / np.hypot(*v)))
    sums = [angle + opposite.get((y, x), 0) for (x, y), angle in opposite.items()]
    assert max(sums) < 183  # 180, but for the rounding of the ratio of the cells


def test_meshes_of_tiny_layers_are_small():
    assert len(delaunay(Boundary(2, tuple(SHAPES["pixel"])), CANVAS, 0.05).triangles) <= 10


def test_wide_gaps_and_holes_stay_open():
    ring = delaunay(Boundary(2, tuple(SHAPES["ring"])), CANVAS, 0.05)
    assert len(rim(ring.triangles)) == 2
    for gap, parts in ((80, 2), (12, 1)):
        pair = Boundary(2, (box(0, 0, 400, 1000), box(400 + gap, 0, 400, 1000)))
        assert len(rim(delaunay(pair, CANVAS, 0.05).triangles)) == parts


def test_islands_in_holes_are_kept():
    target = [disc(600, 600, 580), disc(600, 600, 400, -1), disc(600, 600, 200)]
    mesh = delaunay(Boundary(2, tuple(target)), CANVAS, 0.05)
    check(mesh)
    assert len(rim(mesh.triangles)) == 3
    assert spare(mesh, target) >= 2


def test_a_filled_hole_takes_its_island_along():
    """The hole is small beside the edge length; its island is not a part of its own then."""
    small = [box(0, 0, 4000, 4000), box(1000, 1000, 300, 300)[::-1], box(1130, 1130, 40, 40)]
    mesh = delaunay(Boundary(2, tuple(small)), CANVAS, 1.0)
    check(mesh)
    assert len(rim(mesh.triangles)) == 1
    assert len(mesh.triangles) == 2


def test_too_many_parts_are_taken_together():
    many = Boundary(2, tuple(specks(300)))
    fine, coarse = (outline(many, CANVAS, edge) for edge in (0.05, 0.2))
    assert len(fine.loops) > 150
    assert fine.triangles > 2 * triangles_max(0.2)
    assert coarse.triangles <= triangles_max(0.2)
    assert coarse.covered.sum() < 0.02 * coarse.covered.size  # the loops grew, not the shape


def test_the_same_input_gives_the_same_mesh():
    shape = Boundary(2, tuple(SHAPES["specks"]))
    first, second = (delaunay(shape, CANVAS, 0.05) for _ in range(2))
    assert (first.vertices == second.vertices).all()
    assert (first.triangles == second.triangles).all()


@pytest.mark.parametrize("edge", [0.0, -1.0, 0.009, 1.01, float("nan"), float("inf")])
def test_impossible_edge_lengths_are_refused(edge):
    with pytest.raises(UsageError, match="edge length"):
        delaunay(None, CANVAS, edge)


def broken(mesh, how):
    triangles, vertices = mesh.triangles.copy(), mesh.vertices.copy()
    match how:
        case "turned":
            triangles[3] = triangles[3, ::-1]
        case "twice":
            triangles = np.concatenate([triangles, triangles[:1]])
        case "hole":
            middle = np.abs(vertices[triangles].mean(1) - 127.5).sum(1)
            triangles = np.delete(triangles, np.argmin(middle), axis=0)
        case "shifted":
            vertices = vertices // 2
        case "overlap":  # another triangle over the rim, with vertices of its own
            more = np.array([[0, 100], [90, 110], [0, 120]])
            triangles = np.concatenate([triangles, [np.arange(3) + len(vertices)]])
            vertices = np.concatenate([vertices, more]).astype(np.uint8)
        case "empty":
            triangles = triangles[:0]
    return replace(mesh, vertices=vertices, triangles=triangles.astype(np.int32))


@pytest.mark.parametrize("how", ["turned", "twice", "hole", "shifted", "overlap", "empty"])
def test_faults_of_meshes_are_found(how):
    shape = Boundary(2, (disc(600, 700, 512),))
    mesh, covered = delaunay(shape, CANVAS, 0.1), outline(shape, CANVAS, 0.1).covered
    assert sound(mesh, covered)
    assert not sound(broken(mesh, how), covered)


def test_rims_that_meet_in_a_vertex_are_found():
    assert rim(np.array([[0, 1, 2], [0, 3, 4]], np.int32)) is None
    assert rim(np.array([[0, 1, 2], [2, 1, 3]], np.int32)) == [[0, 1, 3, 2]]


def test_numpy_is_enough():
    code = """
import sys
import proxyimg_codec.geometry.mesher
print({"cv2", "torch", "scipy", "OpenImageIO"} & set(sys.modules))
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert ran.stdout.decode().strip() == "set()"
