import numpy as np
import pytest

from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.texture import node_sampling as node
from tests.support.textures import texture

BOX = (4, 2, 40, 25)
NODES = np.array([[5.0, 3.0], [41.0, 6.0], [12.0, 26.0], [43.0, 24.0]])
FACES = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
ANCHORS = np.array([[4.0, 2.0], [44.0, 2.0], [30.0, 27.0]])


def samples(count):
    rng = np.random.default_rng(count)
    face = rng.integers(0, 2, count)
    weights = rng.dirichlet([1, 1, 1], count)
    points = (weights[:, :, None] * NODES[FACES[face]]).sum(1)
    return face, weights, points


def features(sampling, face, weights, points, anchors=ANCHORS):
    t = texture()
    return node.features(t, BOX, sampling, NODES, FACES, anchors, face, weights, points)


def direct(points):
    t = texture()
    return t.features(t.taps(points[:, 0], points[:, 1], BOX)).astype(float)


def test_features_are_combined_from_nodes_and_anchors():
    face, weights, points = samples(500)
    got = features(node.BOTH, face, weights, points)
    corners = direct(NODES)[FACES[face]]
    np.testing.assert_allclose(got[:, :3], (weights[:, :, None] * corners).sum(1), atol=1e-6)
    share = 1 / ((points[:, None] - ANCHORS) ** 2).sum(2)
    share /= share.sum(1, keepdims=True)
    np.testing.assert_allclose(got[:, 3:], share @ direct(ANCHORS), atol=1e-6)
    assert got.dtype == np.float32


def test_local_and_global_are_the_halves_of_both():
    face, weights, points = samples(100)
    both = features(node.BOTH, face, weights, points)
    assert (features(node.LOCAL, face, weights, points) == both[:, :3]).all()
    assert (features(node.GLOBAL, face, weights, points) == both[:, 3:]).all()


def test_only_what_is_used_is_looked_at():
    face, weights, points = samples(10)
    t, nothing = texture(), np.zeros((0, 2))
    local = node.features(t, BOX, node.LOCAL, NODES, FACES, nothing, face, weights, points)
    assert (local == features(node.LOCAL, face, weights, points)).all()
    no_faces, no_weights = np.full(10, 99), np.full((10, 3), np.nan)
    alone = node.features(
        t, BOX, node.GLOBAL, nothing, np.zeros((0, 3), np.int32), ANCHORS, no_faces, no_weights,
        points,
    )  # fmt: skip
    assert (alone == features(node.GLOBAL, face, weights, points)).all()


def test_at_an_anchor_its_feature_is_that_of_the_plane():
    """Nearer than a hundredth of a pixel nothing changes, and no weight is infinite."""
    at = np.array([ANCHORS[1], ANCHORS[1] + 0.005])
    got = features(node.GLOBAL, np.zeros(2, int), np.ones((2, 3)) / 3, at)
    np.testing.assert_allclose(got, direct(ANCHORS[[1, 1]]), atol=1e-6)


@pytest.mark.parametrize("sampling", [node.BOTH, node.LOCAL, node.GLOBAL])
def test_a_point_does_not_depend_on_the_others(sampling):
    count = 2 * node.CHUNK + 5
    face, weights, points = samples(count)
    whole = features(sampling, face, weights, points)
    order = np.random.default_rng(0).permutation(count)
    mixed = features(sampling, face[order], weights[order], points[order])
    assert (mixed == whole[order]).all()
    for k in (0, 1, node.CHUNK, count - 1):
        one = slice(k, k + 1)
        assert (features(sampling, face[one], weights[one], points[one]) == whole[one]).all()


def test_anchors_are_the_middles_of_segments():
    rng = np.random.default_rng(0)
    paths = tuple(rng.integers(-900, 900, (3 * m, 2)) for m in (1, 4))
    got = node.anchors(Boundary(3, paths), (1, 1))
    want = []
    for path in paths:
        for k in range(0, len(path), 3):
            curve = np.array([path[(k + i) % len(path)] for i in range(4)]) / 8
            while len(curve) > 1:
                curve = (curve[1:] + curve[:-1]) / 2  # de Casteljau
            want.append(curve[0])
    np.testing.assert_array_equal(got, want)


def test_without_a_boundary_the_anchors_are_the_middles_of_the_sides():
    assert node.anchors(None, (7, 4)).tolist() == [[3.5, 0], [7, 2], [3.5, 4], [0, 2]]
