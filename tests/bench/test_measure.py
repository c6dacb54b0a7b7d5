import math

import numpy as np
import pytest

from proxyimg_codec.bench.measure import (
    PSNR_CAP,
    bd_rate,
    decibel,
    front,
    mean_square,
    ms_ssim,
    pchip,
    psnr,
    quality_at,
    smooth,
    ssim,
)
from tests.support.codecs import picture

CURVE = [(0.1, 26.0), (0.2, 28.4), (0.45, 31.9), (0.8, 34.2), (1.5, 37.5)]


def test_psnr_of_a_known_error():
    a = np.full((4, 6, 3), 100, np.uint8)
    b = a.copy()
    b[..., 0] += 3
    assert psnr(a, b) == pytest.approx(10 * math.log10(255**2 / 3))
    assert psnr(a, a) == PSNR_CAP
    b = a.copy()
    b[0, 0, 0] += 1
    assert psnr(a, b) == PSNR_CAP


def test_psnr_with_alpha_is_what_is_seen_on_black_and_on_white():
    a = np.full((4, 4, 4), 255, np.uint8)
    gone = a.copy()
    gone[..., 3] = 0
    # White that vanishes is wrong on black and right on white.
    assert psnr(a, gone) == pytest.approx(10 * math.log10(2))
    unseen = gone.copy()
    unseen[..., :3] = 7
    assert psnr(gone, unseen) == PSNR_CAP
    assert psnr(a[..., :3], gone) == psnr(a, gone)
    half = a.copy()
    half[..., :3], half[..., 3] = 60, 51
    other = half.copy()
    other[..., 0] = 160
    assert psnr(half, other) == pytest.approx(10 * math.log10(255**2 / ((100 * 51 / 255) ** 2 / 3)))


def test_ssim_of_known_pictures():
    a = np.full((20, 30, 3), 100, np.uint8)
    assert ssim(a, a) == pytest.approx(1)
    # Without contrast only the luminance term counts.
    b = a + np.uint8(50)
    c = (0.01 * 255) ** 2
    assert ssim(a, b) == pytest.approx((2 * 100 * 150 + c) / (100**2 + 150**2 + c))
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 40, 3)).astype(np.uint8)
    assert abs(ssim(*noise)) < 0.1
    assert math.isnan(ssim(a[:8], a[:8]))
    assert mean_square(a, b) == 2500


