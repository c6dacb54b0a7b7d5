import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry import deltas

numbers = st.integers(1 - (1 << 31), (1 << 31) - 1) | st.integers(-20, 20)


@given(st.integers(1, 3), st.lists(numbers, min_size=1, max_size=12))
def test_values_come_back(channels, values):
    array = np.resize(np.array(values, np.int64), (channels, len(values)))
    coded, raw = deltas.encode(array)
    np.testing.assert_array_equal(deltas.decode(coded, raw, channels, len(values), "here"), array)


def test_raw_bits_must_fit():
    coded, raw = deltas.encode(np.array([[5, -3, 0, 70000]]))
    for damaged in (raw[:-1], raw + b"\0"):
        with pytest.raises(FormatError, match=r"here.*length"):
            deltas.decode(coded, damaged, 1, 4, "here")
    low = bytearray(raw)
    low[-1] |= 1
    with pytest.raises(FormatError, match="padding"):
        deltas.decode(coded, bytes(low), 1, 4, "here")
