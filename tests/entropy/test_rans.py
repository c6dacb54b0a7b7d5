import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.entropy.rans import LOW, SCALE_BITS, Decoder, Encoder
from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel

TOTAL = 1 << SCALE_BITS


def cumulative(weights):
    weights = np.asarray(weights, np.int64)
    freq = (TOTAL - len(weights)) * weights // weights.sum() + 1
    freq[-1] += TOTAL - freq.sum()
    return np.concatenate([[0], np.cumsum(freq)])


def code(symbols, cdf, lanes_log2, waves=1):
    encoder = Encoder(lanes_log2)
    for part in np.array_split(symbols, waves):
        encoder.put(cdf[part], cdf[part + 1] - cdf[part])
    return encoder.finish()


def decode(data, cdf, counts):
    decoder = Decoder(data)
    rows = [decoder.symbols(np.tile(cdf, (n, 1))) for n in counts]
    decoder.finish()
    return np.concatenate(rows)


@given(
    st.lists(st.integers(0, 1000), min_size=2, max_size=16),
    st.integers(0, 400),
    st.integers(0, 6),
    st.integers(0, 2**32 - 1),
)
def test_symbols_come_back(weights, n, lanes_log2, seed):
    cdf = cumulative(np.add(weights, 1))
    symbols = np.random.default_rng(seed).integers(0, len(weights), n)
    data = code(symbols, cdf, lanes_log2, waves=3)
    counts = [len(p) for p in np.array_split(symbols, 3)]
    assert (decode(data, cdf, counts) == symbols).all()


def test_size_is_close_to_the_entropy():
    rng = np.random.default_rng(0)
    weights = np.array([1, 2, 4, 8, 16, 32, 64, 128])
    symbols = rng.choice(8, 20000, p=weights / weights.sum())
    cdf = cumulative(weights)
    ideal = -np.log2(np.diff(cdf)[symbols] / TOTAL).sum() / 8
    assert ideal < len(code(symbols, cdf, 3)) < ideal * 1.002 + 5 + 4 * 8


def test_one_symbol_alphabet_costs_only_the_states():
    cdf = np.array([0, TOTAL])
    assert len(code(np.zeros(1000, np.int64), cdf, 0)) == 1 + 4 + 4


def test_known_stream():
    """The bytes of a small stream are part of the format."""
    cdf = cumulative([1, 1, 1, 1])
    data = code(np.array([0, 1, 2, 3, 3, 2, 1, 0, 0, 0]), cdf, 1)
    assert data.hex() == KNOWN_STREAM


KNOWN_STREAM = "010080070400d0020400000000"


@pytest.mark.parametrize("cut", [0, 1, 4, 8, -1])
def test_truncation_is_found(cut):
    cdf = cumulative([1, 3])
    data = code(np.arange(4000) % 2, cdf, 1)
    with pytest.raises(FormatError):
        decode(data[:cut], cdf, [4000])


def test_too_few_symbols_read_is_found():
    cdf = cumulative([1, 3])
    data = code(np.ones(100, np.int64), cdf, 0)
    decoder = Decoder(data)
    decoder.symbols(np.tile(cdf, (99, 1)))
    with pytest.raises(FormatError, match="does not end"):
        decoder.finish()


def test_states_end_where_they_began():
    cdf = cumulative([5, 1, 1])
    symbols = np.random.default_rng(1).integers(0, 3, 500)
    decoder = Decoder(code(symbols, cdf, 2))
    decoder.symbols(np.tile(cdf, (500, 1)))
    assert (decoder.states == LOW).all()


@pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")
@given(
    st.lists(st.integers(0, 70), max_size=8),
    st.sampled_from([None, 0, 1, 3, 5]),
    st.integers(0, 2**32 - 1),
)
def test_kernel_encodes_what_numpy_encodes(groups, lanes_log2, seed):
    """Groups of any length, also empty ones, of the rarest to the most certain symbols."""
    rng = np.random.default_rng(seed)
    encoder = Encoder(lanes_log2)
    for n in groups:
        freq = np.minimum(1 << rng.integers(0, SCALE_BITS + 1, n), TOTAL)
        encoder.put(rng.integers(0, TOTAL - freq + 1), freq)
    fast = encoder.finish()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "available", lambda: False)
        assert encoder.finish() == fast


def test_groups_may_be_put_at_once():
    freq = np.random.default_rng(3).integers(1, 999, 50)
    one, many = Encoder(2), Encoder(2)
    for part in (freq[:7], freq[7:7], freq[7:50]):
        one.put(part, part)
    many.put_groups(*[freq.astype(np.uint16)] * 2, np.array([7, 7, 50]))
    assert one.finish() == many.finish()
    assert one.bits() == many.bits() == pytest.approx((SCALE_BITS - np.log2(freq)).sum())
