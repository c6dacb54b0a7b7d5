"""The benchmark of layers makes pictures of the files, and compares what it says."""

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from benchmarks import layered as b
from proxyimg_codec.encoder.settings import Settings
from tests.encoder.test_import_layers import H, W, ball
from tests.support.pictures import smooth

FILES = ("back.png", "a.png", "b.png")


@pytest.fixture
def picture(tmp_path):
    for name, pixels in zip(
        FILES, (smooth(W, H), *[ball(30, 24, r) for r in (18, 9)]), strict=True
    ):
        Image.fromarray(pixels).save(tmp_path / name)
    return b.layered(tmp_path, FILES)


def test_sprites_stand_on_the_ground_and_overlap(picture):
    assert (picture.width, picture.height) == (W, H)
    back, *sprites = picture.layers
    np.testing.assert_array_equal(back.pixels, smooth(W, H))
    covered = np.zeros((H, W), int)
    for layer, share in zip(sprites, b.HEIGHTS, strict=True):
        h, w = layer.pixels.shape[:2]
        assert h == min(round(share * H), W // 2)
        assert layer.y + h == H
        covered[layer.y : layer.y + h, layer.x : layer.x + w] += layer.pixels[..., 3] > 0
    assert covered.max() == 2


def test_clear_pixels_continue_the_colours_of_others():
    found = b.continued(ball(30, 24, 15))
    np.testing.assert_array_equal(found[..., 3], ball(30, 24, 15)[..., 3])
    assert np.abs(found[..., :3].astype(int) - (200, 60, 40)).max() <= 1


def test_curves_rise_and_layers_are_drawn_alone(picture, monkeypatch, capsys):
    monkeypatch.setattr(b, "QUALITIES", (30.0, 60.0))
    monkeypatch.setattr(b, "AVIF_QUALITIES", (20, 60))
    curves = b.measure(picture, Settings(effort=1, jobs=1), parts=True)
    for points in (curves.pxi, *curves.avif.values()):
        assert points[0][0] < points[1][0]
        assert points[0][1] < points[1][1]
    assert "PLAN:" in capsys.readouterr().out


def test_alone_is_without_what_lies_in_front(picture):
    image, _ = b.encode_layers(picture, Settings(effort=1, jobs=1, quality=80))
    image = pxi.from_bytes(image.to_bytes())
    for layer in picture.layers:
        assert b.psnr(layer.pixels, b.alone(image, layer)) > 26
