"""Maps of the shipped network: sizes, ranges, mirror images, and what it sees in plain pictures."""

import hashlib
from importlib import resources

import cv2
import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.maps import MODEL, find_maps

SHA_256 = "38293ba8f34d853aa8b66fe4913665be7677e17d36ecc1206ed92ec9873f11e6"


def test_the_network_is_the_one_that_was_measured():
    content = (resources.files("proxyimg_codec.models") / MODEL).read_bytes()
    assert hashlib.sha256(content).hexdigest() == SHA_256
    assert len(content) <= 1_500_000


@pytest.mark.parametrize("shape", [(1, 1), (1, 70), (33, 2), (129, 211), (911, 60)])
def test_any_size_has_maps(shape):
    rgb = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    maps = find_maps(rgb)
    assert maps.figure.shape == maps.boundary.shape == shape
    assert maps.owner.shape == (*shape, 2)
    for plane in (maps.figure, maps.boundary):
        assert plane.dtype == np.float32
        assert plane.min() >= 0
        assert plane.max() <= 1


def scene() -> tuple[np.ndarray, np.ndarray]:
    """A red ball before a blue ground of 187 x 251 pixels, and its mask."""
    rows, columns = np.indices((187, 251))
    ball = (rows - 95) ** 2 + (columns - 150) ** 2 <= 48**2
    rgb = np.where(ball[..., None], (205, 50, 40), (70, 110, 170))
    noise = np.random.default_rng(0).normal(0, 4, rgb.shape)
    return np.clip(cv2.GaussianBlur(rgb.astype(float), (0, 0), 1) + noise, 0, 255).astype(
        np.uint8
    ), ball


def test_a_ball_stands_out_has_an_edge_and_owns_it():
    rgb, ball = scene()
    maps = find_maps(rgb)
    assert maps.figure[ball].mean() > 0.8 > 0.3 > maps.figure[~ball].mean()
    rim = cv2.morphologyEx(ball.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3))) > 0
    assert maps.boundary[rim].mean() > 4 * maps.boundary[~rim].mean()
    rows, columns = np.nonzero(rim)
    inwards = np.stack([150 - columns, 95 - rows], 1) / 48
    assert (maps.owner[rim] * inwards).sum(1).mean() > 0.4


def test_a_mirror_image_has_mirrored_maps():
    rgb, _ = scene()
    one, other = find_maps(rgb), find_maps(np.ascontiguousarray(rgb[:, ::-1]))
    np.testing.assert_allclose(one.figure, other.figure[:, ::-1], atol=0.02)
    np.testing.assert_allclose(one.owner, other.owner[:, ::-1] * (-1, 1), atol=0.02)


def test_the_same_picture_has_the_same_maps_whatever_the_threads():
    rgb, _ = scene()
    one, other = find_maps(rgb, 1), find_maps(rgb, 2)
    np.testing.assert_array_equal(one.boundary, other.boundary)
    np.testing.assert_array_equal(one.owner, other.owner)
