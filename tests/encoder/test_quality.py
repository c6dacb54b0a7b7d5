"""Quality and size on a part of a real photograph: what a change of the encoder may not lose."""

import cv2
import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io import raster
from proxyimg_codec.render.quality import psnr
from tests.support.paths import ROOT

PSNR, BYTES = 29.4, 6600
PHOTO = ROOT / "docs" / "images" / "photo.png"


@pytest.fixture(scope="module")
def crop():
    return np.ascontiguousarray(raster.read(PHOTO).pixels[100:228, 380:572, :3])


@pytest.fixture(scope="module")
def image(crop):
    return pxi.encode(crop, effort=4, max_layers=1)


def test_rate_and_distortion(crop, image):
    assert psnr(crop, image) > PSNR
    assert len(image.to_bytes()) < BYTES


def test_quantization_costs_little(crop):
    fine = pxi.encode(crop, effort=4, max_layers=1, feature_bits=8)
    coarse = pxi.encode(crop, effort=4, max_layers=1, feature_bits=4)
    assert psnr(crop, coarse) > psnr(crop, fine) - 1.9


def test_enlarging_is_smooth_and_true(crop, image):
    """Four times as large, then averaged back: the picture itself, without blocks or ringing."""
    large = image.render(scale=4)
    back = cv2.resize(large, crop.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(back.astype(int) - image.render()).mean() < 2.5
    steps = np.abs(np.diff(large.astype(int), axis=1)).mean()
    assert steps < 0.45 * np.abs(np.diff(image.render().astype(int), axis=1)).mean()


def test_thumbnails_do_not_alias(crop, image):
    small = image.render(width=24)
    mean = cv2.resize(crop, small.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(small.astype(int) - mean).mean() < 2
