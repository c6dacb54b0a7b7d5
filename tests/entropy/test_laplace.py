import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.entropy import laplace
from proxyimg_codec.entropy.rans import SCALE_BITS

TOTAL = 1 << SCALE_BITS
ROWS = [(scale, part) for scale in range(laplace.DIRECT + 1) for part in range(16)]


def cumulative(scale, z):
    """Of the documented mixture at distances z from the mean, in float64."""

    def one(b):
        tail = np.exp(-np.abs(z) / b) / 2
        return np.where(z < 0, tail, 1 - tail)

    b = np.exp(scale / 8 - 4)
    return 7 / 8 * one(b) + 1 / 8 * one(np.e * b)


def test_every_symbol_has_a_frequency_and_all_fill_the_range():
    tables = laplace.tables()
    assert tables.ends.shape == (len(ROWS), laplace.WIDTH + 1)
    for row, (scale, _) in enumerate(ROWS):
        reach = tables.reach[row]
        assert reach == laplace.reach_of(scale)
        assert 2 <= reach <= laplace.REACH
        ends = tables.ends[row].astype(int)
        symbols = 2 * reach + 2
        assert ends[0] == 0
        assert (np.diff(ends[: symbols + 1]) >= 1).all()
        assert (ends[symbols:] == TOTAL).all()


def test_tables_are_those_of_the_mixture():
    """Cumulative frequencies are within 1 of a straight evaluation of the formula."""
    tables = laplace.tables()
    for row, (scale, part) in enumerate(ROWS):
        reach = tables.reach[row]
        n = 2 * reach + 2
        ends_of_differences = np.arange(-reach - 1, reach + 1) + 0.5 - (part - 8) / 16
        below = cumulative(scale, ends_of_differences)
        expected = (below - below[0]) * (TOTAL - n) + np.arange(n)
        assert np.abs(tables.ends[row, :n] - expected).max() <= 1, (scale, part)


def test_the_escape_has_both_tails():
    """Among means of whole numbers: what lies beyond the reach on either side."""
    tables = laplace.tables()
    for scale in range(laplace.DIRECT + 1):
        row = scale * 16 + 8
        reach = tables.reach[row]
        share = 2 * cumulative(scale, np.array(-reach - 0.5))
        count = TOTAL - int(tables.ends[row, 2 * reach + 1])
        assert abs(count - 1 - share * (TOTAL - 2 * reach - 2)) <= 1


def test_tables_are_symmetric():
    """A mean as far above a whole number as another below it: mirrored, within rounding."""
    tables = laplace.tables()
    for scale in range(laplace.DIRECT + 1):
        n = 2 * laplace.reach_of(scale) + 1
        for part in range(1, 16):
            here, there = (np.diff(tables.ends[scale * 16 + p].astype(int))[:n]
                           for p in (part, 16 - part))  # fmt: skip
            assert np.abs(here - there[::-1]).max() <= 1


@pytest.mark.parametrize("scale", [0, 1, 17, 40, 48, 63])
def test_powers_do_not_drift(scale):
    exact = np.exp(-1 / (16 * np.exp(scale / 8 - 4))) ** np.arange(500)
    powers = laplace._powers(laplace.decay(scale))[:500]
    assert np.abs(powers / (1 << 30) - exact).max() < 1e-6


def test_low_bits_bring_all_scales_into_the_tables():
    """With no more bits than needed, and to the scale that so many halvings give."""
    for scale in range(laplace.SCALES):
        shift = int(laplace.SHIFTS[scale])
        index = scale - (11 * shift + 1) // 2
        assert 0 <= index <= laplace.DIRECT
        if shift:
            assert scale - (11 * (shift - 1) + 1) // 2 > laplace.DIRECT
            assert shift < SCALE_BITS
        assert abs(scale / 8 - shift * np.log(2) - index / 8) < 0.1


MEANS = st.integers(-(1 << 14), 1 << 14)
SCALES = st.integers(0, laplace.SCALES - 1)


@given(st.lists(st.tuples(MEANS, SCALES), min_size=1, max_size=30))
def test_latents_are_found_in_the_tables(cases):
    """Together as one by one: the row of the scale and the part, the values around the mean."""
    mean, scale = np.array(cases).T
    found = laplace.locate(mean, scale)
    for i, (m, s) in enumerate(cases):
        row, centre, shift = (int(v[i]) for v in found)
        assert [int(v[0]) for v in laplace.locate(mean[i : i + 1], scale[i : i + 1])] == [
            row, centre, shift,
        ]  # fmt: skip
        if s <= laplace.CERTAIN and abs(m) <= 4:
            assert row == -1
            continue
        assert shift == laplace.SHIFTS[s]
        assert row // 16 == s - (11 * shift + 1) // 2
        # Values centre 2**shift .. (centre + 1) 2**shift - 1; `part` says where the mean is.
        middle = (centre + 0.5 + (row % 16 - 8) / 16) * 2**shift - 0.5
        assert abs(middle - m / 16) <= 2 / 16 * 2**shift
        assert abs((m / 16 + 0.5) / 2**shift - centre - 0.5) <= 0.5 + 1 / 16
