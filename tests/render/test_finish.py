"""Clamping and rounding of colours: the kernel does to the bit what numpy does."""

import numpy as np
import pytest

from proxyimg_codec.native import kernel
from proxyimg_codec.render.compose import premultiplied
from proxyimg_codec.render.pixels import _finished

pytestmark = pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")


@pytest.mark.parametrize("channels", [3, 4])
def test_colours_are_clamped_alike(channels):
    rng = np.random.default_rng(channels)
    output = rng.normal(0.5, 0.7, (1003, channels)).astype(np.float32)
    output[::7, 0], output[::11, -1], output[::13, 1] = np.nan, np.nan, np.inf
    found = premultiplied(output)
    with kernel.for_engine("numpy"):
        np.testing.assert_array_equal(found, premultiplied(output))
    assert found.min() >= 0
    assert (found[:, :3] <= found[:, 3:]).all()


@pytest.mark.parametrize("solid", [True, False])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_samples_are_rounded_alike(solid, dtype):
    rng = np.random.default_rng(3)
    most = np.iinfo(dtype).max
    halves = (rng.integers(0, most, (13, 77, 4)) + 0.5) / most
    colours = rng.uniform(-0.1, 1.1, (13, 77, 4))
    tile = np.where(rng.random((13, 77, 4)) < 0.5, halves, colours).astype(np.float32)
    tile[..., 3] = np.where(rng.random((13, 77)) < 0.2, 0, tile[..., 3].clip(0, 1))
    found = _finished(tile, solid, np.dtype(dtype))
    assert found.shape == (13, 77, 3 if solid else 4)
    with kernel.for_engine("numpy"):
        np.testing.assert_array_equal(found, _finished(tile, solid, np.dtype(dtype)))
