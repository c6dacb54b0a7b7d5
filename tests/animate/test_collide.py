import numpy as np
import pytest

from proxyimg_codec.animate.collide import Layers, Outline, Walls, inside
from tests.support.bodies import sheet


def outlines(*bodies):
    nodes = np.ascontiguousarray(np.concatenate([b.nodes for b in bodies]).T)
    parts, start = [], 0
    for body in bodies:
        part = slice(start, start + len(body.nodes))
        parts.append((part, body.rim + start))
        start = part.stop
    return nodes, [Outline(part, rim, nodes) for part, rim in parts]


def depth(x, made):
    """How far particles are inside the other of two layers, in pixels."""
    deepest = 0.0
    for body, other in (made, made[::-1]):
        points = x[:, other.part]
        points = points[:, inside(points, x[:, body.edges])].T[:, None]
        a, b = x[:, body.edges].transpose(2, 1, 0)
        t = np.clip(((points - a) * (b - a)).sum(2) / ((b - a) ** 2).sum(1), 0, 1)
        away = np.hypot(*np.moveaxis(points - a - t[..., None] * (b - a), 2, 0))
        deepest = max(deepest, away.min(1).max(initial=0))
    return deepest


def test_inside_agrees_with_the_rectangle():
    body = sheet(at=(20, 30))
    points = np.random.default_rng(0).uniform(0, 160, (2, 500))
    wanted = (points[0] > 20) & (points[0] < 140) & (points[1] > 30) & (points[1] < 120)
    found = inside(points, np.ascontiguousarray(body.nodes.T)[:, body.rim])
    np.testing.assert_array_equal(found, wanted)


def test_a_particle_in_another_layer_is_put_on_its_nearest_edge():
    nodes, made = outlines(sheet("a", at=(0, 0)), sheet("b", at=(130, 5)))
    w = np.ones(nodes.shape[1])
    w[made[0].part] = 0  # the first layer does not give way
    x = nodes.copy()
    x[0, made[1].part] -= 14  # its left side is now 4 px inside
    Layers(made[:1], w).project(x)
    side = x[:, made[1].part][:, nodes[0, made[1].part] == 130]
    assert side[0, side[1] < 85] == pytest.approx(120)
    assert (x[:, made[0].part] == nodes[:, made[0].part]).all()


def test_layers_that_push_each_other_keep_their_momentum():
    nodes, made = outlines(sheet("a", at=(0, 0)), sheet("b", at=(130, 5)))
    mass = np.random.default_rng(0).uniform(1, 3, nodes.shape[1])
    x = nodes.copy()
    x[0, made[1].part] -= 14
    before = x.copy()
    crowd = Layers(made, 1 / mass)
    crowd.project(x)
    np.testing.assert_allclose((mass * (x - before)).sum(1), 0, atol=1e-9)
    for _ in range(30):
        crowd.project(x)
    assert depth(before, made) > 3.9
    assert depth(x, made) < 0.1


def test_what_overlaps_at_rest_is_left_alone():
    nodes, made = outlines(sheet("a", at=(0, 0)), sheet("b", at=(65, 20)))
    x = nodes.copy()
    x[0, made[1].part] -= 1
    before = x.copy()
    Layers(made, np.ones(nodes.shape[1])).project(x)
    within = inside(nodes, nodes[:, made[0].edges])
    assert within[made[1].part].sum() > 5
    assert (x[:, within] == before[:, within])[:, : made[1].part.start].all()


def test_walls_hold_and_brake():
    walls = Walls(np.zeros((2, 2)), np.full((2, 2), 10.0))
    before = np.array([[5.0, 5.0], [9.0, 5.0]])
    x = np.array([[7.0, 7.0], [12.0, 6.0]])
    walls.project(x, before)
    np.testing.assert_allclose(x, [[6.0, 7.0], [10.0, 6.0]])
