import copy

import numpy as np
import pytest
import torch

import proxyimg_codec as pxi
from proxyimg_codec.cli.encode import arguments, settings_from
from proxyimg_codec.encoder.encode import assemble
from proxyimg_codec.encoder.implicit import fit, fit_node, node_problem
from proxyimg_codec.encoder.implicit.fit_problem import build
from proxyimg_codec.encoder.implicit.node_problem import NodeOptions
from proxyimg_codec.encoder.implicit.rounding import Choice
from proxyimg_codec.encoder.implicit.state import State, quantize, rows_of
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.layers import LayerPlan, Plan
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.encoder.shapes.meshes import with_meshes
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.mesh import FRACTION_BITS
from proxyimg_codec.render.quality import psnr
from proxyimg_codec.texture import node_sampling as decoder
from proxyimg_codec.texture.network import NetShape
from tests.support.meshes import square
from tests.support.pictures import disc, smooth

WIDTH, HEIGHT = 48, 40


def case(options=None, front=True, size=(WIDTH, HEIGHT)):
    """A node problem of a back layer and a square in front, and its layers."""
    picture = np.ones((size[1], size[0], 4), np.float32)
    picture[..., :3] = smooth(*size) / np.float32(255)
    outlines = [None, square(9, 6, 38, 31)][: 1 + front]
    plan = Plan(tuple(LayerPlan(str(k), b) for k, b in enumerate(outlines)), 3, True)
    layers = with_meshes(picture, plan, Settings(sampling="node")).layers
    problem = build(picture, outlines, NetShape(1, 0, 1, 1, 3), np.inf)
    return node_problem.build(problem, layers, size, options or NodeOptions()), layers


def test_parameters_are_those_of_the_paper():
    """55,747 in the network; with 263 codes of 16 features the 59,955 of the paper's table."""
    shape = NodeOptions().network(3)
    assert shape.layers == [(672, 64), (64, 64), (64, 64), (64, 64), (64, 3)]
    assert shape.parameters == 55747
    assert shape.parameters + 263 * node_problem.DIM == 59955


def test_a_code_a_cell_and_few_for_what_lies_behind():
    p, _ = case()
    assert [(v.columns, v.rows) for v in p.planes] == [(8, 8), (4, 3)]
    alone, _ = case(front=False)
    assert [(v.columns, v.rows) for v in alone.planes] == [(6, 5)]
    dense = node_problem.options_for(Settings(quality=100, sampling="node"))
    assert dense.cell == pytest.approx(8 * (2.75 / 14) ** 0.5)
    assert dense.back_grid == 18
    assert node_problem.options_for(Settings(sampling="node")) == NodeOptions(
        cell=pytest.approx(8.0)
    )


@pytest.mark.parametrize(
    "options", [NodeOptions(), NodeOptions(edge=False), NodeOptions(local="none")]
)
def test_training_and_decoding_see_the_same_features(options):
    p, layers = case(options)
    state = fit_node.initial(p, 0)
    state.codes *= 20
    fit.choose_steps(p, state, 6, 8)
    settings = Settings(sampling="node", feature_bits=6)
    _, textures = assemble(p, state, p.stored(), settings)
    trainer = fit_node.NodeTrainer(p, "cpu")
    plane = np.repeat([0, 1], [v.size for v in p.planes])
    steps = state.code_steps[plane]
    codes = torch.from_numpy(quantize(state.codes, steps, 6) * steps)
    for k, layer in enumerate(layers):
        at = np.flatnonzero(p.layer == k)
        got = trainer.features(codes, torch.from_numpy(at)).numpy()
        nodes = layer.mesh.refined.nodes / (1 << FRACTION_BITS)
        place = p.place[at].astype(float)
        face, weights = holding(nodes[layer.mesh.refined.faces], place)
        want = decoder.features(
            textures[k], p.planes[k].box, p.sampling, nodes, layer.mesh.refined.faces,
            decoder.anchors(layer.boundary, (WIDTH, HEIGHT)), face, weights, place,
        )  # fmt: skip
        np.testing.assert_allclose(got, want, atol=2e-5 * np.abs(want).max())


def holding(corners, points):
    """The triangle [n] that holds each point, and its weights [n, 3], by solving for them."""
    systems = np.concatenate([corners, np.ones_like(corners[..., :1])], axis=2).transpose(0, 2, 1)
    ones = np.column_stack([points, np.ones(len(points))])
    weights = np.linalg.solve(systems[None], ones[:, None, :, None])[..., 0]
    face = weights.min(2).argmax(1)
    return face, weights[np.arange(len(points)), face]


def test_only_codes_that_are_looked_at_are_stored():
    p, _ = case(NodeOptions(local="none"))
    assert p.corners.shape[1] == 0
    touched = p.stored()[0]
    assert touched.sum() == 16  # two by two about the middle of each side
    assert not touched[2:6, 2:6].any()


def test_distance_replaces_barycentric_weights():
    p, layers = case(NodeOptions(edge=False, distance=True), front=False)
    nodes = layers[0].mesh.refined.nodes / (1 << FRACTION_BITS)
    place = p.place[::7].astype(float)
    face, weights = holding(nodes[layers[0].mesh.refined.faces], place)
    inside = weights.min(1) > 1e-6  # on an edge either face is right
    away = ((nodes[layers[0].mesh.refined.faces[face]] - place[:, None]) ** 2).sum(2)
    want = 1 / away / (1 / away).sum(1, keepdims=True)
    np.testing.assert_allclose(p.weights[::7][inside], want[inside], atol=1e-4)
    assert inside.mean() > 0.9


