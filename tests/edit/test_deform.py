import numpy as np
import pytest

from proxyimg_codec.edit import deform
from proxyimg_codec.edit.deform import drag
from proxyimg_codec.edit.solver import BlockTridiagonal
from proxyimg_codec.errors import LimitError, UsageError


def sheet(across, down, pitch=10.0, at=(0.0, 0.0), jitter=0.0):
    """A rectangle of equilateral rows, as nodes and triangles."""
    y, x = np.mgrid[: down + 1, : across + 1]
    nodes = np.stack([(x + y % 2 / 2) * pitch, y * pitch * np.sqrt(0.75)], 2).reshape(-1, 2)
    nodes += np.random.default_rng(0).uniform(-jitter, jitter, nodes.shape) * pitch
    a = (y * (across + 1) + x)[:-1, :-1].ravel()
    b, c, d = a + 1, a + across + 1, a + across + 2
    odd = (y % 2)[:-1, :-1].ravel()[:, None] == 1
    parts = [
        np.where(odd, np.stack([a, d, c], 1), np.stack([a, b, c], 1)),
        np.where(odd, np.stack([a, b, d], 1), np.stack([b, d, c], 1)),
    ]
    return nodes + at, np.concatenate(parts).astype(np.int32)


def beside(*meshes):
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(n) for n, _ in meshes])
    triangles = [t + s for (_, t), s in zip(meshes, starts, strict=False)]
    return np.concatenate([n for n, _ in meshes]), np.concatenate(triangles).astype(np.int32)


def where(nodes, triangles, points, moved):
    """Where points of the mesh `nodes` are in the mesh `moved`."""
    out = []
    for p in np.asarray(points, float):
        corners = np.concatenate([nodes[triangles], np.ones((len(triangles), 3, 1))], 2)
        solid = np.abs(np.linalg.det(corners)) > 1e-6
        w = np.linalg.solve(corners[solid].transpose(0, 2, 1), np.array([*p, 1.0])[:, None])[..., 0]
        k = w.min(1).argmax()
        out.append(w[k] @ moved[triangles[solid][k]])
    return np.array(out)


def growth(nodes, triangles, moved):
    """Area of each triangle relative to before; negative where it folded."""

    def area(p):
        u, v = p[triangles[:, 1]] - p[triangles[:, 0]], p[triangles[:, 2]] - p[triangles[:, 0]]
        return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]

    return area(moved) / area(nodes)


def turned(points, angle, centre):
    c, s = np.cos(angle), np.sin(angle)
    return (np.asarray(points) - centre) @ np.array([[c, s], [-s, c]]) + centre


BAR = sheet(20, 6, jitter=0.15)
ENDS = np.array([[12.0, 25.0], [13.0, 40.0], [190.0, 25.0], [191.0, 40.0]])


def test_one_handle_translates_whatever_rest_is():
    nodes, triangles = BAR
    for rest in (None, nodes * [1.5, 0.7]):
        moved = drag(nodes, triangles, ENDS[:1], np.add(ENDS[:1], [30, -7]), rest)
        np.testing.assert_allclose(moved, np.add(nodes, [30, -7]), atol=1e-9)


@pytest.mark.parametrize("angle", [0.3, np.pi / 2, np.pi, -2.5])
def test_rigid_targets_move_the_mesh_rigidly(angle):
    nodes, triangles = BAR
    centre = np.array([90.0, 200.0])
    moved = drag(nodes, triangles, ENDS[:3], turned(ENDS[:3], angle, centre))
    np.testing.assert_allclose(moved, turned(nodes, angle, centre), atol=1e-4)


def test_nothing_moves_where_nothing_is_dragged():
    nodes, triangles = BAR
    np.testing.assert_allclose(drag(nodes, triangles, ENDS, ENDS), nodes, atol=1e-9)
    none = np.empty((0, 2))
    copy = drag(nodes, triangles, none, none)
    assert (copy == nodes).all()
    assert not np.shares_memory(copy, nodes)


@pytest.mark.parametrize("seed", range(8))
def test_handles_arrive(seed):
    nodes, triangles = BAR
    rng = np.random.default_rng(seed)
    points = nodes[triangles[rng.choice(len(triangles), 5, replace=False)]].mean(1)
    targets = points + rng.normal(scale=12, size=(5, 2))
    moved = drag(nodes, triangles, points, targets)
    np.testing.assert_allclose(where(nodes, triangles, points, moved), targets, atol=1e-6)


