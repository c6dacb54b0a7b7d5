"""The whole renderer as ONNX makes the pictures that the decoder makes."""

import sys

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance import pixels
from conformance.cases import load
from conformance.make import builders
from proxyimg_codec.errors import UnsupportedError, UsageError
from proxyimg_codec.export import onnx_graph
from proxyimg_codec.export.onnx_renderer import BLOCK, build
from proxyimg_codec.render.view import make_view
from proxyimg_codec.texture.network import NetShape, Network
from tests.support.models import agrees, model_of, samples, view_of

CASES = [case for case in load() if not case.error]
"""All of them can be exported, and none takes long."""


def session(model):
    ort = pytest.importorskip("onnxruntime")
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3
    found = ort.InferenceSession(
        model.SerializeToString(), options, providers=["CPUExecutionProvider"]
    )
    return lambda inputs: found.run(["colour"], inputs)[0]


@pytest.fixture(scope="module")
def layered():
    return pxi.open(next(c.input for c in CASES if c.name == "layers"))


@pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)
def test_conformance(case):
    pytest.importorskip("onnx")
    image, made = pxi.open(case.input), {}
    for render in case.renders:
        args = render.args
        selected = args.get("time"), *args.get("layers", ["all"]), args.get("background")
        if selected not in made:
            made[selected] = session(model_of(image, args))
        view = view_of(image, args)
        agrees(made[selected](samples(view)), view, pixels.read(render.expected.read_bytes()))


def test_what_a_point_gets_does_not_depend_on_the_others(layered):
    pytest.importorskip("onnx")
    run = session(build(layered))
    inputs = samples(make_view((32, 24), width=96))
    points, size = inputs["points"], inputs["pixel_size"]
    assert len(points) > 5 * BLOCK
    assert len(points) % BLOCK
    whole = run(inputs)
    order = np.random.default_rng(0).permutation(len(points))
    for part in (order, slice(0, 1), slice(777, 777 + BLOCK), slice(1000, 3500)):
        got = run({"points": points[part], "pixel_size": size})
        np.testing.assert_allclose(got, whole[part], atol=1e-6)


def solid(value):
    """A network that gives the same grey everywhere."""
    weights = np.zeros((2, 2), np.int8), np.zeros((3, 2), np.int8)
    biases = np.array([0, 0, value, value, value], np.float16)
    return Network(NetShape(2, 0, 2, 1, 3), 8, weights, np.full(5, 2**-7, np.float16), biases)


@pytest.fixture(scope="module")
def ring():
    """A white ring on black, far from the origin of a large canvas."""
    numbers, side = builders.Numbers("ring"), 4096
    black, white = (builders.texture(numbers, dim=2, network=k) for k in (0, 1))
    paths = [
        builders.ellipse((4000.3, 3990.7), (6.2, 5.9)),
        builders.ellipse((4000.4, 3990.1), (3.1, 2.3), reverse=True),
    ]
    ring = builders.picture(
        (side, side),
        [
            builders.layer("back", (0, 0, side, side), black),
            builders.layer("ring", (3900, 3900, 196, 196), white, *paths),
        ],
        solid(0.0),
        solid(1.0),
    )
    return pxi.Image(ring)


@pytest.mark.parametrize("width", [31 * 14, 14, 5])
def test_precision_suffices_for_large_canvases(ring, width):
    pytest.importorskip("onnx")
    args = {"region": (3993, 3984, 14, 14), "width": width}
    view, expected = view_of(ring, args), ring.render(**args, dtype=np.float32)
    assert expected.max() > 0.9
    agrees(session(build(ring))(samples(view)), view, expected)


