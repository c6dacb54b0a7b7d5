import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.errors import FormatError
from proxyimg_codec.geometry.boundary import Boundary, decode, encode


@st.composite
def boundaries(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    spread = draw(st.sampled_from([3, 100, 5000, 200_000, 60_000_000]))
    paths = [
        rng.integers(-spread, spread, (3 * draw(st.integers(1, 6)), 2))
        for _ in range(draw(st.integers(1, 4)))
    ]
    return Boundary(draw(st.integers(0, 6)), tuple(paths))


@given(boundaries())
def test_paths_come_back(boundary):
    again = decode(encode(boundary), "x")
    assert again.unit == boundary.unit
    assert len(again.paths) == len(boundary.paths)
    for a, b in zip(again.paths, boundary.paths, strict=True):
        assert (a == b).all()


def test_whole_canvas_is_no_boundary():
    assert decode(encode(None), "x") is None


def test_eight_bit_deltas_take_little():
    """Local deltas below 256 need at most a class, a sign and seven bits each."""
    rng = np.random.default_rng(0)
    path = np.cumsum(rng.integers(-40, 40, (3 * 200, 2)), axis=0)
    fields = encode(Boundary(2, (path,)))
    assert len(fields["classes"]) + len(fields["deltas"]) < 1.3 * path.size


@pytest.mark.parametrize("field", ["classes", "deltas"])
def test_damage_is_found(field):
    path = np.array([[0, 0], [9, -4], [30, 1], [300, 40], [2, 7], [3, 3]])
    fields = encode(Boundary(0, (path,)))
    for data in (fields[field][:-1], fields[field] + b"\0"):
        with pytest.raises(FormatError):
            decode({**fields, field: data}, "x")


def test_far_points_are_refused():
    path = np.array([[(1 << 26), 0], [0, 0], [0, 0]])
    with pytest.raises(FormatError, match="range"):
        decode(encode(Boundary(0, (path,))), "x")