def test_result_is_as_rigid_as_possible():
    """Any small change that keeps the handles raises the energy, computed here another way."""
    nodes, triangles = sheet(16, 5)
    points = nodes[triangles[[3, 40, 150]]].mean(1)
    targets = np.add(points, [[0, 0], [4, 10], [-5, 0]])

    def energy(p):
        edges = [v[triangles[:, 1:]] - v[triangles[:, :1]] for v in (nodes, p)]
        stretch = np.linalg.svd(np.linalg.inv(edges[0]) @ edges[1], compute_uv=False)
        return (np.linalg.det(edges[0]) * ((stretch - 1) ** 2).sum(1)).sum()

    moved = drag(nodes, triangles, points, targets)
    least = energy(moved)
    assert least > 100
    assert growth(nodes, triangles, moved).min() > 0.3  # so nothing was made stiffer
    rng = np.random.default_rng(0)
    fixed = np.zeros(len(nodes), bool)
    fixed[triangles[[3, 40, 150]]] = True
    for _ in range(20):
        change = rng.normal(size=nodes.shape)
        for _ in range(5):  # smooth changes are the ones that might pay
            mean = change[triangles].mean(1)
            change[triangles[:, 0]] = change[triangles[:, 1]] = mean
        change[fixed] = 0
        change *= 0.2 / np.abs(change).max()
        assert energy(moved + change) > least
        assert energy(moved - change) > least


def test_two_handles_stretch_evenly_between():
    nodes, triangles = sheet(20, 6)
    points = np.array([[10.0, 26.0], [190.0, 26.0]])
    moved = drag(nodes, triangles, points, np.add(points, [[-30, 0], [30, 0]]))
    middle = where(nodes, triangles, [[55, 26], [100, 26], [145, 26]], moved)[:, 0]
    np.testing.assert_allclose(middle, [55 - 15, 100, 145 + 15], atol=3)


def test_pins_hold_their_surroundings():
    nodes, triangles = BAR
    moved = drag(nodes, triangles, ENDS, np.add(ENDS, [[0, 0], [0, 0], [0, 40], [0, 40]]))
    shift = np.linalg.norm(moved - nodes, axis=1)
    assert shift[nodes[:, 0] < 20].max() < 10
    assert shift[nodes[:, 0] > 180].min() > 30


def test_bend_by_ninety_degrees_turns_the_end_and_folds_nothing():
    nodes, triangles = BAR
    targets = ENDS.copy()
    targets[2:] = turned(ENDS[2:], np.pi / 2, [100, 30])
    moved = drag(nodes, triangles, ENDS, targets)
    end = nodes[:, 0] > 180
    np.testing.assert_allclose(moved[end], turned(nodes[end], np.pi / 2, [100, 30]), atol=8)
    assert growth(nodes, triangles, moved).min() > 0


def test_stiffening_removes_folds(monkeypatch):
    nodes, triangles = sheet(20, 12, jitter=0.2)
    points = np.array([[20.0, 20.0], [180.0, 20.0], [100.0, 90.0], [100.0, 10.0]])
    targets = np.add(points, [[0, 0], [0, 0], [0, 0], [25, 60]])
    moved = drag(nodes, triangles, points, targets)
    assert growth(nodes, triangles, moved).min() > 0
    np.testing.assert_allclose(where(nodes, triangles, points, moved), targets, atol=1e-6)
    monkeypatch.setattr(deform, "ROUNDS", 0)
    assert growth(nodes, triangles, drag(nodes, triangles, points, targets)).min() < 0


def test_dragging_back_with_the_same_rest_restores_the_shape():
    nodes, triangles = BAR
    targets = np.add(ENDS, [[0, 0], [0, 0], [-20, 60], [-40, 70]])
    there = drag(nodes, triangles, ENDS, targets, nodes)
    back = drag(there, triangles, targets, ENDS, nodes)
    np.testing.assert_allclose(back, nodes, atol=0.02)