def test_positions_halfway_between_two_are_rounded_up():
    """Also where a call does not begin in the corner, so that doubles miss some of the ties."""
    pytest.importorskip("onnx")
    numbers, side, w = builders.Numbers("ties"), 12, 7 * 8
    black, white = (builders.texture(numbers, dim=2, network=k) for k in (0, 1))
    # Of a sample of 12/56 px, 3/512 px are 7 parts in 256: doubles cannot say how large it is.
    x = numbers.integers(0, 2047, (40,)) * 3 / 512 + 3 / 1024
    stairs = [point for k, v in enumerate(x) for point in ((v, 0.3 * k), (v, 0.3 * (k + 1)))]
    path = builders.polygon((0, 0), *stairs, (0, 12), unit=10)
    layers = [
        builders.layer("back", (0, 0, side, side), black),
        builders.layer("stairs", (0, 0, side, side), white, path, unit=10),
    ]
    image = pxi.Image(builders.picture((side, side), layers, solid(0.0), solid(1.0)))
    view, expected = make_view((side, side), width=w), image.render(width=w, dtype=np.float32)
    run, inputs = session(build(image)), samples(view)
    grid = inputs["points"].reshape(w, w, 2)
    columns = [run(inputs | {"points": np.ascontiguousarray(grid[:, k])}) for k in range(w)]
    agrees(np.stack(columns, 1), view, expected)


def test_points_between_those_of_a_grid(ring):
    """Where coverage alone counts, a sample is the mean of the small ones in its rectangle."""
    pytest.importorskip("onnx")
    run = session(build(ring))
    corner = np.array([3993.3, 3984.7])
    fine = np.stack(np.meshgrid(*[(np.arange(120) + 0.5) / 10] * 2), 2).reshape(-1, 2) + corner
    coarse = np.stack(np.meshgrid(np.arange(12), np.arange(12)), 2).reshape(-1, 2) + corner + 0.5
    got = run({"points": coarse, "pixel_size": np.ones(2)}).reshape(12, 12, 4)
    small = run({"points": fine, "pixel_size": np.full(2, 0.1)})
    expected = small.reshape(12, 10, 12, 10, 4).mean((1, 3))
    assert 0.2 < expected[..., 0].mean() < 0.8
    # One sample a pixel has coarser chords.
    assert np.abs(got - expected).max() < 0.06
    assert np.abs(got - expected).mean() < 0.01


def test_the_model_tells_what_it_takes(layered):
    onnx = pytest.importorskip("onnx")
    model = build(layered)
    onnx.checker.check_model(model, full_check=True)
    assert model.opset_import[0].version == 18
    assert not any(t.external_data for t in model.graph.initializer)
    described = {v.name: v.type.tensor_type for v in (*model.graph.input, *model.graph.output)}
    shapes = {n: [d.dim_param or d.dim_value for d in t.shape.dim] for n, t in described.items()}
    assert shapes == {"points": ["N", 2], "pixel_size": [2], "colour": ["N", 4]}
    kinds = {name: t.elem_type for name, t in described.items()}
    double, single = onnx.TensorProto.DOUBLE, onnx.TensorProto.FLOAT
    assert kinds == {"points": double, "pixel_size": double, "colour": single}
    for word in ("`points`", "`pixel_size`", "`colour`", "premultiplied", "32 by 24", "opaque"):
        assert word in model.doc_string
    assert {p.key: p.value for p in model.metadata_props} == {"width": "32", "height": "24"}
    assert "opaque" not in build(layered, background=False).doc_string


def test_equal_arrays_are_there_once(layered):
    pytest.importorskip("onnx")
    arrays = [(t.dims, t.data_type, t.raw_data) for t in build(layered).graph.initializer]
    assert len(arrays) == len({repr(a) for a in arrays})
    assert build(layered) == build(layered)


def test_what_cannot_be_exported(layered, monkeypatch):
    pytest.importorskip("onnx")
    with pytest.raises(UsageError, match="there is no layer 'cat'"):
        build(layered, ["cat"])
    monkeypatch.setattr(onnx_graph, "CONSTANTS_MAX", 100)
    with pytest.raises(UnsupportedError, match=r"larger than 2 GiB.*--layer"):
        build(layered)


def test_without_onnx(layered, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(UnsupportedError, match="pip install"):
        build(layered)
