"""Samples of any type: one rule for arrays, NPY files and pictures."""

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, PxiError, UnsupportedError
from proxyimg_codec.io.raster import read
from proxyimg_codec.io.samples import rounded, standard, to_float, unit
from tests.support.profiles import tiff_of

SHARES = np.array([0, 0.2, 0.5, 1.0])


def samples(dtype, shape=(2, 2, 1)):
    """Shares of white in a type."""
    kind = np.dtype(dtype).kind
    top = 1 if kind in "fb" else int(np.iinfo(dtype).max)
    values = [round(s * 1000) * top // 1000 if kind in "ui" else s for s in SHARES]
    return np.array(values, dtype).reshape(shape)


WHOLE = [np.uint8, np.uint16, np.uint32, np.uint64]
FLOATS = [np.float16, np.float32, np.float64, np.longdouble]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", [*WHOLE, *FLOATS])
def test_the_largest_value_of_a_type_is_white(dtype, order):
    array = samples(dtype)
    array = array.astype(array.dtype.newbyteorder(order))
    values, depth = to_float(array)
    assert depth == (8 if dtype is np.uint8 else 16)
    error = 1 / 255 if dtype is np.uint8 else 1e-3
    np.testing.assert_allclose(values[..., 0].ravel(), SHARES, atol=error)
    assert values[..., :3].max() == 1


def test_false_is_black_and_true_is_white():
    values, depth = to_float(np.array([[False, True]]))
    assert depth == 8
    np.testing.assert_array_equal(values[0, :, 0], [0, 1])


@pytest.mark.parametrize("top", [1023, 4095])
def test_fewer_bits_in_a_wider_type_are_not_stretched(top):
    values, _ = to_float(np.full((2, 2), top, np.uint16))
    assert values[0, 0, 0] == pytest.approx(top / 65535)


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32, np.int64, np.complex64, "U1",
                                   "datetime64[s]", object])  # fmt: skip
def test_types_without_a_white_are_refused(tmp_path, dtype):
    array = np.zeros((3, 3), dtype)
    with pytest.raises(InputError, match=r"samples of type .* \(divided by the largest value"):
        to_float(array)
    if dtype is not object:
        np.save(tmp_path / "a.npy", array)
        with pytest.raises(InputError, match=r"a\.npy: samples of type"):
            read(tmp_path / "a.npy")


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, -0.01, 1.01, 1e39, 70000.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_floats_beyond_white_are_refused_or_clipped(tmp_path, wrong, dtype):
    with np.errstate(over="ignore"):
        array = np.full((3, 4, 3), 0.5, dtype)
        array[1, 2, 0] = wrong
    with pytest.raises(InputError):
        to_float(array)
    np.save(tmp_path / "a.npy", array)
    clipped = read(tmp_path / "a.npy", clip=True).pixels
    if np.isnan(wrong):
        with pytest.raises(InputError, match="NaN"):
            to_float(clipped)
    else:
        assert to_float(clipped)[0][1, 2, 0] == (1 if wrong > 0 else 0)


@pytest.mark.parametrize("dtype", [bool, *WHOLE, *FLOATS])
def test_npy_files_are_read_as_arrays_are_taken(tmp_path, dtype):
    for shape in ((2, 2), (2, 2, 1)):
        array = samples(dtype, shape)
        if dtype is np.longdouble and np.dtype(dtype).itemsize == 8:
            continue
        np.save(tmp_path / "a.npy", array)
        pixels = read(tmp_path / "a.npy").pixels
        assert pixels.shape == (2, 2, 1)
        assert pixels.dtype in (np.uint8, np.uint16, np.float32)
        np.testing.assert_array_equal(to_float(pixels)[0], to_float(array)[0])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32, np.float16, np.float32,
                                   np.float64])  # fmt: skip
@pytest.mark.parametrize("channels", [1, 3])
def test_pictures_are_read_as_arrays_are_taken(tmp_path, dtype, order, channels):
    pytest.importorskip("OpenImageIO")
    array = samples(dtype).repeat(channels, axis=2)
    (tmp_path / "a.tif").write_bytes(tiff_of(array, order))
    pixels = read(tmp_path / "a.tif").pixels
    np.testing.assert_allclose(to_float(pixels)[0], to_float(array)[0], atol=1e-6)
    assert to_float(pixels)[1] == to_float(array)[1]


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32])
def test_pictures_whose_samples_have_a_sign_are_refused(tmp_path, dtype):
    pytest.importorskip("OpenImageIO")
    (tmp_path / "a.tif").write_bytes(tiff_of(samples(dtype)))
    with pytest.raises(UnsupportedError, match="have a sign"):
        read(tmp_path / "a.tif")


@pytest.mark.parametrize("top", [15, 100, 1023, 4095])
def test_the_largest_value_that_a_pnm_file_states_is_white(tmp_path, top):
    pytest.importorskip("OpenImageIO")
    kind = ">u2" if top > 255 else "u1"
    body = np.array([0, top // 5, top], kind).tobytes()
    (tmp_path / "a.pgm").write_bytes(b"P5\n3 1\n%d\n" % top + body)
    shown = unit(read(tmp_path / "a.pgm").pixels).ravel()
    np.testing.assert_allclose(shown, [0, top // 5 / top, 1], atol=0.003)


@pytest.mark.parametrize("shape", [(), (4,), (2, 2, 5), (2, 2, 0), (0, 3), (1, 1, 1, 1)])
def test_arrays_that_are_no_pictures(shape):
    with pytest.raises(PxiError, match="a picture must be"):
        standard(np.zeros(shape, np.uint8))


def test_rounding_is_the_inverse_of_scaling():
    for dtype in (np.uint8, np.uint16):
        values = np.arange(np.iinfo(dtype).max + 1).astype(dtype)
        np.testing.assert_array_equal(rounded(unit(values), dtype), values)
    floats = np.float32([0.1, 0.7])
    assert rounded(floats, np.float32) is floats
