"""The synthesis as ONNX gives the samples that the decoder gives."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.errors import UnsupportedError
from proxyimg_codec.export.onnx_synthesis import build, feed
from proxyimg_codec.model import Layers
from proxyimg_codec.texture.grid import Grid
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.planes import Planes, encoded
from tests.support.images import changed
from tests.support.pyramids import implicit, picture

SIZE = 64, 48


def made(size=SIZE, levels=3, components=3, step=256, seed=0, model=2):
    """Planes of random latents: a raster of all of 0..1, clipped in places."""
    rng = np.random.default_rng(seed)
    grid = Grid(size, levels, model == 1)
    unit = 2 ** (step / 64)

    def channels(count, coded, level, spread):
        shape = count, *grid.at(level)
        y = np.rint(rng.laplace(0, spread / unit, shape)).astype(np.int32)
        y[coded:] = 0
        return y

    found = [
        channels(9, 3 * components, k, (20, 12, 6)[min(k, 3) - 1]) for k in range(1, levels + 1)
    ]
    lowest = channels(3, components, levels, (60 if components == 1 else 30) * 2**levels)
    return encoded(Latents(tuple(found), lowest), size, step, components=components, number=model)


def run(model, inputs):
    ort = pytest.importorskip("onnxruntime")
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    session = ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return session.run(["samples"], inputs)[0]


def agrees(planes, model):
    got = run(model, feed(planes.latents))
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, planes.raster[None], atol=1e-4)


@pytest.mark.parametrize(
    "case",
    [
        {},
        {"components": 1},
        {"size": (37, 21)},
        {"size": (41, 19), "components": 1, "step": 200},
        {"size": (1, 1), "levels": 1},
        {"size": (3, 70), "levels": 6},  # levels beyond the last set of networks, of one column
        {"size": (50, 9), "step": 0},
        {"size": (33, 47), "step": 420, "levels": 5},
        {"size": (37, 21), "model": 1},
    ],
    ids=str,
)
def test_samples_are_those_of_the_raster(case):
    pytest.importorskip("onnx")
    planes = made(**case)
    if "size" not in case:
        assert planes.raster.std() > 0.1
        assert 0 < (planes.raster == 0).mean() < 0.5
        assert 0 < (planes.raster == 1).mean() < 0.5
    agrees(planes, build(planes).SerializeToString())


def test_the_model_tells_what_it_takes():
    onnx = pytest.importorskip("onnx")
    model = build(made((37, 21), levels=3))
    onnx.checker.check_model(model, full_check=True)
    assert model.opset_import[0].version == 18
    assert model.producer_name == "proxyimg-codec"
    assert not any(t.external_data for t in model.graph.initializer)

    def shapes(values):
        dims = {v.name: v.type.tensor_type.shape.dim for v in values}
        return {name: [d.dim_value for d in dim] for name, dim in dims.items()}

    assert shapes(model.graph.input) == {
        "lowest": [1, 3, 3, 5],
        "level_3": [1, 9, 3, 5],
        "level_2": [1, 9, 6, 10],
        "level_1": [1, 9, 11, 19],
    }
    assert shapes(model.graph.output) == {"samples": [1, 21, 37, 3]}
    assert shapes(build(made(components=1)).graph.output) == {"samples": [1, 48, 64, 1]}
    for name in ("lowest", "level_k", "samples", "0..1"):
        assert name in model.graph.doc_string


def test_only_size_and_step_count():
    """The latents are not inside, and sets of weights are there once."""
    pytest.importorskip("onnx")
    one, other = (build(made(seed=seed)) for seed in (1, 2))
    assert one == other
    assert build(made(step=300)) != one
    deep = build(made((64, 64), levels=6)).SerializeToString()
    assert len(deep) - len(build(made((64, 64), levels=4)).SerializeToString()) < 20_000


def test_unknown_model():
    pytest.importorskip("onnx")
    with pytest.raises(UnsupportedError, match="model 9 is not known"):
        build(Planes({**made().packed, "model": 9}))


def test_without_onnx(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(UnsupportedError, match="pip install"):
        build(made())


# The command line


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A file of a soft picture whose layers share planes."""
    path = tmp_path_factory.mktemp("saved") / "a.pxi"
    picture(made(), made(components=1, seed=1)).save(path)
    return path


def test_the_colour_planes_are_exported(tool, saved, tmp_path):
    pytest.importorskip("onnx")
    path = tmp_path / "a.onnx"
    assert str(path) in tool("decode", saved, "--export-onnx", path).err
    texture = pxi.open(saved).layers["disc"].texture
    assert texture.alpha is not None
    agrees(texture.planes, path.read_bytes())
    before = path.read_bytes()
    tool("decode", saved, "--export-onnx", path, code=3)
    assert path.read_bytes() == before
    tool("decode", saved, "--export-onnx", path, "-f", "--layer", "disc", "--layer", "bar")
    assert path.read_bytes() == before


def test_layers_of_several_planes(tool, tmp_path):
    pytest.importorskip("onnx")
    other = made(step=300, seed=2)
    image = picture(made())
    stack = [*image.layers][:2] + [
        changed(v, texture=replace(v.texture, planes=other)) for v in image.layers[2:]
    ]
    changed(image, layers=Layers(stack)).save(tmp_path / "a.pxi")
    path = tmp_path / "a.onnx"
    export = "decode", tmp_path / "a.pxi", "--export-onnx", path
    assert "choose one layer with --layer" in tool(*export, code=2).err
    assert "choose one layer" in tool(*export, "--layer", "bar", "--layer", "disc", code=2).err
    tool(*export, "--layer", "nobody", code=2)
    assert not path.exists()
    tool(*export, "--layer", "disc")
    agrees(other, path.read_bytes())


def test_both_kinds_of_textures(tool, tmp_path):
    onnx = pytest.importorskip("onnx")
    implicit().save(tmp_path / "other.pxi")
    mixed = picture(made()).layers["disc"].textured(str(tmp_path / "other.pxi"), "disc")
    mixed.save(tmp_path / "a.pxi")
    export = "decode", tmp_path / "a.pxi", "-f", "--export-onnx", tmp_path / "a.onnx"
    assert "choose one layer" in tool(*export, code=2).err
    for layer, output in (("bar", "samples"), ("disc", "colour")):
        tool(*export, "--layer", layer)
        assert onnx.load(tmp_path / "a.onnx").graph.output[0].name == output
