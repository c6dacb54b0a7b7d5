import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.geometry import warp
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.pose import REST, Pose
from proxyimg_codec.geometry.warp import Warp
from tests.support.meshes import lattice

UNIT = 1 << 24


def at(path, t):
    """Points of all segments of a path at parameters t."""
    p = np.stack([path[0::3], path[1::3], path[2::3], np.roll(path[0::3], -1, 0)], 1).astype(float)
    w = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return np.einsum("kt,skd->std", w, p)


@pytest.fixture
def mesh():
    """Covers 0..72 across and 0..50 down, in pixels."""
    base = lattice(7, 6, step=(1024, 1024))
    plain = Mesh.build(type(base)((0, 0), base.step, base.vertices, base.triangles))
    return plain.split([np.arange(60) % 3 == 0])


@pytest.fixture
def shape():
    path = np.array([(20, 10), (50, 8), (66, 20), (50, 40), (40, 44), (22, 40)]) * 4
    return Boundary(2, (path,))


@given(st.integers(0, 10**6), st.integers(1, 60000))
@settings(max_examples=40, deadline=None)
def test_pieces_keep_the_corners(seed, size):
    path = np.random.default_rng(seed).integers(-size, size, (9, 2))
    pieces = warp.divide(path)
    corners = {tuple(p) for p in pieces[0::3].tolist()}
    assert {tuple(p) for p in path[0::3].tolist()} <= corners


def test_one_segment_is_divided_into_equal_parameters():
    path = np.array([(0, 0), (30000, 5000), (9000, 40000), (0, 0), (0, 0), (0, 0)])
    pieces = warp.divide(path)
    count = len(pieces) // 3 - 1
    assert count == 16
    t = np.linspace(0, 1, 7)
    for k in range(count):
        want = at(path, (k + t) / count)[0]
        assert np.abs(at(pieces, t)[k] - want).max() <= 1


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_barycentric_weights_give_the_point_back(seed):
    rng = np.random.default_rng(seed)
    refined = Mesh.build(lattice(5, 5)).refined
    low, high = refined.nodes.min(0), refined.nodes.max(0)
    points = rng.integers(low - 3000, high + 3000, (50, 2))
    face, weights = warp.barycentric(points, refined.nodes, refined.faces)
    assert (weights.sum(1) == 1 << 16).all()
    got = (weights[..., None] * refined.nodes[refined.faces[face]]).sum(1) / (1 << 16)
    assert np.abs(got - points).max() <= 2
    held = (weights >= 0).all(1)
    assert held.any()
    # What no face holds goes to the nearest one, so its weights stay moderate.
    assert np.abs(weights[~held]).max(initial=0) < 20 << 16


def test_at_rest_nothing_moves(shape, mesh):
    assert warp.outline(shape, REST, mesh, (72, 50)) is shape
    x, y = np.array([3.7]), np.array([9.1])
    shown = Warp(REST, mesh).locate(x, y)
    assert shown.x is x
    assert shown.y is y


def test_affine_poses_map_control_points_and_texture(shape):
    pose = Pose(matrix=(0, UNIT, -UNIT, 0), shift=(70 << 10, -3 << 10))
    moved = warp.outline(shape, pose, None, (72, 50))
    x, y = (shape.paths[0] << 8).T
    np.testing.assert_array_equal(moved.paths[0], np.stack([(70 << 10) - y, x - (3 << 10)], axis=1))
    shown = Warp(pose, None).locate(np.array([70.0 - 12]), np.array([30.0 - 3]))
    assert (shown.x[0], shown.y[0]) == (30, 12)


def test_the_whole_canvas_becomes_a_rectangle():
    moved = warp.outline(None, Pose(shift=(512, 0)), None, (6, 4))
    assert moved.bounds() == (0, 0, 7, 4)
    assert moved.paths[0][::3].tolist() == [
        [512, 0], [6656, 0], [6656, 4096], [512, 4096]
    ]  # fmt: skip


def test_a_bend_that_is_a_shift_is_a_shift(shape, mesh):
    count = len(mesh.refined.nodes)
    bent = Pose(nodes=np.tile([5 << 4, -2 << 4], (count, 1)))
    moved = warp.outline(shape, bent, mesh, (72, 50))
    plain = warp.divide(shape.paths[0] << 8) + np.array([5 << 10, -2 << 10])
    np.testing.assert_array_equal(moved.paths[0], plain)
    y, x = np.mgrid[5:40, 10:60] + 0.5
    chart = Warp(bent, mesh)
    face = chart.faces(np.zeros(2), np.ones(2), (10, 5, 50, 35))
    shown = chart.locate(x.ravel(), y.ravel(), face.ravel())
    np.testing.assert_allclose(shown.x, x.ravel() - 5, atol=1e-9)
    np.testing.assert_allclose(shown.y, y.ravel() + 2, atol=1e-9)


def test_a_bend_is_undone_by_the_texture(shape, mesh):
    # The texture point of a bent node's place is the node itself; between nodes it is linear.
    rng = np.random.default_rng(0)
    refined = mesh.refined
    bent = Pose(nodes=rng.integers(-24, 24, refined.nodes.shape))
    chart = Warp(bent, mesh, True)
    present = bent.present(refined) / 1024
    rest = refined.nodes / 1024
    faces = rng.integers(0, len(refined.faces), 40)
    weights = rng.dirichlet([1, 1, 1], 40)
    place = np.einsum("nk,nkd->nd", weights, present[refined.faces[faces]])
    want = np.einsum("nk,nkd->nd", weights, rest[refined.faces[faces]])
    shown = chart.locate(place[:, 0], place[:, 1], faces.astype(np.int32))
    np.testing.assert_allclose(np.stack([shown.x, shown.y], 1), want, atol=1e-6)
    np.testing.assert_allclose(shown.weights, weights, atol=1e-6)


def test_what_did_not_move_stays_exactly_where_it_was(mesh):
    refined = mesh.refined
    nodes = np.zeros_like(refined.nodes)
    nodes[refined.nodes[:, 0] > 50 << 10] = (40, 8)
    chart = Warp(Pose(nodes=nodes), mesh)
    y, x = (v.ravel() for v in np.mgrid[10:30, 10:30] + 0.37)
    face = chart.faces(np.array([-0.13, -0.13]), np.ones(2), (10, 10, 20, 20))
    shown = chart.locate(x, y, face.ravel())
    np.testing.assert_array_equal(shown.x, x)
    np.testing.assert_array_equal(shown.y, y)


def test_samples_beyond_the_mesh_follow_the_nearest_face(mesh):
    count = len(mesh.refined.nodes)
    chart = Warp(Pose(nodes=np.tile([16, 0], (count, 1))), mesh)
    x = np.array([-300.0, 500.0])
    shown = chart.locate(x, np.array([20.0, 20.0]), np.array([-1, -1], np.int32))
    np.testing.assert_allclose(shown.x, x - 1)
