"""Thumbnails from fewer levels, progress of drawings, and arrays that are given for the pixels."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import Numbers
from conformance.make.valid import pyramids, views
from proxyimg_codec.errors import UsageError
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.model import Layers
from proxyimg_codec.render import thumbnail
from proxyimg_codec.render.view import make_view
from proxyimg_codec.texture.planes import Planes
from tests.support.images import changed


def made(cases, name):
    return pxi.Image(cases.CASES[name].build(Numbers(name)))


def exactly(image, monkeypatch, **how):
    with monkeypatch.context() as patch:
        patch.setattr(thumbnail, "raster", lambda *a: None)
        return pxi.Image(image.picture).render(**how)


@pytest.fixture
def smooth():
    return made(pyramids, "pyramid-thumbnail-smooth")


@pytest.fixture
def layered():
    """Two layers that rest in their place."""
    image = made(views, "pyramid-cuts")
    rest = [changed(v, pose=pxi.Image(image).layers[0].pose) for v in image.picture.layers]
    return changed(image, layers=Layers(rest))


@pytest.mark.parametrize("engine", ["numpy", "auto"])
@pytest.mark.parametrize("size", [{"width": 20}, {"width": 7}, {"width": 40, "height": 9}])
def test_thumbnails_are_nearly_those_of_all_levels(smooth, size, engine, monkeypatch):
    found = smooth.render(**size, engine=engine)
    error = psnr_8bit(found, exactly(smooth, monkeypatch, **size))
    assert error is None or error > 45


def test_only_the_levels_that_are_needed_are_read(smooth, monkeypatch):
    levels = []
    monkeypatch.setattr(Planes, "reduced", lambda self, level, window: levels.append(level))
    for width in (7, 20):
        with pytest.raises(TypeError):
            smooth.render(width=width)
    assert levels == [2, 1]
    assert smooth.render(width=50).shape == (39, 50, 3)


@pytest.mark.parametrize(
    ("details", "span", "levels"),
    [
        ([4, 4, 4], 3, 1), ([8, 8, 8], 1.4, 0), ([255, 0, 0], 9, 0), ([0, 0, 0], 9, 2),
        ([0, 0, 0], 100, 3), ([36, 49, 55], 3, 1), ([80, 114, 121], 3, 0), ([80, 114, 121], 8, 1),
        ([], 5, 0), ([], 8, 1),
    ],
)  # fmt: skip
def test_what_is_lost_decides_how_many_levels_are_left_out(details, span, levels):
    packed = {**pyramids.coded(Numbers("x"), (48, 40), levels=3).packed, "details": details}
    assert thumbnail.spare(Planes(packed), span) == levels


def test_layers_at_rest_are_one_raster(layered, monkeypatch):
    assert thumbnail.raster(layered.picture, layered.picture.layers, _view(layered)) is not None
    found, whole = layered.render(width=11), exactly(layered, monkeypatch, width=11)
    assert psnr_8bit(found, whole) > 30, "a few pixels of noise, some of which layers mix"


def _view(image, width=11):
    return make_view(image.picture.size, width)


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v.layers["disc"].moved(3, 0), lambda v: v.layers["disc"].hidden(),
        lambda v: v.layers["disc"].with_opacity(0.5), lambda v: v.layers["disc"].removed(),
    ],
)  # fmt: skip
def test_edited_pictures_are_drawn_exactly(layered, change, monkeypatch):
    edited = change(layered)
    np.testing.assert_array_equal(edited.render(width=11), exactly(edited, monkeypatch, width=11))


def test_other_requests_are_drawn_exactly(layered):
    layers = layered.picture.layers
    view = _view(layered)
    assert thumbnail.raster(layered.picture, layers[1:], view) is None
    assert thumbnail.raster(layered.picture, layers, _view(layered, 24)) is None
    alpha = made(pyramids, "pyramid-alpha").picture
    assert thumbnail.raster(alpha, alpha.layers, _view(pxi.Image(alpha))) is None
    part = made(pyramids, "pyramid-part").picture
    assert thumbnail.raster(part, part.layers, _view(pxi.Image(part))) is None


@pytest.mark.parametrize("how", [{}, {"width": 9}, {"width": 60}, {"region": (3, 2, 9, 8)}])
def test_progress_adds_up_to_all_pixels(layered, how):
    told = []
    pixels = layered.render(**how, progress=told.append)
    assert sum(told) == pixels.shape[0] * pixels.shape[1]
    assert min(told) >= 0
    assert len(told) > 2


def test_progress_comes_before_anything_is_drawn(layered, monkeypatch):
    told = []

    def stop(amount):
        told.append(amount)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        layered.render(progress=stop)
    assert told[0] < 0.3 * layered.width * layered.height
    assert len(told) == 1
    layered.render()


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_pixels_come_into_the_array_that_is_given(layered, dtype):
    expected = layered.render(dtype=dtype)
    wide = np.zeros((expected.shape[0], 2 * expected.shape[1], 3), dtype)
    out = wide[:, ::2]
    assert layered.render(dtype=dtype, out=out) is out
    np.testing.assert_array_equal(out, expected)
    assert not wide[:, 1::2].any()


def test_arrays_that_do_not_fit(layered):
    h, w = layered.height, layered.width
    frozen = np.zeros((h, w, 3), np.uint8)
    frozen.flags.writeable = False
    for out, said in (
        (np.zeros((h, w, 4), np.uint8), "has shape"), (np.zeros((w, h, 3), np.uint8), "has shape"),
        (np.zeros((h, w, 3), np.uint16), "type uint16"), (frozen, "read-only"),
        (bytearray(3 * h * w), "is a bytearray"),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=said):
            layered.render(out=out)
