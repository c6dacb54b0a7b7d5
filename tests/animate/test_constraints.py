import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.animate.constraints import Areas, Attachments, Distances, Shape, colours
from tests.support.bodies import areas, sheet

STEP = 1 / 96
STIFF = 1e6


def turned(points, degrees, by=(7.0, -3.0)):
    """Points [2, P] turned about their mean and moved."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    centre = points.mean(1, keepdims=True)
    return np.array([[c, -s], [s, c]]) @ (points - centre) + centre + np.array(by)[:, None]


def spin(at, move, mass):
    """Angular momentum about the origin of moves [2, P] of particles at positions [2, P]."""
    return (mass * (at[0] * move[1] - at[1] * move[0])).sum()


@pytest.fixture
def setting():
    """Nodes [2, P], masses [P] that differ, and one constraint of each kind over a sheet."""
    body = sheet()
    nodes = np.ascontiguousarray(body.nodes.T)
    mass = np.random.default_rng(2).uniform(0.5, 2, nodes.shape[1])
    w = 1 / mass
    edges = body.sides[0]
    length = np.hypot(*(nodes[:, edges[:, 0]] - nodes[:, edges[:, 1]]))
    faces = body.faces.astype(np.int64)
    onto, weights = body.holding(body.nodes[[40, 50]] + 3.0)
    members = np.concatenate([[[3], [5]], onto], axis=1)
    kinds = {
        "distances": Distances(edges, length, np.full(len(edges), STIFF), w, STEP),
        "areas": Areas(faces, 2 * body.areas, np.full(len(faces), STIFF), w, STEP, nodes),
        "shape": Shape(slice(0, len(mass)), nodes, w, mass, 2.0, False, STEP),
        "attachments": Attachments(members, weights, np.full(2, STIFF), w, STEP),
    }
    return nodes, mass, kinds


@given(st.integers(1, 4).flatmap(
    lambda k: st.lists(st.lists(st.integers(0, 20), min_size=k, max_size=k, unique=True))
))  # fmt: skip
@settings(max_examples=200, deadline=None)
def test_no_two_constraints_of_a_colour_share_a_particle(members):
    members = np.array(members, np.int64).reshape(len(members), -1 if members else 1)
    found = colours(members)
    for colour in np.unique(found):
        used = members[found == colour].ravel()
        assert len(np.unique(used)) == len(used)
    # Greedy in order: each lower colour is taken by an earlier constraint that shares a particle.
    for i, colour in enumerate(found):
        touching = (members[:i, :, None] == members[i]).any((1, 2))
        assert set(range(colour)) <= set(found[:i][touching])


def test_groups_hold_every_constraint_once(setting):
    kinds = setting[2]
    for kind, width in (("distances", 2), ("areas", 3)):
        seen = [g[0][:width, 0].T for g in kinds[kind].groups]
        for group in seen:
            assert len(np.unique(group)) == group.size
        wanted = sheet().sides[0] if width == 2 else sheet().faces
        every = np.concatenate(seen)
        assert len(every) == len(wanted)
        assert set(map(tuple, every.tolist())) == set(map(tuple, wanted.tolist()))


@pytest.mark.parametrize("kind", ["distances", "areas", "shape", "attachments"])
def test_momentum_stays(setting, kind):
    nodes, mass, kinds = setting
    x = nodes + np.random.default_rng(1).normal(0, 4, nodes.shape)
    before = x.copy()
    kinds[kind].project(x)
    moved = x - before
    assert np.abs(moved).max() > 0.1
    np.testing.assert_allclose((mass * moved).sum(1), 0, atol=1e-9)
    if kind == "shape":
        assert abs(spin(before, moved, mass)) < 1e-6


def test_one_spring_and_one_triangle_keep_their_spin():
    x = np.array([[0.0, 10.0, 3.0], [0.0, 1.0, 8.0]])
    mass = np.array([1.0, 2.0, 3.0])
    spring = Distances(np.array([[0, 1]]), np.array([5.0]), np.array([STIFF]), 1 / mass, STEP)
    face = np.array([[0, 1, 2]])
    triangle = Areas(face, np.array([20.0]), np.array([STIFF]), 1 / mass, STEP, x)
    for constraint in (spring, triangle):
        now = x.copy()
        constraint.project(now)
        assert np.abs(now - x).max() > 0.1
        assert abs(spin(x, now - x, mass)) < 1e-9


@pytest.mark.parametrize("degrees", [0, 30, 180, -90])
def test_rigid_motion_costs_nothing(setting, degrees):
    nodes, _, kinds = setting
    x = turned(nodes, degrees)
    for kind in ("distances", "areas", "shape"):
        now = x.copy()
        kinds[kind].project(now)
        np.testing.assert_allclose(now, x, atol=1e-9)
        assert kinds[kind].energy(x) < 1e-12
    bent = x.copy()
    bent[0] *= 1.1
    assert all(kinds[kind].energy(bent) > 1 for kind in ("distances", "areas", "shape"))


def test_an_upright_shape_resists_turning_but_not_moving(setting):
    nodes, mass, _ = setting
    shape = Shape(slice(0, len(mass)), nodes, 1 / mass, mass, 2.0, True, STEP)
    assert shape.energy(nodes + np.array([[50.0], [-20.0]])) < 1e-12
    assert shape.energy(turned(nodes, 20)) > 1


@pytest.mark.parametrize("kind", ["distances", "areas", "shape", "attachments"])
def test_forces_are_the_gradient_of_the_energy(setting, kind):
    """In the limit of small steps a constraint pushes by minus the gradient of its energy."""
    body, step = sheet(), 1e-6
    nodes, mass, _ = setting
    w = 1 / mass
    faces = body.faces[:1].astype(np.int64)
    pair = faces[:, :2]
    rest = np.hypot(*(nodes[:, pair[:, 0]] - nodes[:, pair[:, 1]]))
    members = np.concatenate([[[60]], faces], axis=1)
    made = {
        "distances": lambda: Distances(pair, rest, np.array([9.0]), w, step),
        "areas": lambda: Areas(faces, 2 * body.areas[:1], np.array([9.0]), w, step, nodes),
        "shape": lambda: Shape(slice(0, len(mass)), nodes, w, mass, 2.0, False, step),
        "attachments": lambda: Attachments(
            members, np.array([[0.2, 0.3, 0.5]]), np.array([9.0]), w, step
        ),
    }[kind]()
    x = nodes + np.random.default_rng(1).normal(0, 2, nodes.shape)
    now = x.copy()
    made.project(now)
    force = (now - x) * mass / step**2
    scale = np.abs(force).max()
    for p in (*faces[0].tolist(), 60):
        for axis in range(2):
            ahead, behind = x.copy(), x.copy()
            ahead[axis, p] += 1e-4
            behind[axis, p] -= 1e-4
            slope = (made.energy(ahead) - made.energy(behind)) / 2e-4
            assert abs(force[axis, p] + slope) < 1e-3 * scale


def test_iterating_meets_stiff_constraints(setting):
    nodes, _, kinds = setting
    x = nodes + np.random.default_rng(1).normal(0, 1.5, nodes.shape)
    body, before = sheet(), kinds["distances"].energy(x)
    for _ in range(300):
        kinds["distances"].project(x)
        kinds["areas"].project(x)
    assert kinds["distances"].energy(x) < 1e-5 * before
    np.testing.assert_allclose(areas(x.T, body.faces), body.areas, rtol=1e-3)


def test_pinned_particles_are_not_moved_at_all(setting):
    nodes, mass, _ = setting
    body = sheet()
    w = 1 / mass
    w[::3] = 0
    edges, faces = body.sides[0], body.faces.astype(np.int64)
    stiff = np.full(len(edges), STIFF)
    kinds = [
        Distances(edges, np.full(len(edges), 5.0), stiff, w, STEP),
        Areas(faces, 3 * body.areas, stiff[: len(faces)], w, STEP, nodes),
        Shape(slice(0, len(mass)), nodes, w, mass, 5.0, False, STEP),
    ]
    x = nodes + np.random.default_rng(1).normal(0, 3, nodes.shape)
    before = x.copy()
    for kind in kinds:
        kind.project(x)
    assert (x[:, ::3] == before[:, ::3]).all()
    assert (x[:, 1::3] != before[:, 1::3]).all()


def test_coinciding_particles_give_no_nan():
    x = np.zeros((2, 3))
    w = np.ones(3)
    Distances(np.array([[0, 1]]), np.array([4.0]), np.array([9.0]), w, STEP).project(x)
    face = np.array([[0, 1, 2]])
    Areas(face, np.array([4.0]), np.array([9.0]), w, STEP, x).project(x)
    Shape(slice(0, 3), np.eye(3)[:2], w, w, 1.0, False, STEP).project(x)
    assert np.isfinite(x).all()
