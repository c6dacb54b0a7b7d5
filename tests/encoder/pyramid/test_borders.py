"""Borders of pictures of any size, and rims of transparent ones, are as exact as the rest.

`python -m benchmarks.borders` measures the same on many pictures.
"""

from pathlib import Path

import cv2
import numpy as np
import pytest

from proxyimg_codec import encode, from_bytes
from proxyimg_codec.encoder.pyramid import encode as pyramid
from proxyimg_codec.encoder.pyramid.encode import Effort
from proxyimg_codec.encoder.pyramid.picture import colour_of
from proxyimg_codec.io import raster

PHOTO = Path(__file__).parents[3] / "docs" / "images" / "photo.png"
RING, BEYOND = 16, 64


def photo(kind):
    pixels = np.ascontiguousarray(raster.read(PHOTO).pixels[..., :3])
    if kind == "grey":
        return pixels[..., 1:2].repeat(3, 2)
    if kind == "deep":
        return np.rint(cv2.blur(pixels.astype(np.float32) * 257, (2, 2))).astype(np.uint16)
    if kind == "alpha":
        alpha = cv2.GaussianBlur(pixels[..., 0], (0, 0), 5)
        return np.dstack([pixels, np.clip(alpha.astype(int) * 2 - 60, 0, 255).astype(np.uint8)])
    return pixels


def error(pixels, quality, effort):
    """Squared error [H, W] in 0..1 of what comes back, over grey where it is transparent."""
    image = encode(pixels, quality=quality, effort=effort, max_layers=1, jobs=1)
    back = from_bytes(image.to_bytes()).render(dtype=pixels.dtype.type)
    both = [v / np.iinfo(pixels.dtype).max for v in (pixels, back)]
    if pixels.shape[2] == 4:
        both = [v[..., :3] * v[..., 3:] + 0.5 * (1 - v[..., 3:]) for v in both]
    return ((both[0] - both[1]) ** 2).mean(2)


def decibel(errors):
    return 10 * np.log10(1 / errors.mean())


@pytest.mark.parametrize(
    ("size", "kind", "quality", "effort"),
    [
        ((65, 127), "colour", 60, 2),
        ((98, 83), "colour", 30, 1),
        ((107, 132), "colour", 90, 1),
        ((76, 117), "grey", 60, 1),
        ((93, 70), "deep", 60, 1),
        ((118, 99), "alpha", 60, 1),
    ],
)
def test_borders_are_as_exact_as_when_the_picture_goes_on(size, kind, quality, effort):
    """Within 1.5 dB on each side, and 0.7 dB in the mean, of the same samples in a larger cut."""
    pixels, (w, h) = photo(kind), size
    y, x = (pixels.shape[0] - h) // 2, (pixels.shape[1] - w) // 2
    own = error(pixels[y : y + h, x : x + w], quality, effort)
    wide = pixels[y - BEYOND : y + h + BEYOND, x - BEYOND : x + w + BEYOND]
    other = error(wide, quality, effort)[BEYOND:-BEYOND, BEYOND:-BEYOND]
    sides = [np.s_[:, :RING], np.s_[:, -RING:], np.s_[:RING], np.s_[-RING:]]
    less = [decibel(own[s]) - decibel(other[s]) for s in sides]
    assert min(less) > -1.5
    assert np.mean(less) > -0.7


def test_rims_of_transparent_pictures_are_as_exact_as_if_all_was_stored():
    """The coarse filters of samples at a rim reach far beyond it."""
    y, x = np.mgrid[:133, :147].astype(np.float32)
    inside = np.hypot(x - 70, y - 66) < 50
    colour = (
        np.stack([128 + 80 * np.sin(x / 40), 60 + y, 220 - x], 2)
        + 9 * np.sin(x * y / 99)[..., None]
    )
    raster_ = colour_of(np.dstack([np.clip(colour, 0, 255) / 255, inside]).astype(np.float32))
    assert raster_.cells is not None
    near = inside & (np.hypot(x - 70, y - 66) > 42)

    def quality(cells):
        planes, _ = pyramid.encode(
            raster_._replace(cells=cells), 256, Effort(0, 2), 0, lambda n: None
        )
        return decibel(((planes.raster - raster_.samples / 255) ** 2).mean(2)[near])

    assert quality(raster_.cells) > quality(None) - 0.5


@pytest.mark.parametrize("size", [(801, 70), (70, 833)])
def test_windows_end_where_the_raster_ends(size):
    """Pictures that take several windows have no seam, and a border like any other."""
    w, h = size
    pixels = cv2.resize(photo("colour"), size, interpolation=cv2.INTER_AREA)
    errors = error(pixels, 60, 1)
    along = np.array_split(errors, 12, axis=int(w > h))
    assert min(map(decibel, along[-2:])) > decibel(errors) - 6
    assert decibel(errors[-RING:, -RING:]) > 25


def test_soft_alpha_that_passes_one_half_at_the_border_is_kept():
    """No outline cuts off what would be taken for the rim of one inside a picture."""
    y, x = np.mgrid[:77, :93]
    alpha = np.where(x < 20, 140, 255 - 26 * np.maximum(x - 86, 0))
    assert alpha[0, -3:].tolist() == [151, 125, 99]
    pixels = np.dstack([0 * x + 90, 2 * y, 2 * x, alpha]).astype(np.uint8)
    image = encode(pixels, quality=90, effort=1, max_layers=1, jobs=1)
    assert np.abs(image.render()[..., 3].astype(int) - pixels[..., 3]).max() < 16
