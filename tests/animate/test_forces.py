import numpy as np
import pytest

from proxyimg_codec.animate.forces import Curve, Wind, falloff
from proxyimg_codec.animate.motion_types import Handle, Key
from proxyimg_codec.animate.motion_types import Wind as Blow

GRID = np.stack(np.meshgrid(np.linspace(0, 400, 30), np.linspace(0, 300, 20))).reshape(2, -1)


def wind(seed=1, period=4.0, response=1.0, **values):
    full = {"scale": 150.0, "gust": 1.0, "across": 0.5, **values}
    return Wind(Blow(**full), GRID, np.full(GRID.shape[1], response), seed, period)


def test_a_looping_wind_repeats_and_another_does_not():
    looped, free = wind(), wind(period=None)
    for t in (0.0, 0.7, 3.9):
        np.testing.assert_allclose(looped.at(t), looped.at(t + 4), atol=1e-9)
        np.testing.assert_allclose(looped.at(t), looped.at(t - 8), atol=1e-9)
    assert np.abs(looped.at(0) - looped.at(2)).max() > 0.3
    assert np.abs(free.at(0) - free.at(4)).max() > 0.3


def test_gusts_have_the_strength_that_is_asked_for():
    times = np.linspace(0, 400, 2001)
    at = wind(period=None, across=0.2, strength=3.0)
    along, aside = np.array([at.at(t)[:, ::50] for t in times]).transpose(1, 0, 2)
    assert abs((along**2).mean() / (9 * 0.8) - 1) < 0.15
    assert abs((aside**2).mean() / (9 * 0.2) - 1) < 0.15
    assert abs(along.mean()) < 0.1


def test_a_wind_without_gusts_is_steady_in_its_direction():
    still = wind(gust=0.0, direction=(0.0, -2.0), strength=2.0, response=5.0)
    for t in (0.0, 1.3):
        np.testing.assert_allclose(still.at(t)[0], 0, atol=1e-9)
        np.testing.assert_allclose(still.at(t)[1], -10)


def test_wind_is_coherent_in_space_and_time():
    at = wind(scale=400.0)
    now = at.at(1.0).reshape(2, 20, 30)
    spread = now.std()
    assert np.sqrt((np.diff(now, axis=2) ** 2).mean()) < 0.8 * spread  # 1.4 if it were not
    assert np.abs(at.at(1.01) - at.at(1.0)).max() < 0.3 * spread


def test_seeds_differ_and_repeat():
    assert (wind(1).at(0.3) == wind(1).at(0.3)).all()
    assert np.abs(wind(1).at(0.3) - wind(2).at(0.3)).max() > 0.3


def test_impulses_fade_towards_their_radius():
    nodes = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [11.0, 0.0]])
    np.testing.assert_allclose(falloff(nodes, (0.0, 0.0), 10.0), [1, 0.5625, 0, 0])
    np.testing.assert_array_equal(falloff(nodes, None, None), np.ones(4))


@pytest.mark.parametrize("period", [4.0, None])
def test_curves_meet_their_keys(period):
    keys = (Key(0.5, (0.0, 0.0)), Key(1.5, (8.0, -4.0), 2.0, 90.0), Key(2.5, (1.0, 1.0)))
    for ease in ("linear", "smooth"):
        curve = Curve(Handle((0.0, 0.0), 5.0, keys, ease), period)
        for key in keys:
            offset, matrix = curve.at(key.time)
            np.testing.assert_allclose(offset, key.offset)
            across = [0, key.scale] if key.turn else [key.scale, 0]  # to the right, or down
            np.testing.assert_allclose(matrix[:, 0], across, atol=1e-12)
        np.testing.assert_allclose(curve.at(1.0)[0], (4.0, -2.0))
    quarter = curve.at(0.75)[0][0]
    assert quarter == pytest.approx(8 * 0.15625)  # smooth: 3 t^2 - 2 t^3
    before, after = curve.at(0.0)[0], curve.at(3.5)[0]
    if period is None:
        np.testing.assert_allclose([before, after], [(0, 0), (1, 1)])
    else:
        np.testing.assert_allclose(after, curve.at(7.5)[0])
        np.testing.assert_allclose(after, curve.at(-0.5)[0])
        np.testing.assert_allclose(after, (0.5, 0.5))  # half way from the last key to the first
