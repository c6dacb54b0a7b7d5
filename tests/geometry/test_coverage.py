import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.errors import LimitError
from proxyimg_codec.geometry.coverage import FULL, ONE, coverage, flatten, to_output
from proxyimg_codec.limits import Budget, Limits
from proxyimg_codec.native import kernel

K = 0.5522847498


def circle(cx, cy, r, hole=False):
    corner = np.array(
        [(r, 0), (r, K * r), (K * r, r), (0, r), (-K * r, r), (-r, K * r),
         (-r, 0), (-r, -K * r), (-K * r, -r), (0, -r), (K * r, -r), (r, -K * r)]
    )  # fmt: skip
    points = np.rint((corner + np.array([cx, cy])) * ONE).astype(np.int64)
    return np.roll(points[::-1], 1, axis=0) if hole else points


def rectangle(x0, y0, x1, y1):
    """Straight segments: control points at thirds."""
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) * ONE
    nxt = np.roll(corners, -1, axis=0)
    parts = [corners, corners + (nxt - corners) / 3, corners + 2 * (nxt - corners) / 3]
    return np.rint(np.stack(parts, 1).reshape(-1, 2)).astype(np.int64)


def test_rectangles_are_exact():
    c = coverage([rectangle(2.5, 1, 6, 3.25)], 0, 0, 8, 5) / FULL
    expected = np.zeros((5, 8))
    expected[1:3, 2:6] = 1
    expected[3, 2:6] = 0.25
    expected[:, 2] *= 0.5
    assert np.allclose(c, expected, atol=1 / ONE)


def test_area_of_a_ring():
    c = coverage([circle(30.3, 25.7, 20), circle(30, 25, 8, hole=True)], 0, 0, 64, 50)
    assert c.sum() / FULL == pytest.approx(np.pi * (400 - 64), rel=1e-3)
    assert c[25, 30] == 0
    assert c[25, 45] == FULL


def test_against_supersampling():
    """Each pixel's coverage is the share of 32 x 32 points inside the polygon."""
    paths = [circle(9.3, 8.1, 6.4), circle(9.9, 8.4, 2.2, hole=True)]
    n = 32
    at = (np.arange(20 * n) + 0.5) / n * ONE
    inside = np.zeros((len(at), len(at)), np.int64)
    for path in paths:
        a, b = flatten(path)
        for (xa, ya), (xb, yb) in zip(a, b, strict=True):
            if ya == yb:
                continue
            rows = (at > min(ya, yb)) & (at <= max(ya, yb))
            x = xa + (at[rows] - ya) * (xb - xa) / (yb - ya)
            inside[rows] += np.where(at[None] > x[:, None], np.sign(yb - ya), 0)
    reference = (inside != 0).reshape(20, n, 20, n).mean((1, 3))
    assert np.abs(coverage(paths, 0, 0, 20, 20) / FULL - reference).max() < 0.03


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_no_pixel_depends_on_its_tile(seed):
    rng = np.random.default_rng(seed)
    paths = [rng.integers(-4000, 12000, (3 * rng.integers(1, 6), 2)) for _ in range(3)]
    whole = coverage(paths, -20, -20, 80, 80)
    x, y = rng.integers(-20, 30, 2)
    w, h = rng.integers(1, 30, 2)
    assert (coverage(paths, x, y, w, h) == whole[y + 20 : y + 20 + h, x + 20 : x + 20 + w]).all()


def test_shared_edges_add_up():
    """Two shapes with a common border cover each pixel of it once."""
    border = np.array([(1000, 200), (1900, 900), (300, 1500), (1200, 2300)])
    left = [(900, 2310), (500, 2300), (100, 2300), (90, 1500), (80, 900), (100, 200)]
    left = np.array([*border, *left, (300, 180), (600, 210)])
    right = [(1500, 190), (1900, 210), (2400, 200), (2410, 900), (2390, 1500), (2400, 2300)]
    right = np.array([*border[::-1], *right, (2000, 2290), (1600, 2310)])
    both = coverage([left], 0, 0, 10, 10) + coverage([right], 0, 0, 10, 10)
    assert (both[3:7, 1:9] == FULL).all()


@pytest.mark.parametrize("pixels", [1, 7, 100, 3333])
def test_scaling_rounds_half_up(pixels):
    points = np.arange(-50, 500)
    exact = (points / 4 - 3) * pixels * ONE / 90
    assert (to_output(points, 2, 3, 90, pixels) == np.floor(exact + 0.5)).all()


def test_flat_curves_take_few_chords():
    assert len(flatten(rectangle(0, 0, 100, 100))[0]) == 4
    assert 16 <= len(flatten(circle(0, 0, 50))[0]) <= 128


def with_numpy(*args, **more):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "available", lambda: False)
        return coverage(*args, **more)


@pytest.mark.skipif(not kernel.available(), reason="kernel not compiled")
@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 300, 9000, 1 << 20, 1 << 30]))
def test_the_kernel_does_what_numpy_does(seed, reach):
    rng = np.random.default_rng(seed)
    paths = [rng.integers(-reach, reach + 1, (3 * rng.integers(1, 6), 2)) for _ in range(3)]
    x, y = rng.integers(-20, 30, 2)
    w, h = rng.integers(1, 40, 2)
    assert np.array_equal(coverage(paths, x, y, w, h), with_numpy(paths, x, y, w, h))


@pytest.mark.skipif(not kernel.available(), reason="kernel not compiled")
def test_the_kernel_counts_work_as_numpy_does():
    rng = np.random.default_rng(1)
    path = rng.integers(-9000, 9000, (30, 2))
    budgets = Budget(), Budget()
    coverage([path], 0, 0, 40, 30, budgets[0])
    with_numpy([path], 0, 0, 40, 30, budgets[1])
    assert budgets[0].spent == budgets[1].spent
    work = budgets[0].spent["work"]
    for compute in (coverage, with_numpy):
        compute([path], 0, 0, 40, 30, Budget(Limits(work=work)))
        for less in (work - 1, work // 2, 1):
            with pytest.raises(LimitError, match="work"):
                compute([path], 0, 0, 40, 30, Budget(Limits(work=less)))