def test_single_uses_the_triangles_of_the_base():
    many, layers = case(NodeOptions(edge=False), front=False)
    few, _ = case(NodeOptions(edge=False, local="single"), front=False)
    assert len(few.base) <= len(layers[0].mesh.base.vertices) < len(many.base)


def test_own_codes_are_those_of_the_nodes():
    p, _ = case(NodeOptions(edge=False, own_codes=True), front=False)
    codes = torch.zeros((p.codes, node_problem.DIM))
    first = p.codes - p.own
    codes[first + 3] = 5.0
    got = fit_node.NodeTrainer(p, "cpu").features(codes, torch.arange(len(p.layer))).numpy()
    want = 5 * (p.weights * (p.corners == 3)).sum(1)
    np.testing.assert_allclose(got, np.repeat(want[:, None], node_problem.DIM, 1), atol=1e-5)
    assert want.max() > 2


def test_choices_are_between_neighbours():
    values = torch.linspace(-1.2, 1.2, 49)[None]
    choice = Choice(values, torch.tensor([[0.125]]), 4)
    np.testing.assert_allclose(choice.soft().detach(), values.clamp(-1, 0.875), atol=2e-3)
    with torch.no_grad():
        choice.logit[:] = -choice.logit  # the other neighbour
    inside = ((values > -1) & (values < 0.875))[0]
    levels = choice.hard()[0] / 0.125
    assert (levels == levels.round()).all()
    assert levels.min() >= -8
    assert levels.max() <= 7
    off = (levels - values[0] / 0.125).abs()[inside]
    assert off.max() <= 1
    assert off.mean() > 0.6


def error_of(p, state):
    """Mean squared error of all pixels."""
    still = State(state.codes, state.weights, state.code_steps, state.row_steps)
    pixels = np.arange(p.pixels, dtype=np.int32)[None]
    none = np.zeros(1, np.float32)
    return fit_node.NodeTrainer(p, "cpu").run(still, pixels, none, none)


def nearest(p, state, bits):
    """A state with codes and weights rounded to the nearest multiple of their step."""
    out = copy.deepcopy(state)
    fit.choose_steps(p, out, bits, bits)
    steps = out.code_steps[np.repeat([0, 1], [v.size for v in p.planes])]
    out.codes[:] = quantize(out.codes, steps, bits) * steps
    ends = np.cumsum([o for _, o in p.shape.layers])[:-1]
    rows = rows_of(p.shape, out.weights)
    for (w, _), s in zip(rows, np.split(out.row_steps, ends), strict=True):
        w[:] = quantize(w, s[:, None], bits) * s[:, None]
    return out


def test_reconstruction_beats_rounding_to_the_nearest():
    p, _ = case(NodeOptions(octaves=4))
    state = fit_node.fit_float(p, fit_node.NodeTrainer(p, "cpu"), 100, 0)
    exact, near = error_of(p, state), nearest(p, state, 4)
    fit_node.quantize(p, fit_node.NodeTrainer(p, "cpu"), state, (4, 4), 150, 0)
    plane = np.repeat([0, 1], [v.size for v in p.planes])
    levels = state.codes / state.code_steps[plane]
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-4)
    assert levels.min() > -8.5
    assert levels.max() < 7.5
    assert error_of(p, state) - exact < 0.5 * (error_of(p, near) - exact)


def test_a_file_of_the_paper_method(photo, small_masks):
    options = {"sampling": "node", "feature_bits": 4, "net_bits": 4, "effort": 1}
    region = Region("disc", disc(WIDTH, HEIGHT))
    a, b = (pxi.encode(photo, masks=[region], jobs=jobs, **options) for jobs in (1, 2))
    data = a.to_bytes()
    assert data == b.to_bytes()
    again = pxi.from_bytes(data)
    assert [v.sampling for v in again.layers] == [decoder.BOTH] * 2
    assert [v.texture.bits for v in again.layers] == [4, 4]
    assert again.networks[0].shape == NodeOptions().network(3)
    assert (again.render() == a.render()).all()
    assert psnr(photo, again) > 24


def test_one_layer_and_one_colour(photo):
    alone = pxi.encode(photo, sampling="node", max_layers=1, effort=1)
    assert alone.layers[0].mesh is not None
    assert psnr(photo, alone) > 24
    plain = pxi.encode(np.full((9, 7, 3), 50, np.uint8), sampling="node", effort=1)
    assert (plain.render() == 50).all()


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ((), ("node", "chamfer", 4, 4, None)),
        (("-e", "2", "--net-bits", "8", "--boundary", "lsq"), ("node", "lsq", 4, 8, 2)),
        (("--feature-bits", "6", "-q", "90"), ("node", "chamfer", 6, 4, None)),
    ],
)
def test_preset_paper_and_flags_that_go_before_it(flags, expected):
    s = settings_from(arguments().parse_args(["a.png", "--preset", "paper", *flags]))
    assert (s.sampling, s.boundary, s.bits, s.net_bits, s.effort) == expected


@pytest.mark.parametrize(
    "wrong", [{"mesh": "none"}, {"background": "complete"}, {"sampling": "nodes"}]
)
def test_settings_that_contradict_each_other(wrong):
    with pytest.raises(UsageError, match="sampling"):
        Settings(**{"sampling": "node", **wrong})


def test_options_that_leave_no_feature():
    with pytest.raises(UsageError, match="local"):
        NodeOptions(edge=False, local="none")
    with pytest.raises(UsageError, match="local"):
        NodeOptions(local="double")
