"""Tracks: splines in whole numbers, and their coding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.animate.bake import bake
from proxyimg_codec.errors import FormatError, LimitError, UsageError
from proxyimg_codec.geometry import track
from proxyimg_codec.geometry.mesh import Base, Mesh
from proxyimg_codec.geometry.pose import POINT_MAX
from proxyimg_codec.geometry.track import SUM, Timeline, Track

LOOP = Timeline(2000, 24, True, 8, 3)
ONCE = Timeline(2000, 24, False, 8, 3)


def refined():
    """Nodes of four triangles around a vertex, one of them split."""
    base = Base(
        (0, 0), (1024, 1024),
        np.array([(0, 0), (24, 0), (24, 16), (0, 16), (10, 8)], np.uint8),
        np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], np.int32),
    )  # fmt: skip
    return Mesh.build(base).split([np.array([True, False, False, False])]).refined


def basis(x):
    """The uniform cubic B-spline over -2..2."""
    x = abs(x)
    return 2 / 3 - x * x + x**3 / 2 if x < 1 else max(2 - x, 0) ** 3 / 6


@given(st.integers(0, 1024))
def test_weights_are_those_of_the_spline(phase):
    found = track.weights(phase)
    assert found.sum() == SUM
    want = [basis(phase / 1024 + 1 - k) for k in range(4)]
    np.testing.assert_allclose(found / SUM, want, atol=1e-12)


@given(st.floats(-20, 20), st.sampled_from([LOOP, ONCE]))
def test_displacements_are_those_of_the_splines(seconds, timeline):
    rng = np.random.default_rng(3)
    curves = rng.integers(-256, 257, (3, timeline.coefficients))
    shapes = rng.integers(-200, 200, (3, 4, 2))
    t = seconds % 2 if timeline.loop else min(max(seconds, 0), 2)
    at = t / 2 * timeline.intervals
    values = np.zeros(3)
    for k in range(-4, timeline.intervals + 8):
        if timeline.loop or 0 <= k < timeline.coefficients:
            values += basis(at + 1 - k) * curves[:, k % timeline.coefficients] / 256
    got = Track(curves, shapes).at(timeline, seconds) / 1024
    # A phase is a 1024th of an interval, in which a curve changes by 2 at most.
    np.testing.assert_allclose(got, np.tensordot(values, shapes / 8, 1), atol=0.2)


def test_loops_close_and_others_stay_at_their_ends():
    rng = np.random.default_rng(1)
    curves, shapes = rng.integers(-256, 257, (2, 11)), rng.integers(-90, 90, (2, 5, 2))
    loop, once = Track(curves[:, :8], shapes), Track(curves, shapes)
    np.testing.assert_array_equal(loop.at(LOOP, 0), loop.at(LOOP, 2))
    np.testing.assert_array_equal(loop.at(LOOP, 0.3), loop.at(LOOP, -5.7))
    np.testing.assert_array_equal(once.at(ONCE, 2), once.at(ONCE, 99))
    np.testing.assert_array_equal(once.at(ONCE, 0), once.at(ONCE, -1))
    assert np.abs(once.at(ONCE, 2) - once.at(ONCE, 1.999)).max() < 256


@pytest.mark.parametrize("timeline", [LOOP, ONCE])
def test_tracks_survive_coding(timeline):
    rng = np.random.default_rng(2)
    nodes = refined()
    tracks = [
        Track(
            rng.integers(-high, high, (5, timeline.coefficients)),
            rng.integers(-high, high, (5, len(nodes.nodes), 2)),
        )
        for high in (3, 30000)
    ]
    again = track.decode(*track.encode([(t, nodes) for t in tracks]), 5, timeline, [nodes] * 2, "")
    for a, b in zip(tracks, again, strict=True):
        np.testing.assert_array_equal(a.curves, b.curves)
        np.testing.assert_array_equal(a.shapes, b.shapes)


@pytest.mark.parametrize(("curve", "shape"), [(track.CURVE_MAX, 0), (0, -track.SHAPE_MAX)])
def test_numbers_that_are_too_large_are_refused(curve, shape):
    nodes = refined()
    wrong = Track(np.full((1, 8), curve), np.full((1, len(nodes.nodes), 2), shape))
    with pytest.raises(FormatError, match="here: a curve or shape is out of range"):
        track.decode(*track.encode([(wrong, nodes)]), 1, LOOP, [nodes], "here")


def test_the_largest_numbers_do_not_overflow():
    high = Track(np.full((64, 8), track.CURVE_MAX - 1), np.full((64, 1, 2), track.SHAPE_MAX - 1))
    got = high.at(Timeline(1, 1, True, 8, 0), 0.0003)
    assert (got == POINT_MAX).all()
    low = Track(-high.curves, high.shapes).at(Timeline(1, 1, True, 8, 0), 0.0003)
    assert (low == -POINT_MAX).all()
    below = Track(np.full((64, 8), 4), np.full((64, 1, 2), track.SHAPE_MAX - 1))
    assert (below.at(Timeline(1, 1, True, 8, 0), 0.0003) == (track.SHAPE_MAX - 1) << 10).all()


def test_a_time_is_a_number():
    for wrong in ("nan", "-inf", "1e306"):
        with pytest.raises(UsageError, match="is not a time"):
            LOOP.taps(float(wrong))
    assert LOOP.taps(1e300)[0].max() < 8


def wave(count, loop):
    """Frames of six nodes that swing by up to 6 px, once and twice in two seconds."""
    t = np.arange(count)[:, None] / count * 2 * np.pi * (1 if loop else 0.8)
    phase = np.arange(6)
    x, y = 6 * np.sin(t + phase), 3 * np.cos(2 * t + phase / 2)
    return np.stack([x, y], 2)


@pytest.mark.parametrize("loop", [True, False])
def test_few_coefficients_come_near_the_frames(loop):
    frames = wave(48, loop)
    timeline, (one, two) = bake([frames[:, :4], frames[:, 4:]], fps=24, loop=loop)
    assert timeline.intervals < 20
    assert len(one.curves) < 8
    assert (timeline.duration, timeline.frames) == (2000, 48)
    for k in range(48):
        got = np.concatenate([p.at(timeline, k / 24) for p in (one, two)]) / 1024
        assert np.sqrt(((got - frames[k]) ** 2).sum(1).mean()) < 0.3


def test_flung_nodes_are_refused():
    with pytest.raises(LimitError, match="flung"):
        bake([wave(24, True) * 1e5], fps=24, loop=True)


def test_one_frame():
    timeline, (only,) = bake([wave(1, True)], fps=24, loop=True)
    np.testing.assert_allclose(only.at(timeline, 0) / 1024, wave(1, True)[0], atol=0.2)
