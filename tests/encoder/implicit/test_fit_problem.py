import numpy as np

from proxyimg_codec.encoder.implicit.fit_problem import build
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.texture.network import NetShape

SHAPE = NetShape(2, 0, 4, 1, 3)


def square(x0, y0, x1, y1):
    """Coordinates in quarters of a pixel."""
    return Boundary(2, (np.repeat(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), 3, axis=0),))


def make(*outlines, size=24, alpha=1.0):
    picture = np.full((size, size, 4), alpha, np.float32)
    return build(picture, list(outlines), SHAPE, 6.0)


def test_inner_pixels_have_one_entry_and_rims_two():
    p = make(None, square(22, 16, 66, 64))  # x 5.5 .. 16.5, y 4 .. 16
    counts = np.diff(p.first).reshape(24, 24)
    assert counts[10, 10] == 1
    assert counts[0, 0] == 1
    assert counts[10, 5] == counts[10, 16] == 2
    front = p.first[10 * 24 + 5]
    assert p.coverage[front] == 0.5
    assert p.base[front] >= p.planes[1].start
    assert p.base[front + 1] < p.planes[1].start
    assert p.areas[1] == 11 * 12
    assert sum(p.areas) == 24 * 24


def test_only_the_front_learns_on_its_rim():
    p = make(None, square(22, 16, 66, 64))
    front = p.first[10 * 24 + 5]
    assert p.learn[front : front + 2].tolist() == [1, 0]
    assert p.learn.sum() == len(p.learn) - 2 * 12


def test_hidden_codes_are_not_stored():
    p = make(None, square(0, 0, 72, 96))
    back, front = p.stored()
    assert front.all()
    assert not back[:, :3].any()
    assert back[:, -2:].all()


def test_pixels_outside_all_layers_are_left_out():
    p = make(square(16, 16, 48, 48))
    assert p.pixels == 64
    assert p.planes[0].box == (4, 4, 8, 8)


def test_little_known_codes_have_a_prior():
    p = make(None, square(22, 16, 66, 64))
    stored = np.concatenate([s.ravel() for s in p.stored()])
    assert stored[p.prior.rows].all()
    assert stored[p.prior.next].all()
    assert (p.prior.weight > 0).all()


def test_boxes_stay_on_the_canvas():
    p = make(None, square(-40, -40, 40, 400))
    assert p.planes[1].box == (0, 0, 10, 24)
