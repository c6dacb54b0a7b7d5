import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.geometry.delaunay import triangulate

NONE = np.zeros((0, 2), np.int64)


def turn(a, b, c):
    """(b - a) x (c - a) in Python integers."""
    return int((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def between(a, b, p):
    """Whether p lies on the segment from a to b, but not at its ends."""
    return turn(a, b, p) == 0 and int((p - a) @ (p - b)) < 0


def crossing(a, b, c, d):
    """Whether two segments cross at a point inside both."""
    return turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0


def in_circle(a, b, c, d):
    """> 0 if d lies inside the circle through the positive triangle a, b, c."""
    (ax, ay), (bx, by), (cx, cy) = ((int(v) for v in p - d) for p in (a, b, c))
    return (
        (ax * ax + ay * ay) * (bx * cy - by * cx)
        - (bx * bx + by * by) * (ax * cy - ay * cx)
        + (cx * cx + cy * cy) * (ax * by - ay * bx)
    )


def hull_area2(points):
    """Twice the area of the convex hull (monotone chain)."""
    hulls = []
    for order in (sorted(map(tuple, points.tolist())), sorted(map(tuple, (-points).tolist()))):
        chain = []
        for p in order:
            while len(chain) > 1 and turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        hulls.append(np.array(chain))
    ring = np.concatenate([hulls[0][:-1], -hulls[1][:-1]])
    after = np.roll(ring, -1, 0)
    return int((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum())


@st.composite
def inputs(draw):
    """Distinct points, often on lines and circles, and segments that do not cross."""
    side = draw(st.sampled_from([2, 5, 12, 256]))
    count = draw(st.integers(3, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = rng.permutation(np.unique(rng.integers(0, side, (count, 2)), axis=0))
    chosen = []
    for a, b in rng.integers(0, len(points), (draw(st.integers(0, 30)), 2)):
        ends = points[a], points[b]
        if a != b and not any(crossing(*ends, *points[[c, d]]) for c, d in chosen):
            chosen.append((a, b))
    return points, np.array(chosen, np.int64).reshape(-1, 2)


@given(inputs())
@settings(max_examples=150, deadline=None)
def test_the_hull_is_covered_once_and_constraints_are_kept(case):
    points, constraints = case
    triangles = triangulate(points, constraints)
    areas = [turn(*points[t]) for t in triangles]
    assert all(v > 0 for v in areas)
    assert sum(areas) == hull_area2(points)
    if not len(triangles):
        return
    assert set(triangles.ravel().tolist()) == set(range(len(points)))
    apex = {}
    for a, b, c in triangles.tolist():
        for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
            assert (x, y) not in apex
            apex[x, y] = z
    fixed = set()
    for a, b in constraints.tolist():
        on = [k for k in range(len(points)) if between(points[a], points[b], points[k])]
        on.sort(key=lambda k: int(((points[k] - points[a]) ** 2).sum()))
        for pair in zip([a, *on], [*on, b], strict=True):
            assert pair in apex or pair[::-1] in apex
            fixed |= {pair, pair[::-1]}
    for (a, b), c in apex.items():
        d = apex.get((b, a))
        if d is not None and (a, b) not in fixed:
            assert in_circle(points[a], points[b], points[c], points[d]) <= 0


@given(inputs())
@settings(max_examples=60, deadline=None)
def test_circles_are_empty_and_the_order_of_points_does_not_matter(case):
    points, _ = case
    triangles = triangulate(points, NONE)
    assert all(in_circle(*points[t], p) <= 0 for t in triangles for p in points)
    order = np.random.default_rng(0).permutation(len(points))
    again = triangulate(points[order], NONE)
    number = np.argsort(order)
    assert same(number[triangles]) == same(again)


def same(triangles):
    """What triangles are, however each is turned."""
    turned = [t[t.index(min(t)) :] + t[: t.index(min(t))] for t in triangles.tolist()]
    return sorted(turned)


def test_constraints_far_across_a_grid_with_all_points_on_circles():
    points = np.stack(np.mgrid[:20, :20], -1).reshape(-1, 2).astype(np.int64)
    # The first goes through all points of the diagonal, the others closely miss all points.
    constraints = np.array([(0, 399), (1, 359), (20, 397)])
    edges = set()
    for t in triangulate(points, constraints):
        edges |= {frozenset(e) for e in zip(t.tolist(), np.roll(t, 1).tolist(), strict=True)}
    assert {frozenset((21 * k, 21 * k + 21)) for k in range(19)} <= edges
    assert frozenset((1, 359)) in edges
    assert frozenset((20, 397)) in edges


def test_numbers_may_be_large():
    points = np.array([(0, 0), (1, 0), (0, 1), (1, 1)]) * (1 << 40) + [
        (0, 0),
        (0, 0),
        (0, 0),
        (1, 1),
    ]
    assert same(triangulate(points, NONE)) == [[0, 1, 2], [1, 3, 2]]


def test_points_on_a_line_have_no_triangles():
    assert triangulate(np.array([(0, 0), (2, 4), (1, 2)]), np.array([(0, 1)])).shape == (0, 3)


@pytest.mark.parametrize(
    ("points", "constraints", "message"),
    [
        ([(0, 0), (4, 0), (0, 4), (4, 0)], [], "coincide"),
        ([(0, 0), (4, 0), (0, 4), (4, 5)], [(0, 3), (1, 2)], "crosses"),
        ([(0, 0), (4, 0), (0, 4)], [(1, 1)], "no length"),
    ],
)
def test_impossible_input_is_refused(points, constraints, message):
    with pytest.raises(ValueError, match=message):
        triangulate(np.array(points), np.array(constraints, np.int64).reshape(-1, 2))
