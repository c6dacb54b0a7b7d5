"""PNG and NPY files are read strictly."""

import io

import numpy as np
import pytest

from conformance import pixels
from proxyimg_codec.io import png
from tests.conformance.decoders import picture


@pytest.mark.parametrize("channels", [3, 4])
def test_png_with_every_filter_is_read(channels):
    rng = np.random.default_rng(0)
    wanted = rng.integers(0, 65536, (7, 6, channels), np.uint16)
    assert (pixels.read(png.encode_png(wanted)) == wanted).all()
    raw = wanted.astype(">u2").view(np.uint8).reshape(7, -1)
    step, above = 2 * channels, np.zeros(raw.shape[1], int)
    for kind in range(5):
        for row in raw.astype(int):
            a = np.concatenate([np.zeros(step, int), row[:-step]])
            c = np.concatenate([np.zeros(step, int), above[:-step]])
            paeth = [pixels._paeth(*v) for v in zip(a, above, c, strict=True)]
            guess = np.array([0 * a, a, above, (a + above) // 2, paeth][kind])
            line = ((row - guess) & 255).astype(np.uint8)
            out = pixels._unfilter(kind, line, above.astype(np.uint8), step)
            assert (out == row).all()
            above = row


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<f4"])
def test_npy_is_read(order, dtype):
    wanted = np.arange(60).reshape(3, 5, 4).astype(dtype, order=order)
    file = io.BytesIO()
    np.save(file, wanted)
    assert (pixels.read(file.getvalue()) == wanted).all()
    for cut in (0, 3, 9, 50, 127, -1):
        with pytest.raises(ValueError, match=r"NPY|PNG"):
            pixels.read(file.getvalue()[:cut])


@pytest.mark.parametrize("shape", [(2, 2), (2, 2, 2), (0, 2, 3)])
def test_npy_of_other_shapes_is_refused(shape):
    file = io.BytesIO()
    np.save(file, np.zeros(shape, np.uint16))
    with pytest.raises(ValueError, match="shape"):
        pixels.read(file.getvalue())


def test_damaged_png_is_refused():
    data = png.encode_png(picture(1, 2, 3))
    for i in range(len(data)):
        with pytest.raises(ValueError, match="PNG"):
            pixels.read(data[:i])
        with pytest.raises(ValueError, match=r"PNG|shape"):
            pixels.read(data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :])
    with pytest.raises(ValueError, match="16-bit"):
        pixels.read(png.encode_png(picture(1, 2, 3, dtype=np.uint8)))
