import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry import pose
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.pose import REST, Pose
from tests.support.meshes import lattice

UNIT = 1 << 24
entries = st.integers(1 - (1 << 31), (1 << 31) - 1)
coordinates = st.integers(-(1 << 30), 1 << 30)


@given(st.tuples(entries, entries, entries, entries), st.tuples(coordinates, coordinates))
def test_points_are_mapped_exactly(matrix, point):
    a, b, c, d = matrix
    x, y = point
    got = Pose(matrix=matrix, shift=(7, -9)).apply(np.array([point]))[0]
    half = Fraction(1, 2)
    want = [Fraction(a * x + c * y, UNIT) + half, Fraction(b * x + d * y, UNIT) + half]
    assert got.tolist() == [math.floor(want[0]) + 7, math.floor(want[1]) - 9]


def test_a_pose_at_rest_touches_nothing():
    points = np.array([[1 << 40, -5]])
    assert REST.at_rest
    assert REST.apply(points) is points
    for change in (
        {"shift": (0, 1)}, {"matrix": (UNIT, 1, 0, UNIT)}, {"opacity": 0}, {"hidden": True},
        {"colour": (0,) * 12}, {"nodes": np.ones((3, 2), int)}, {"places": np.ones((3, 2), int)},
    ):  # fmt: skip
        assert not Pose(**change).at_rest


numbers = st.floats(-5, 5).filter(lambda v: abs(v) > 1e-3)


@given(st.tuples(*[numbers] * 6), st.tuples(*[numbers] * 6), st.tuples(numbers, numbers))
def test_products_and_inverses_are_those_of_maps(first, second, point):
    def on(m, p):
        return m[0] * p[0] + m[2] * p[1] + m[4], m[1] * p[0] + m[3] * p[1] + m[5]

    assert on(pose.product(second, first), point) == pytest.approx(on(second, on(first, point)))
    if abs(first[0] * first[3] - first[1] * first[2]) > 0.1:
        assert on(pose.inverse(first), on(first, point)) == pytest.approx(point, abs=1e-6)


@pytest.mark.parametrize(
    "matrix",
    [
        (1, 2, 2, 4, 0, 0), (0, 0, 0, 0, 0, 0), (1, 0, 0, 1e-9, 0, 0), (128, 0, 0, 1, 0, 0),
        (1, 0, 0, 1, 1e8, 0), (math.nan, 0, 0, 1, 0, 0), (1, 0, 0, 1, math.inf, 0),
    ],
)  # fmt: skip
def test_what_cannot_be_stored_is_none(matrix):
    assert pose.fixed(matrix) is None


def test_a_hundredfold_can():
    assert pose.fixed((100, 0, 0, 100, -5, 7)) == ((100 * UNIT, 0, 0, 100 * UNIT), (-5120, 7168))


@pytest.fixture
def mesh():
    plain = Mesh.build(lattice(4, 4))
    rng = np.random.default_rng(0)
    one = rng.random(18) < 0.5
    return plain.split([one, rng.random(4 * one.sum()) < 0.5])


@pytest.mark.parametrize("reach", [3, 70000])
def test_poses_come_back(mesh, reach):
    rng = np.random.default_rng(reach)
    count = len(mesh.refined.nodes)
    nodes, places = rng.integers(-reach, reach, (2, count, 2))
    colour = tuple(int(v) for v in rng.integers(-5000, 5000, 12))
    made = Pose((UNIT, -5, 1 << 30, 17), (-(1 << 32), 3), nodes, places, 9, True, colour)
    back = pose.decode(pose.encode(made, mesh), mesh, "here")
    for name in ("matrix", "shift", "opacity", "hidden", "colour"):
        assert getattr(back, name) == getattr(made, name)
    np.testing.assert_array_equal(back.nodes, nodes)
    np.testing.assert_array_equal(back.places, places)


def test_a_smooth_bend_costs_little(mesh):
    nodes = mesh.refined.nodes // 512
    fields = pose.encode(Pose(nodes=nodes), mesh)
    vertices, count = len(mesh.base.vertices), len(nodes)
    size = len(fields["node_classes"]) + len(fields["node_deltas"])
    # Midpoints lie half-way and cost next to nothing.
    assert size < 20 + 2.5 * vertices + 0.25 * (count - vertices)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"matrix": [UNIT, UNIT, UNIT, UNIT]}, "singular"),
        ({"colour": [1] * 11}, "12 entries"),
        ({}, "does nothing"),
        ({"node_deltas": b"\0"}, "without classes"),
    ],
)
def test_bad_poses_are_refused(mesh, change, said):
    with pytest.raises(FormatError, match=said):
        pose.decode({**pose.encode(REST, mesh), **change}, mesh, "here")


def test_displacements_need_a_mesh_and_must_do_something(mesh):
    count = len(mesh.refined.nodes)
    fields = pose.encode(Pose(nodes=np.ones((count, 2), int)), mesh)
    with pytest.raises(FormatError, match="need a mesh"):
        pose.decode(fields, None, "here")
    fields = pose.encode(Pose(nodes=np.zeros((count, 2), int)), mesh)
    with pytest.raises(FormatError, match="all zero"):
        pose.decode(fields, mesh, "here")
    far = np.full((count, 2), pose.NODE_MAX)
    with pytest.raises(FormatError, match="out of range"):
        pose.decode(pose.encode(Pose(nodes=far), mesh), mesh, "here")
