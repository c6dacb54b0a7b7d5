import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.entropy import arrays
from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel


@st.composite
def coded_arrays(draw):
    bits = draw(st.integers(1, 8))
    shape = draw(st.tuples(st.integers(1, 4), st.integers(1, 12), st.integers(1, 12)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    values = rng.integers(0, 1 << bits, shape) >> draw(st.integers(0, bits - 1))
    stored = rng.random(shape[1:]) < draw(st.sampled_from([0.1, 0.6, 1.0]))
    return values, bits, stored


@given(coded_arrays())
def test_stored_values_come_back_and_others_are_zero(case):
    values, bits, stored = case
    out = arrays.decode(arrays.encode(values, bits, stored), values.shape, bits, stored)
    assert (out == np.where(stored, values, 0)).all()


@pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")
@settings(max_examples=30)
@given(coded_arrays())
def test_kernel_decodes_what_numpy_decodes(case):
    values, bits, stored = case
    data = arrays.encode(values, bits, stored)
    fast = arrays.decode(data, values.shape, bits, stored)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "available", lambda: False)
        plain = arrays.decode(data, values.shape, bits, stored)
    assert (fast == plain).all()


@pytest.mark.parametrize("native", [False, pytest.param(True, marks=pytest.mark.skipif(
    not kernel.available(), reason="the kernel was not compiled"))])  # fmt: skip
def test_counts_are_halved_alike(native, monkeypatch):
    """Long constant runs push counts over the limit, in long and short wavefronts."""
    monkeypatch.setattr(kernel, "available", lambda: native)
    for shape in ((1, 1, 3000), (4, 90, 90), (1, 3000, 1)):
        values = np.full(shape, 3)
        values[..., ::7] = 1
        stored = np.ones(shape[1:], bool)
        data = arrays.encode(values, 2, stored)
        assert (arrays.decode(data, shape, 2, stored) == values).all()


def smooth_codes():
    rng = np.random.default_rng(0)
    plane = np.cumsum(np.cumsum(rng.normal(0, 0.25, (4, 64, 64)), 1), 2) / 6
    return np.clip(np.rint(plane + rng.normal(0, 0.6, plane.shape)) + 8, 0, 15).astype(np.int64)


def test_beats_zstd_on_four_bit_symbols():
    import zstandard

    values = smooth_codes()
    ours = len(arrays.encode(values, 4, np.ones((64, 64), bool)))
    packed = (values.ravel()[::2] << 4 | values.ravel()[1::2]).astype(np.uint8).tobytes()
    theirs = min(
        len(zstandard.compress(data, 19)) for data in (packed, values.astype(np.uint8).tobytes())
    )
    assert ours < 0.9 * theirs


def test_positions_that_are_not_stored_cost_nothing():
    values = smooth_codes()
    stored = np.zeros((64, 64), bool)
    stored[20:40, 20:40] = True
    part = arrays.encode(values, 4, stored)
    assert len(part) < len(arrays.encode(values, 4, np.ones((64, 64), bool))) / 6


@pytest.mark.parametrize("damage", ["truncate", "extend", "flip", "padding"])
def test_damage_is_found(damage):
    values = np.random.default_rng(0).integers(0, 32, (1, 9, 9))
    stored = np.ones((9, 9), bool)
    data = bytearray(arrays.encode(values, 5, stored))
    if damage == "truncate":
        data = data[:-1]
    elif damage == "extend":
        data += b"\0"
    elif damage == "flip":
        data[2] ^= 0x40
    else:
        data[-1] |= 1
    with pytest.raises(FormatError):
        arrays.decode(bytes(data), values.shape, 5, stored)


@given(st.lists(st.integers(0, 255), max_size=40), st.integers(1, 8))
def test_raw_bits_come_back(values, width):
    values = np.array(values, np.int64) & ((1 << width) - 1)
    packed = arrays.pack_bits(values, width)
    assert len(packed) == (len(values) * width + 7) // 8
    assert (arrays.unpack_bits(packed, values.shape, width) == values).all()


def test_the_cheapest_symbols_still_fit_the_bound():
    """The early refusal of short streams never hits a real one."""
    for bits in (1, 2, 4):
        values = np.zeros((1, 400, 500), np.int64)
        stored = np.ones((400, 500), bool)
        data = arrays.encode(values, bits, stored)
        assert (arrays.decode(data, values.shape, bits, stored) == 0).all()


def test_a_small_stream_cannot_ask_for_a_huge_array():
    data = arrays.encode(np.zeros((1, 5, 5), np.int64), 4, np.ones((5, 5), bool))
    huge = np.broadcast_to(np.True_, (1 << 20, 1 << 10))
    with pytest.raises(FormatError, match="too short"):
        arrays.decode(data, (1, *huge.shape), 4, huge)
