import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.completion.occluded import BAND, KNOWN, LATTICE, continued, extended
from proxyimg_codec.encoder.implicit.fit_problem import build
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.texture.network import NetShape

SHAPE = NetShape(2, 0, 4, 1, 3)
SPACING = 6.0
SIZE = 48


def square(x0, y0, x1, y1):
    """Coordinates in pixels."""
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) * 4
    return Boundary(2, (np.repeat(corners, 3, axis=0),))


def ramp(height, width):
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    return np.dstack([0.2 + x / 100, 0.9 - y / 100, 0.3 + (x + y) / 200])


def plain(picture, *outlines):
    height, width = picture.shape[:2]
    alpha = np.ones((height, width, 1), np.float32)
    return build(np.dstack([picture, alpha]), list(outlines), SHAPE, SPACING)


def places(problem, count):
    """x and y in canvas pixels of the last `count` entries, which are the back layer's."""
    back = problem.planes[0]
    y, x = np.divmod(problem.base[-count:], back.columns)
    scale = SIZE / (back.columns - 1)
    return (x + problem.fx[-count:]) * scale, (y + problem.fy[-count:]) * scale


def test_a_ramp_goes_on_through_a_hole():
    value = ramp(40, 61)
    hole = np.zeros((40, 61), bool)
    hole[9:30, 14:50] = True
    spoilt = np.where(hole[..., None], np.float32(7), value)
    got = continued(spoilt, np.where(hole, 0, KNOWN).astype(np.float32))
    assert np.abs(got - value)[~hole].max() < 1e-3
    assert np.abs(got - value)[hole].max() < 0.03  # of a range of 0.6


def test_little_weight_gives_way_to_the_surroundings():
    value = np.full((9, 9, 3), 0.5, np.float32)
    value[4, 4] = 1
    weight = np.full((9, 9), KNOWN, np.float32)
    weight[4, 4] = 4  # as much as its four neighbours together
    assert continued(value, weight)[4, 4] == pytest.approx(0.75, abs=1e-3)


def test_hidden_pixels_of_the_back_layer_are_added():
    picture = ramp(SIZE, SIZE)
    picture[12:40, 10:38] = (1, 0, 1)
    before = plain(picture, None, square(10, 12, 38, 40))
    after = extended(before, SIZE, SIZE, SPACING)
    assert (after.first[: before.pixels + 1] == before.first).all()
    assert (after.target[: before.pixels] == before.target).all()
    count = after.pixels - before.pixels
    assert (np.diff(after.first)[-count:] == 1).all()
    assert (after.base[-count:] < after.planes[0].size).all()
    assert (after.coverage[-count:] == 1).all()
    assert (after.learn[-count:] == 1).all()
    x, y = places(after, count)
    wanted = ramp(SIZE, SIZE)[y.astype(int), x.astype(int)]
    assert np.abs(after.target[-count:] - wanted).max() < 0.03


def test_they_lie_close_at_the_rim_and_sparse_inside():
    after = extended(plain(ramp(SIZE, SIZE), None, square(4, 4, 44, 44)), SIZE, SIZE, SPACING)
    chosen = np.zeros((SIZE, SIZE), bool)
    x, y = places(after, after.pixels - SIZE * SIZE)
    chosen[y.astype(int), x.astype(int)] = True
    assert not chosen[:4].any()
    assert chosen[4 : 4 + BAND, 4:44].all()
    inner = chosen[12:36, 12:36]
    assert inner.sum() == inner.size / LATTICE**2


def test_they_add_no_stored_codes():
    before = plain(ramp(SIZE, SIZE), None, square(4, 4, 44, 44))
    after = extended(before, SIZE, SIZE, SPACING)
    for a, b in zip(after.stored(), before.stored(), strict=True):
        assert (a == b).all()
    assert not after.stored()[0].all()
    rows = after.prior.rows[after.prior.rows < after.planes[0].size]
    assert not after.stored()[0].ravel()[rows].all()  # codes filled in later are drawn together


def test_nothing_to_add():
    alone = plain(ramp(SIZE, SIZE), None)
    assert extended(alone, SIZE, SIZE, SPACING) is alone
    covered = plain(ramp(SIZE, SIZE), None, square(0, 0, SIZE, SIZE))
    assert extended(covered, SIZE, SIZE, SPACING) is covered


def test_one_colour_stays_one_colour():
    flat = plain(np.full((SIZE, SIZE, 3), np.float32(0.3)), None, square(9, 9, 30, 31))
    after = extended(flat, SIZE, SIZE, SPACING)
    assert after.pixels > flat.pixels
    assert (after.target == after.target[0]).all()


@pytest.mark.parametrize(("radius", "limit"), [(20, 5), (19, 24)])
def test_removing_an_object_shows_what_is_around(radius, limit):
    """Also with a mask that leaves out the object's rim; without the lesson 13 and 33."""
    clean = (255 * ramp(64, 96)).clip(0, 255).astype(np.uint8)
    y, x = np.mgrid[0:64, 0:96]
    far = np.hypot(x - 48, y - 32)
    picture = np.where(far[..., None] < 20, np.array([250, 30, 220], np.uint8), clean)
    image = pxi.encode(picture, masks=[Region("disc", far < radius)], effort=2, jobs=1)
    error = np.abs(image.render(layers=["back"]).astype(int) - clean)
    assert error[far < radius - 1].mean() < limit