def test_order_and_orientation_do_not_matter():
    nodes, triangles = BAR
    targets = np.add(ENDS, [[0, 0], [3, 0], [-20, 30], [-10, 20]])
    moved = drag(nodes, triangles, ENDS, targets)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(nodes))
    place = np.argsort(order)
    mixed = place[rng.permutation(triangles)].astype(np.int32)
    mixed[::2] = mixed[::2, ::-1]
    np.testing.assert_allclose(drag(nodes[order], mixed, ENDS, targets), moved[order], atol=1e-3)


LEFT, RIGHT = sheet(8, 6), sheet(8, 6, at=(150.0, 0.0))


def test_component_without_handle_follows_rigidly():
    nodes, triangles = beside(LEFT, RIGHT)
    n = len(LEFT[0])
    points = np.array([[20.0, 20.0], [60.0, 20.0], [40.0, 45.0]])
    moved = drag(nodes, triangles, points, np.add(points, [5, 9]))
    np.testing.assert_allclose(moved, np.add(nodes, [5, 9]), atol=1e-6)
    moved = drag(nodes, triangles, points, turned(points, 0.7, [40, 30]))
    np.testing.assert_allclose(moved[n:], turned(nodes[n:], 0.7, [40, 30]), atol=1e-3)
    moved = drag(nodes, triangles, points, np.add(points, [[-20, 0], [20, 0], [0, 0]]))
    lengths = [np.linalg.norm(p[n + 1 :] - p[n], axis=1) for p in (nodes, moved)]
    np.testing.assert_allclose(lengths[1], lengths[0], atol=1e-9)


def test_component_without_handle_follows_its_neighbour():
    nodes, triangles = beside(LEFT, sheet(8, 6, at=(600.0, 0.0)), RIGHT)
    points = np.array([[40.0, 20.0], [640.0, 20.0]])
    moved = drag(nodes, triangles, points, np.add(points, [[0, 30], [0, 0]]))
    follower = (moved - nodes)[-len(RIGHT[0]) :].mean(0)
    assert 20 < follower[1] < 31


def test_components_with_a_handle_each_move_apart():
    nodes, triangles = beside(LEFT, RIGHT)
    points = np.array([[40.0, 20.0], [190.0, 20.0]])
    moved = drag(nodes, triangles, points, np.add(points, [[0, 30], [-5, 0]]))
    n = len(LEFT[0])
    np.testing.assert_allclose(moved[:n], np.add(nodes[:n], [0, 30]), atol=1e-9)
    np.testing.assert_allclose(moved[n:], np.add(nodes[n:], [-5, 0]), atol=1e-9)


def test_bad_meshes_stay_finite_and_near():
    """A sliver, zero areas of every kind, a fold, two isolated nodes: all at once."""
    nodes, triangles = BAR
    n = len(nodes)
    nodes = np.concatenate([nodes, [[105, 30], [105, 30], [50, 50], [230, 30], [-20, -20]]])
    nodes[100] = np.add(nodes[121], [0.3, 1e-4])
    nodes[44] = np.add(nodes[88], [0, 2])
    extra = [[3, 3, 3], [7, 7, 8], [n, n + 1, 60], [n, n + 1, 61], [0, 1, 2], [60, n + 2, n + 2]]
    triangles = np.concatenate([triangles, extra]).astype(np.int32)
    targets = np.add(ENDS, [[0, 0], [0, 0], [-30, 40], [-40, 50]])
    moved = drag(nodes, triangles, ENDS, targets)
    assert np.isfinite(moved).all()
    assert np.linalg.norm(moved - nodes, axis=1).max() < 120
    np.testing.assert_allclose(where(nodes, triangles, ENDS, moved), targets, atol=1e-6)
    # The isolated node before the dragged end goes with it; the one at the pins stays.
    assert np.linalg.norm(moved[n + 3] - nodes[n + 3]) > 40
    assert np.linalg.norm(moved[n + 4] - nodes[n + 4]) < 10


def test_mesh_of_zero_area_alone():
    nodes = np.array([[0.0, 0], [10, 0], [20, 0], [20, 0]])
    triangles = np.array([[0, 1, 2], [1, 2, 3], [3, 3, 3]], np.int32)
    points = np.array([[0.0, 0], [20, 0]])
    moved = drag(nodes, triangles, points, turned(points, 1.0, [0, 0]))
    np.testing.assert_allclose(moved, turned(nodes, 1.0, [0, 0]), atol=1e-6)