def slow_ms_ssim(x, y):
    """The formulas of Wang et al., window by window, for one channel of at least 176 pixels."""
    at = np.arange(11) - 5
    window = np.exp(-(at[:, None] ** 2 + at**2) / (2 * 1.5**2))
    window /= window.sum()
    result = 1.0
    for scale, weight in enumerate((0.0448, 0.2856, 0.3001, 0.2363, 0.1333)):
        u, v = (np.lib.stride_tricks.sliding_window_view(p, (11, 11)) for p in (x, y))
        mean_u, mean_v = ((p * window).sum((2, 3)) for p in (u, v))
        du, dv = u - mean_u[..., None, None], v - mean_v[..., None, None]
        var_u, var_v, cov = ((p * window).sum((2, 3)) for p in (du * du, dv * dv, du * dv))
        c1, c2 = 2.55**2, 7.65**2
        term = (2 * cov + c2) / (var_u + var_v + c2)
        if scale == 4:
            term = term * (2 * mean_u * mean_v + c1) / (mean_u**2 + mean_v**2 + c1)
        result *= term.mean() ** weight
        x, y = (p[: len(p) // 2 * 2, : p.shape[1] // 2 * 2] for p in (x, y))
        x, y = ((p[::2, ::2] + p[1::2, ::2] + p[::2, 1::2] + p[1::2, 1::2]) / 4 for p in (x, y))
    return result


def test_ms_ssim_is_the_formula():
    a = picture(1, 192, 176)
    b = np.clip(a + np.random.default_rng(0).normal(0, 20, a.shape), 0, 255).astype(np.uint8)
    channels = [slow_ms_ssim(a[..., c].astype(float), b[..., c].astype(float)) for c in range(3)]
    assert ms_ssim(a, b) == pytest.approx(np.mean(channels), abs=1e-9)
    assert len({round(c, 6) for c in channels}) == 3


@pytest.mark.parametrize("size", [(177, 181), (50, 90), (11, 11)])
def test_ms_ssim_falls_with_noise(size):
    a = picture(2, *size)
    noise = np.random.default_rng(3).normal(0, 1, a.shape)
    values = [ms_ssim(a, np.clip(a + s * noise, 0, 255).astype(np.uint8)) for s in (0, 4, 12, 40)]
    assert values[0] == pytest.approx(1)
    assert values == sorted(values, reverse=True)
    assert values[3] < 0.95


def test_ms_ssim_of_tiny_or_unlike_pictures():
    a = picture(4, 10, 30)
    assert math.isnan(ms_ssim(a, a))
    a = picture(4, 64, 64)
    assert ms_ssim(a, 255 - a) == 0
    assert decibel(0.99) == pytest.approx(20)
    assert decibel(1.0) == PSNR_CAP


def test_pchip_is_that_of_scipy():
    x, y = np.array([1.0, 2, 4, 7, 8]), np.array([0, 1, 1.5, 6, 6.2])
    scipy = [0.6026785714285714, 1.25487012987013, 2.7789196310935442, 6.139130434782609]
    assert pchip(x, y, np.array([1.5, 3, 5, 7.5])) == pytest.approx(scipy, abs=1e-14)
    y = np.array([0, 2, 2, 1, 0])
    at = np.linspace(1, 8, 300)
    values = pchip(x, y, at)
    assert (np.diff(values[at <= 2]) > 0).all()
    assert values[(at >= 2) & (at <= 4)] == pytest.approx(2)
    assert pchip(x[:2], y[:2], np.array([1.25])) == pytest.approx([0.5])


def test_bd_rate_of_scaled_rates():
    assert bd_rate(CURVE, CURVE) == 0
    less = [(0.9 * r, q) for r, q in CURVE]
    assert bd_rate(less, CURVE) == pytest.approx(-10, abs=1e-9)
    assert bd_rate(CURVE, less) == pytest.approx(100 / 9, abs=1e-9)
    assert bd_rate(less[::-1], CURVE) == pytest.approx(-10, abs=1e-9)
    assert bd_rate(less, CURVE, (0.15, 1.2)) == pytest.approx(-10, abs=1e-9)


def test_bd_rate_of_straight_lines():
    """Log rates differ by 0, 0.1, ... 0.4 where the quality is 30, 31, ... 34: 0.2 on average."""
    anchor = [(math.exp(0.2 * q - 6), q) for q in range(28, 35)]
    curve = [(math.exp(0.3 * q - 9), q) for q in range(30, 40)]
    assert bd_rate(curve, anchor) == pytest.approx(100 * (math.exp(0.2) - 1))


def test_bd_rate_looks_only_at_its_range():
    """Up to 0.45 bpp both are alike; above, one needs twice the bits."""
    worse = [(r if r <= 0.45 else 2 * r, q) for r, q in CURVE]
    assert bd_rate(worse, CURVE, (0.1, 0.2)) == pytest.approx(0, abs=1e-9)
    assert 20 < bd_rate(worse, CURVE) < 100


def test_bd_rate_of_curves_that_do_not_meet():
    far = [(r, q + 20) for r, q in CURVE]
    assert math.isnan(bd_rate(far, CURVE))
    assert math.isnan(bd_rate(CURVE[:1], CURVE))
    assert math.isnan(bd_rate([], CURVE))
    assert math.isnan(bd_rate(CURVE, CURVE, (2, 3)))


def test_points_that_others_beat_are_left_out():
    dented = [*CURVE, (0.5, 31.0), (0.6, math.nan), (0.45, 30.0), (1.6, 37.5)]
    assert front(dented) == CURVE
    assert bd_rate(dented, CURVE) == 0


def test_quality_at_a_rate():
    for rate, quality in CURVE:
        assert quality_at(CURVE, rate) == pytest.approx(quality, abs=1e-3)
    assert 28.4 < quality_at(CURVE, 0.3) < 31.9
    assert math.isnan(quality_at(CURVE, 0.09))
    assert math.isnan(quality_at(CURVE, 1.6))
    assert math.isnan(quality_at([], 1.0))
    line = smooth(CURVE)
    assert line[0] == pytest.approx(CURVE[0])
    assert line[-1] == pytest.approx(CURVE[-1])
    rate, quality = line[150]
    assert quality_at(CURVE, rate) == pytest.approx(quality, abs=1e-3)
    assert smooth(CURVE[:1]) == []
