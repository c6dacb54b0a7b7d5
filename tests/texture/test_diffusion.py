import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.texture.diffusion import FRACTION_BITS, fill

ONE = 1 << FRACTION_BITS


@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_stored_codes_stay_and_others_lie_between(height, width, seed):
    rng = np.random.default_rng(seed)
    codes = rng.integers(-8, 8, (3, height, width))
    stored = rng.random((height, width)) < 0.3
    stored[rng.integers(height), rng.integers(width)] = True
    out = fill(codes, stored)
    assert (out[:, stored] == codes[:, stored] * ONE).all()
    kept = codes[:, stored]
    assert (out >= kept.min(1)[:, None, None] * ONE).all()
    assert (out <= kept.max(1)[:, None, None] * ONE).all()


def test_a_hole_in_a_ramp_is_bridged_smoothly():
    codes = np.tile(np.arange(-8, 8), (16, 1))[None]
    stored = np.ones((16, 16), bool)
    stored[:, 5:11] = False
    row = fill(codes, stored)[0, 8] / ONE
    assert (np.diff(row) > 0).all()
    assert np.abs(row - codes[0, 8]).max() < 1.5


def test_known_values():
    """The fill is normative: these numbers are part of the format."""
    codes = np.zeros((1, 4, 5), np.int64)
    codes[0, 0, 0], codes[0, 3, 4] = 7, -8
    stored = codes[0] != 0
    assert fill(codes, stored)[0].tolist() == KNOWN


KNOWN = [
    [1792, 1014, 435, -26, -304],
    [1146, 760, 275, -199, -527],
    [811, 525, 54, -515, -1037],
    [654, 383, -130, -890, -2048],
]


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1)])
def test_thin_planes(shape):
    stored = np.zeros(shape, bool)
    stored[0, 0] = True
    assert (fill(np.full((2, *shape), 3), stored) == 3 * ONE).all()