def test_contradiction_is_shared():
    nodes, triangles = BAR
    points = ENDS[[0, 0, 2]]
    moved = drag(nodes, triangles, points, np.add(points, [[0, 10], [0, -10], [0, 0]]))
    np.testing.assert_allclose(where(nodes, triangles, points, moved), points, atol=1e-6)


def test_point_outside_holds_the_nearest_at_its_offset():
    nodes, triangles = sheet(20, 6)
    pin, edge = [100.0, 40.0], [100.0, 0.0]
    outside = drag(nodes, triangles, np.array([pin, [100, -6]]), np.array([pin, [110, -26]]))
    at_edge = drag(nodes, triangles, np.array([pin, edge]), np.array([pin, [110, -20]]))
    np.testing.assert_allclose(outside, at_edge, atol=1e-9)


@pytest.mark.parametrize(("across", "down"), [(1, 1), (40, 1), (9, 14)])
def test_block_solver_agrees_with_the_dense_one(across, down):
    nodes, triangles = sheet(across, down)
    triangles = triangles.astype(np.int64)
    half = np.random.default_rng(0).normal(size=(len(triangles) + 2, 3, 4))
    elements = half @ half.transpose(0, 2, 1)
    corners = np.concatenate([triangles, triangles[:2]])
    dense = np.zeros((len(nodes), len(nodes)))
    np.add.at(dense, (corners[:, :, None], corners[:, None, :]), elements)
    right = np.random.default_rng(1).normal(size=(len(nodes), 3))
    solver = BlockTridiagonal(len(nodes), triangles, triangles[:2])
    solver.factor(elements)
    np.testing.assert_allclose(solver.solve(right), np.linalg.solve(dense, right), atol=1e-8)


def test_six_thousand_nodes_in_narrow_blocks():
    nodes, triangles = sheet(80, 74)
    points = nodes[triangles[[0, 5000, 11000]]].mean(1)
    targets = np.add(points, [[0, 0], [20, -15], [0, 0]])
    moved = drag(nodes, triangles, points, targets)
    np.testing.assert_allclose(where(nodes, triangles, points, moved), targets, atol=1e-6)
    solver = BlockTridiagonal(len(nodes), triangles.astype(np.int64))
    assert solver.size.max() < 3 * np.sqrt(len(nodes))


def test_huge_fan_is_refused():
    angle = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    rim = 100 * np.stack([np.cos(angle), np.sin(angle)], 1)
    k = np.arange(3000)
    triangles = np.stack([0 * k, 1 + k, 1 + (k + 1) % 3000], 1).astype(np.int32)
    points = np.array([[50.0, 1.0], [-50.0, 1.0]])
    with pytest.raises(LimitError, match="too wide"):
        drag(np.concatenate([[[0.0, 0.0]], rim]), triangles, points, points)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": np.zeros((4, 3))}, "nodes: shape"),
        ({"points": np.zeros(2)}, "points: shape"),
        ({"targets": np.array([[np.nan, 0]])}, "targets: not all"),
        ({"targets": np.zeros((2, 2))}, "1 points but 2 targets"),
        ({"rest": np.zeros((3, 2))}, "3 in rest"),
        ({"triangles": np.zeros((1, 4), np.int32)}, "triangles: shape"),
        ({"triangles": np.zeros((0, 3), np.int32)}, "no triangles"),
        ({"triangles": np.array([[0, 1, 4]], np.int32)}, "outside 0 .. 3"),
        ({"triangles": np.array([[0, 1, -1]], np.int32)}, "outside 0 .. 3"),
    ],
)
def test_bad_arguments_are_named(change, message):
    good = {
        "nodes": np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]]),
        "triangles": np.array([[0, 1, 2], [1, 3, 2]], np.int32),
        "points": np.array([[2.0, 2]]),
        "targets": np.array([[3.0, 3]]),
    }
    with pytest.raises(UsageError, match=message):
        drag(**(good | change))


def test_distances_from_a_mesh():
    nodes, triangles = sheet(4, 3)
    inside, corner = nodes[triangles].mean(1), nodes.min(0)
    np.testing.assert_allclose(deform.distances(nodes, triangles, inside), 0, atol=1e-9)
    points = corner + np.array([[-3, -4], [20, -7], [1, 1]])
    found = deform.distances(nodes, triangles, points)
    np.testing.assert_allclose(found, [5, 7, 0], atol=1e-9)
