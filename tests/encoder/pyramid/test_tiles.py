"""Tiles of small pictures, where they are asked for."""

import numpy as np
import pytest

from proxyimg_codec import encode, from_bytes
from proxyimg_codec.errors import UsageError

SETTINGS = {"effort": 1, "jobs": 1, "max_layers": 1}


@pytest.fixture(scope="module")
def picture():
    y, x = np.mgrid[:281, :347]
    waves = np.stack([128 + 90 * np.sin(x / 5 + y / 9 + k) for k in range(3)], 2)
    return waves.astype(np.uint8)


def coded(image):
    return image.picture.planes[0].packed


def test_tiles_are_there_where_asked_for_and_change_no_pixel(picture):
    plain, tiled = (
        from_bytes(encode(picture, tiles=t, **SETTINGS).to_bytes()) for t in ("auto", "always")
    )
    assert coded(plain)["tile"] == 0
    assert coded(tiled)["tile"] == 7
    np.testing.assert_array_equal(plain.render(), tiled.render())
    region = (300, 240, 37, 29)
    assert len(coded(tiled)["data"]) < 1.1 * len(coded(plain)["data"])
    np.testing.assert_array_equal(
        from_bytes(tiled.to_bytes()).render(region=region), plain.render(region=region)
    )


def test_tiles_can_be_left_out(picture, monkeypatch):
    monkeypatch.setattr("proxyimg_codec.texture.planes.LARGE", 1)
    monkeypatch.setattr("proxyimg_codec.texture.planes.TILES_SHARE", 1)
    assert coded(encode(picture, **SETTINGS))["tile"] == 7
    assert coded(encode(picture, tiles="never", **SETTINGS))["tile"] == 0


def test_tiles_need_a_pyramid():
    with pytest.raises(UsageError, match="tiles always needs texture pyramid"):
        encode(np.zeros((8, 8, 3), np.uint8), tiles="always", texture="implicit")
    with pytest.raises(UsageError, match="tiles is some, but must be auto"):
        encode(np.zeros((8, 8, 3), np.uint8), tiles="some")
