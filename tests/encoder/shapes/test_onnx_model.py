import numpy as np
import pytest

from proxyimg_codec.encoder.shapes import onnx_model
from proxyimg_codec.encoder.shapes.onnx_model import load
from proxyimg_codec.errors import InputError, LimitError
from tests.support import onnx_models


def test_inputs_are_converted_and_outputs_named(tmp_path):
    model = load(onnx_models.write(tmp_path / "m.onnx", onnx_models.figures(4, 0, 1)))
    assert [str(t) for t in model.inputs] == ["input float32 [1, 3, 4, 4]"]
    picture = np.arange(48).reshape(1, 3, 4, 4)
    (found,) = model.run({"input": picture}, ["d0"])
    assert found.dtype == np.float32
    assert (found[0, 0] == picture[0, 0]).all()


@pytest.mark.parametrize("data", [b"", b"no model at all", onnx_models.figures(4)[:70]])
def test_what_is_no_model_is_refused(tmp_path, data):
    path = onnx_models.write(tmp_path / "m.onnx", data)
    with pytest.raises(InputError, match=r"m\.onnx: is not an ONNX model"):
        load(path)
    with pytest.raises(InputError, match=r"none\.onnx: cannot be read: No such file"):
        load(tmp_path / "none.onnx")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        load(tmp_path)


def test_a_changed_file_is_loaded_again(tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.figures(4))
    first = load(path)
    assert load(path) is first
    onnx_models.write(path, onnx_models.figures(8))
    assert load(path).inputs[0].shape == (1, 3, 8, 8)


def test_too_little_memory_is_said(tmp_path, monkeypatch, capfd):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.greedy())
    with pytest.raises(LimitError, match=r"m\.onnx: the model needs more memory than there is"):
        load(path).run({"input": np.zeros((1, 3, 8, 8))})
    assert capfd.readouterr().err == ""
    monkeypatch.setattr(onnx_model, "memory", lambda: 100)
    with pytest.raises(LimitError, match="this machine 0 MiB of memory"):
        load(path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(tmp_path, value):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.figures(4, value, 1))
    with pytest.raises(InputError, match=r"m\.onnx: the model gives values that are not finite"):
        load(path).run({"input": np.zeros((1, 3, 4, 4))}, ["d0"])
