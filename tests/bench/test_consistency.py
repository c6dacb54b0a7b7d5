"""The measures of steadiness know where points come from, and tell change from motion."""

from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec.bench import consistency as c
from proxyimg_codec.bench.features import distance
from proxyimg_codec.edit.transforms import meshed
from proxyimg_codec.geometry.mesh import FRACTION_BITS
from proxyimg_codec.geometry.track import Timeline, Track
from proxyimg_codec.model import Layers
from proxyimg_codec.render.view import make_view
from tests.support.images import changed


@pytest.fixture
def moved(pyramid):
    """The disc stands still at 0 and 1 s, and goes right by up to a few pixels between."""
    disc = meshed(pyramid.picture, pyramid.layers["disc"].data)
    shape = np.zeros((1, len(disc.mesh.refined.nodes), 2), np.int64)
    shape[..., 0] = 16
    curve = np.array([[0, 0, 0, 256, 256, 0, 0]], np.int64)
    disc = changed(disc, track=Track(curve, shape))
    timeline = Timeline(1000, 24, False, 4, 2)
    layers = [disc if v.name == "disc" else v for v in pyramid.layers]
    return changed(pyramid, layers=Layers(layers), timeline=timeline)


def shift(image, t):
    """How far the disc has gone right at a time, in pixels."""
    sway = image.at(t).layers["disc"].pose.sway
    assert len(np.unique(sway, axis=0)) == 1
    return sway[0, 0] / (1 << FRACTION_BITS)


def test_points_come_from_where_they_were(moved):
    view = make_view((moved.width, moved.height))
    first, second = 0.3, 0.6
    way = shift(moved, second) - shift(moved, first)
    assert way > 1
    after = moved.at(second)
    seen = c.labels(after, view)
    points = c.origins(moved.at(first), after, seen, view)
    row, column = np.nonzero(seen == 2)
    assert len(row) > 300
    want = np.stack([column + 0.5 - way, row + 0.5], axis=1)
    np.testing.assert_allclose(points[row, column], want, atol=2 / (1 << FRACTION_BITS))
    assert np.isnan(points[seen != 2]).all()


def test_along_the_flow_texture_stays_and_standing_still_does_not_score(moved):
    count, exact, plain, idle, length = c.pair(moved.at(0.3), moved.at(0.6))
    assert exact / count < 0.1 * plain / count < 0.1 * idle / count
    assert length / count == pytest.approx(shift(moved, 0.6) - shift(moved, 0.3), abs=0.01)


def test_texture_that_swims_is_told(moved):
    """A later frame whose texture is stretched by up to a pixel."""
    before, after = moved.at(0.3), moved.at(0.6)
    texture = moved.layers["disc"].texture
    left, top, columns, rows = texture.part
    texture = replace(texture, part=(left + 1, top, columns - 1, rows), cuts=None, mask=None)
    layers = [changed(v, texture=texture) if v.name == "disc" else v for v in after.layers]
    good, bad = c.pair(before, after), c.pair(before, changed(after, layers=Layers(layers)))
    assert bad[1] / bad[0] > 10 * good[1] / good[0]


def test_labels_keep_away_from_outlines(pyramid):
    view = make_view((pyramid.width, pyramid.height))
    seen = c.labels(pyramid, view)
    y, x = np.mgrid[: pyramid.height, : pyramid.width] + 0.5
    away = np.hypot(x - 32, y - 24) - 14
    assert (seen[away < -3.5] == 2).all()
    assert (seen[np.abs(away) < 2] == c.NOWHERE).all()
    assert (seen[(away > 4) & (y < 34)] == 0).all()


def test_distance_in_gradients():
    y, x = np.mgrid[:64, :96]
    stripes = np.repeat(np.uint8(127 + 100 * np.sin(x / 3.0))[..., None], 3, 2)
    other = np.repeat(np.uint8(127 + 100 * np.sin(y / 3.0))[..., None], 3, 2)
    assert (distance(stripes, stripes) == 0).all()
    brighter = np.uint8(stripes * 0.8 + 20)
    assert (distance(stripes, brighter) < 0.1).all()
    assert (distance(stripes, other) > 0.8).all()
