"""Layers that touch move as one."""

from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.animate.animate import preset
from proxyimg_codec.animate.coupling import touching
from proxyimg_codec.geometry.pose import REST
from proxyimg_codec.geometry.warp import barycentric
from tests.support.images import changed
from tests.support.pyramids import cut_picture


@pytest.fixture
def picture(made_up_planes):
    return cut_picture()


def test_fixture_is_what_tests_below_believe(picture):
    assert [v.boundary is None for v in picture.layers] == [True, False, False]


def shifted(layer, by):
    """The layer with its boundary moved across by pixels."""
    shape = layer.boundary
    paths = tuple(p + np.array([by << shape.unit, 0]) for p in shape.paths)
    return changed(layer, boundary=replace(shape, paths=paths))


def test_what_touches_is_found(picture):
    size = (picture.width, picture.height)
    _, one, two = picture.layers
    far = shifted(two, 500)
    wide = (size[0] + 600, size[1])
    assert touching([one, two], size) == [[0, 1]]
    assert touching([one, far], wide) == [[0], [1]]
    assert touching([far, one, shifted(two, 501)], wide) == [[0, 2], [1]]


def displacement(layer, point, t, timeline):
    """How far a point of a layer at rest is displaced, in px."""
    refined = layer.mesh.refined
    at = np.rint(np.array([point]) * 1024).astype(np.int64)
    face, weights = barycentric(at, refined.nodes, refined.faces)
    moved = layer.track.at(timeline, t)[refined.faces[face[0]]]
    return weights[0] @ moved / (1 << 16) / 1024


def test_layers_that_touch_do_not_tear(picture):
    moving = picture.animated(preset(picture, "sway", duration=1.0))
    one, two = (v for v in moving.layers if v.track)
    assert one.track.body == two.track.body
    # The disc stands on the bar there.
    for t in (0.0, 0.4):
        a, b = (displacement(v, (32, 38), t, moving.timeline) for v in (one, two))
        assert np.hypot(*(a - b)) < 0.5
    assert max(np.hypot(*displacement(two, (32, 12), k / 8, moving.timeline)) for k in range(8)) > 1
    # What the bar and the disc share stays; what either shares with the back, which rests, goes.
    assert len(moving.layers[1].texture.cuts.fronts) == 1
    assert not moving.at(0.4).layers[1].moved_neighbours.fronts
    assert len(moving.at(0.4).layers[0].moved_neighbours.fronts) == 2


def test_separate_layers_have_bodies_of_their_own(picture):
    moving = picture.animated(preset(picture, "sway", duration=1.0, together=False))
    one, two = (v for v in moving.layers if v.track)
    assert one.track.body != two.track.body
    again = from_bytes(moving.to_bytes())
    assert [v.track and v.track.body for v in again.layers] == [
        v.track and v.track.body for v in moving.layers
    ]


def test_layers_of_one_body_rest_on_each_other():
    sway = np.ones((3, 2), np.int64)
    one = replace(REST, sway=sway, body=0)
    assert one.still(replace(REST, sway=2 * sway, body=0))
    assert not one.still(replace(REST, sway=sway, body=1))
    assert not one.still(REST)
    assert not one.still(replace(one, nodes=sway))
