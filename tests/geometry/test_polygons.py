import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.geometry.polygons import apart, area, simplified, touching, untangled, winding

SQUARE = np.array([(0, 0), (10, 0), (10, 10), (0, 10)])


def crack_loop(heights):
    """A closed chain of unit steps round columns of the given heights above the x axis."""
    points = [(x, 0) for x in range(len(heights), -1, -1)]
    level = 0
    for x, h in enumerate([*heights, 0]):
        step = 1 if h > level else -1
        points += [(x, y + step) for y in range(level, h, step)]
        points += [(x + 1, h)] if x < len(heights) else []
        level = h
    unique = dict.fromkeys(points)
    return np.array(list(unique))[::-1]


def distance(points, loop):
    """From points to the nearest edge of a polygon."""
    best = np.full(len(points), np.inf)
    for a, b in zip(loop, np.roll(loop, -1, 0), strict=True):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.hypot(*(points - a - t[:, None] * (b - a)).T))
    return best


@given(st.lists(st.integers(9, 40), min_size=9, max_size=40), st.sampled_from([0.4, 1.5, 4.0]))
@settings(max_examples=60, deadline=None)
def test_simplified_chains_stay_near_and_do_not_touch_themselves(heights, tolerance):
    chain = crack_loop(heights)
    keep = simplified(chain * 1.0, tolerance, 7.0)
    assert keep == sorted(set(keep))
    assert distance(chain, chain[keep]).max() <= tolerance + 1e-9
    (loop,) = untangled([chain], [keep], np.ones(2))
    assert distance(chain, loop).max() <= tolerance + 1e-9
    assert not touching([loop]).any()
    for i in range(len(loop)):  # the same in the plain way
        for j in range(i + 2, len(loop) - (i == 0)):
            a, b, c, d = loop[i], loop[i - len(loop) + 1], loop[j], loop[j - len(loop) + 1]
            assert not meet(a, b, c, d)


def meet(a, b, c, d):
    u, v, w = b - a, d - c, c - a
    det = u[0] * v[1] - u[1] * v[0]
    if det == 0:
        return False
    s, t = (w[0] * v[1] - w[1] * v[0]) / det, (w[0] * u[1] - w[1] * u[0]) / det
    return 0 <= s <= 1 and 0 <= t <= 1


def test_straight_sides_are_divided_evenly():
    chain = np.array(
        [(x, 0) for x in range(30)] + [(30, y) for y in range(30)]
        + [(30 - x, 30) for x in range(30)] + [(0, 30 - y) for y in range(30)]
    )  # fmt: skip
    assert simplified(chain * 1.0, 0.5, 10.0) == list(range(0, 120, 10))


@pytest.mark.parametrize(
    ("loops", "expected"),
    [
        ([SQUARE], 0),
        ([SQUARE, SQUARE + 11], 0),
        (
            [SQUARE, SQUARE + np.array([10, 3])],
            4,
        ),  # sides lie on each other; their neighbours touch them
        ([SQUARE, np.array([(10, 5), (14, 3), (14, 7)])], 3),  # a corner on a side
        ([SQUARE[[0, 2, 1, 3]]], 2),  # an hourglass
        ([np.array([(0, 0), (8, 0), (4, 0), (4, 5)])], 3),  # folded back
    ],
)
def test_touching(loops, expected):
    assert touching(loops).sum() == expected


def test_crossings_are_repaired_by_points_of_the_chain():
    """A comb of which only some points are kept, so that the polygon tangles."""
    chain = crack_loop([20, 2] * 6)
    rng = np.random.default_rng(0)
    repaired = 0
    for _ in range(50):
        keep = sorted(rng.choice(len(chain), 8, replace=False).tolist())
        before = touching([chain[keep]]).any()
        loops = untangled([chain], [keep], np.ones(2))
        assert not touching(loops).any()
        repaired += before
    assert repaired > 5


def test_area_and_winding():
    assert area(SQUARE) == 100
    assert area(SQUARE[::-1]) == -100
    hole = SQUARE[::-1] // 2 + 2
    points = np.array([(1, 1), (4, 4), (12, 5), (-1, 10)])
    assert winding(points, [SQUARE, hole]).tolist() == [1, 0, 0, 0]
    assert winding(points, [SQUARE, hole[::-1]]).tolist() == [1, 2, 0, 0]
    assert winding(points + 0.5, []).tolist() == [0, 0, 0, 0]


def test_apart_measures_in_pixels():
    points = np.array([(5, 5), (5, 2), (2, 5), (13, 14)])
    # Steps of 2 x 1 px: 5 px from the near side, 2, 4 and then 6 and 4 from the corner.
    cases = (1.9, [1, 1, 1, 1]), (2, [1, 0, 1, 1]), (4.5, [1, 0, 0, 1]), (7.3, [0, 0, 0, 0])
    for limit, expected in cases:
        far = apart(points, [SQUARE], np.array([2.0, 1.0]), limit)
        assert far.tolist() == [bool(v) for v in expected]
