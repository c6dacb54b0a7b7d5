from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.errors import LimitError
from proxyimg_codec.geometry.raster import rasterize
from proxyimg_codec.limits import Budget, Limits


def fan(rng, points=7, size=20.0):
    """Triangles round a point: a cover of their outline without gap or overlap."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, points))
    rim = size / 2 + np.stack([np.cos(angle), np.sin(angle)], 1) * rng.uniform(4, 9, (points, 1))
    centre = np.array([size / 2, size / 2])
    return np.stack([np.stack([centre, rim[k - 1], rim[k]]) for k in range(points)]), rim


def inside(corners, x, y):
    """Whether points are strictly inside a triangle."""
    sides = np.stack([
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)
    ])  # fmt: skip
    return (sides.min(0) > 1e-9) | (sides.max(0) < -1e-9)


@given(st.integers(0, 10**6))
@settings(max_examples=50, deadline=None)
def test_each_sample_finds_the_triangle_that_holds_it(seed):
    corners, _ = fan(np.random.default_rng(seed))
    found = rasterize(corners, 0, 0, 20, 20)
    y, x = np.mgrid[0:20, 0:20] + 0.5
    holding = np.stack([inside(t, x, y) for t in corners])
    alone = holding.sum(0) == 1
    assert (found[alone] == holding.argmax(0)[alone]).all()


@pytest.mark.parametrize("shift", [0, 0.5, 0.25])
def test_shared_edges_leave_no_gap_even_through_centres(shift):
    # Vertices on centres of samples are the worst case for rounding.
    grid = np.arange(0, 13, 3) + shift
    corners = []
    for y0, y1 in pairwise(grid):
        for x0, x1 in pairwise(grid):
            corners += [[(x0, y0), (x1, y0), (x0, y1)], [(x1, y0), (x1, y1), (x0, y1)]]
    found = rasterize(np.array(corners, float), 0, 0, 14, 14)
    low, high = int(np.ceil(grid[0] - 0.5)), int(np.ceil(grid[-1] - 0.5))
    assert (found[low:high, low:high] >= 0).all()
    assert (found >= 0).sum() == (high - low) ** 2


def test_front_faces_win_over_flipped_ones_and_low_numbers_over_high():
    front = np.array([(0, 0), (9, 0), (0, 9)], float)
    flipped = front[::-1]
    assert rasterize(np.stack([flipped, front]), 0, 0, 4, 4).max() == 1
    assert (rasterize(np.stack([flipped, front]), 0, 0, 4, 4) == 1).all()
    assert (rasterize(np.stack([front, front]), 0, 0, 4, 4) == 0).all()


def test_a_window_shows_what_the_whole_does():
    corners, _ = fan(np.random.default_rng(3))
    whole = rasterize(corners, 0, 0, 20, 20)
    np.testing.assert_array_equal(rasterize(corners, 5, 7, 6, 9), whole[7:16, 5:11])


def test_flat_triangles_hold_nothing():
    flat = np.array([[(0, 0), (5, 5), (9, 9)], [(3, 3), (3, 3), (3, 3)]], float)
    assert (rasterize(flat, 0, 0, 10, 10) == -1).all()


def test_folding_without_end_is_refused():
    big = np.repeat(np.array([[(0, 0), (99, 0), (0, 99)]], float), 50, axis=0)
    with pytest.raises(LimitError, match="overlap"):
        rasterize(big, 0, 0, 30, 30, Budget(Limits(overlap=10)))
