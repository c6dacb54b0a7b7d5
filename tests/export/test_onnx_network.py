import numpy as np
import pytest

from proxyimg_codec.cli.decode import main
from proxyimg_codec.texture.network import NetShape
from tests.support.textures import random_network

onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")


def run(path, features):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(["colour"], {"features": features})[0]


def test_the_exported_file_gives_the_decoders_colours(small_pxi, tmp_path):
    import proxyimg_codec as pxi

    path = tmp_path / "network.onnx"
    assert main([str(small_pxi), "--export-onnx", str(path), "--quiet"]) == 0
    image = pxi.open(small_pxi)
    rng = np.random.default_rng(0)
    for n in (1, 777):
        features = rng.normal(0, 0.5, (n, image.networks[0].shape.dim)).astype(np.float32)
        theirs = np.rint(np.clip(run(path, features), 0, 1) * 255)
        ours = np.rint(np.clip(image.networks[0](features), 0, 1) * 255)
        assert np.abs(theirs - ours).max() <= 1
        assert (theirs == ours).mean() > 0.99


def test_the_model_is_self_contained(small_pxi, tmp_path):
    path = tmp_path / "network.onnx"
    main([str(small_pxi), "--export-onnx", str(path), "--quiet"])
    model = onnx.load(path, load_external_data=False)
    onnx.checker.check_model(model, full_check=True)
    assert model.opset_import[0].version == 18
    assert not any(t.external_data for t in model.graph.initializer)
    dims = model.graph.input[0].type.tensor_type.shape.dim
    assert dims[0].dim_param
    assert dims[1].dim_value == 8


@pytest.mark.parametrize("octaves", [0, 1, 6])
def test_any_shape(octaves, tmp_path):
    from proxyimg_codec.export.onnx_network import build

    network = random_network(NetShape(3, octaves, 5, 2, 4), 8)
    path = tmp_path / "a.onnx"
    path.write_bytes(build(network).SerializeToString())
    features = np.random.default_rng(0).normal(0, 0.5, (50, 3)).astype(np.float32)
    assert np.abs(run(path, features) - network(features)).max() < 2e-3
