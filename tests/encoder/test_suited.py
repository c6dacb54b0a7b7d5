"""The hint that a lossless format suits a picture better."""

import io
import logging

import numpy as np
import pytest
from PIL import Image

from proxyimg_codec import encode
from proxyimg_codec.encoder.suited import is_flat, webp_bytes
from tests.encoder.pyramid.test_encode import textured

HINT = "lossless WebP takes"


def text(width=160, height=96):
    """Dark strokes on white, as of letters."""
    rng = np.random.default_rng(1)
    page = np.full((height, width, 3), 255, np.uint8)
    for row in range(6, height - 12, 14):
        for column in range(4, width - 8, 8):
            page[row : row + 8, column : column + 1 + rng.integers(4)] = 20
            page[row + rng.integers(8), column : column + 5] = 20
    return page


def half_a_photograph():
    """Flat, but for a part that no lossless format codes well."""
    page = np.full((96, 160, 3), 200, np.uint8)
    page[:, :64] = textured(64, 96)
    return page


@pytest.mark.parametrize(
    ("pixels", "options", "told"),
    [
        (text(), {"quality": 90}, True),
        (text()[..., 0], {"quality": 90}, True),
        (text(), {"quality": 90, "texture": "pyramid"}, False),
        (half_a_photograph(), {"quality": 40}, False),
        (textured(96, 64), {"quality": 95}, False),
    ],
)
def test_text_is_better_kept_lossless(caplog, pixels, options, told):
    with caplog.at_level(logging.WARNING):
        encode(pixels, effort=1, max_layers=1, **options)
    assert (HINT in caplog.text) == told


def test_flat_pictures():
    assert is_flat(text())
    assert is_flat(half_a_photograph())
    assert not is_flat(textured(96, 64))
    assert not is_flat(text()[:1])
    assert not is_flat(text()[:, :1])


@pytest.mark.parametrize("channels", [[0], [0, 1], [0, 1, 2], [0, 1, 2, 0]])
def test_lossless_bytes(channels):
    pixels = text()[..., channels]
    wide = {1: [0, 0, 0], 2: [0, 0, 0, 1]}.get(len(channels), [*range(len(channels))])
    file = io.BytesIO()
    Image.fromarray(pixels[..., wide]).save(file, "WEBP", lossless=True)
    assert webp_bytes(pixels) == pytest.approx(len(file.getvalue()), rel=0.1)
