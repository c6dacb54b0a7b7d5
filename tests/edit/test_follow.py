"""Control points that take the inside of a layer along."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.edit.transforms import sampled
from proxyimg_codec.geometry.boundary import Boundary
from tests.support.edits import covered, grown
from tests.support.images import changed
from tests.support.pyramids import cut_picture


@pytest.fixture(params=["implicit", "pyramid"])
def image(request, small_pxi, made_up_planes):
    return pxi.open(small_pxi) if request.param == "implicit" else cut_picture()


def ends(layer):
    """Ends of the segments of a layer's present outline, float64 [n, 2] in pixels."""
    shape = layer.outline
    return np.concatenate([p[0::3] for p in shape.paths]) / (1 << shape.unit)


def nearest(points, place):
    return np.hypot(*(points - place).T).min()


def distances(points, path):
    """Distances [n] of points from a closed polygon."""
    along = np.roll(path, -1, 0) - path
    t = ((points[:, None] - path) * along).sum(2) / np.maximum((along**2).sum(1), 1e-9)
    foot = path + np.clip(t, 0, 1)[..., None] * along
    return np.hypot(*(points[:, None] - foot).transpose(2, 0, 1)).min(1)


@pytest.mark.parametrize("by", [(4, -3), (-2.5, 5), (9, 0)])
@pytest.mark.parametrize("turned", [False, True])
def test_the_point_arrives_and_others_stay(image, by, turned):
    if turned:
        image = image.layers["disc"].rotated(35).layers["disc"].scaled(1.2)
    disc = image.layers["disc"]
    for number in (0, 3):
        before = ends(disc)
        there = before[number // 3] + by
        moved = disc.with_point(0, number, *by, follow=True).layers["disc"]
        after = ends(moved)
        assert nearest(after, there) < 0.15
        if not turned:
            # The outline is the one that moving the point alone would give.
            shape = disc.with_point(0, number, *by).layers["disc"].boundary
            off = distances(sampled(moved.outline), sampled(shape))
            assert off.max() < 0.35 * np.hypot(*by)
            assert off.mean() < 0.06 * np.hypot(*by)
        np.testing.assert_array_equal(moved.boundary.paths[0], disc.boundary.paths[0])


def test_the_inside_goes_along(image):
    """A node near the point moves nearly as far, one on the other side hardly."""
    disc = image.layers["disc"]
    place = ends(disc)[0]
    moved = disc.with_point(0, 0, 3, -2, follow=True).layers["disc"]
    nodes = moved.mesh.refined.nodes / 1024
    went = np.hypot(*(moved.pose.nodes / 16).T) / np.hypot(3, 2)
    away = np.hypot(*(nodes - place).T)
    assert went[away.argmin()] > 0.5
    assert went[away > 18].max() < 0.35
    inside = nodes[covered(image, "disc")[tuple(np.clip(nodes, 0, 47).astype(int).T[::-1])]]
    assert len(inside) > 5


def test_only_what_it_covers_changes(image):
    moved = image.layers["disc"].with_point(0, 0, 4, -3, follow=True)
    near = grown(covered(image, "disc") | covered(moved, "disc"), 3)
    np.testing.assert_array_equal(moved.render()[~near], image.render()[~near])
    again = pxi.from_bytes(moved.to_bytes())
    np.testing.assert_array_equal(again.render(), moved.render())
    assert again.undone().to_bytes() == image.to_bytes()


def test_points_can_be_moved_one_after_the_other(image):
    disc = image.layers["disc"]
    before = ends(disc)
    both = disc.with_point(0, 0, 3, 0, follow=True).layers["disc"]
    both = both.with_point(0, 3 * (len(before) // 2), -3, 1, follow=True).layers["disc"]
    assert nearest(ends(both), before[0] + (3, 0)) < 0.6
    assert nearest(ends(both), before[len(before) // 2] + (-3, 1)) < 0.15


def test_a_layer_of_few_triangles(made_up_planes):
    """Where the mesh is too coarse for pins, what is farthest away stays."""
    square = [[80, 80], [90, 80], [100, 80], [100, 90], [100, 100], [90, 100], [80, 100], [80, 90]]
    tiny = Boundary(2, (np.array([*square, [80, 85]], np.int64),))
    image = cut_picture()
    disc = changed(image.layers["disc"], boundary=tiny)
    small = changed(image, layers=[*image.layers[:2], disc], info=None)
    moved = small.layers["disc"].with_point(0, 0, -2, -1, follow=True).layers["disc"]
    before, after = ends(small.layers["disc"]), ends(moved)
    assert nearest(after, before[0] + (-2, -1)) < 0.15
    assert pxi.from_bytes(moved.image.to_bytes()).render().shape == (48, 64, 3)


def test_flag_belongs_to_a_point(tool, small_pxi, tmp_path):
    out = tmp_path / "out.pxi"
    tool("edit", small_pxi, out, "--follow", code=2)
    tool(
        "edit", small_pxi, out, "--point", "disc", "0,0", "1,1", "--hide", "bar", "--follow", code=2
    )
