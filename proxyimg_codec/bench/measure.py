"""Quality of decoded pictures, and comparison of rate-distortion curves (BD-rate).

Pictures are uint8 [H, W, 3] RGB, or [H, W, 4] RGB with straight alpha. A picture with alpha is
judged over black and over white, and the two results are averaged. So errors of alpha count, and
the colour of invisible pixels does not.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]
Floats = NDArray[np.float64]

PSNR_CAP = 60.0
"""Upper bound of PSNR in dB, and its value for an exact picture; that of libvmaf for 8 bits."""

SCALE_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of MS-SSIM, finest scale first (Wang, Simoncelli and Bovik 2003)."""

WINDOW = 11
"""Side of the Gaussian window of SSIM in pixels; its standard deviation is 1.5."""


def psnr(a: Pixels, b: Pixels) -> float:
    """PSNR in dB of two pictures of the same size over all RGB samples, at most `PSNR_CAP`."""
    error = mean_square(a, b)
    return min(PSNR_CAP, 10 * math.log10(255**2 / error)) if error else PSNR_CAP


def mean_square(a: Pixels, b: Pixels) -> float:
    """Mean squared error of two pictures of the same size over all RGB samples of 0..255."""
    errors = [float(((x - y) ** 2).mean()) for x, y in _seen(a, b)]
    return sum(errors) / len(errors)


def ssim(a: Pixels, b: Pixels) -> float:
    """SSIM of two pictures of the same size (Wang et al. 2004), the mean of the RGB channels.

    Returns:
        The index, at most 1; NaN if the picture is smaller than the window.
    """
    if min(a.shape[:2]) < WINDOW:
        return math.nan
    values = [float(np.prod(_ssim(x, y), 0).mean()) for x, y in _seen(a, b)]
    return sum(values) / len(values)


def ms_ssim(a: Pixels, b: Pixels) -> float:
    """MS-SSIM of two pictures of the same size (Wang, Simoncelli and Bovik 2003).

    There are five scales, each half as large as the one before. A picture whose shorter side is
    below 176 pixels has only those that hold the window, with exponents scaled to the same sum. A
    negative structure term counts as 0.

    Returns:
        The mean of the indices of the RGB channels, 0..1; NaN if the picture is smaller than the
        window.
    """
    values = [_ms_ssim(x, y) for x, y in _seen(a, b)]
    return sum(values) / len(values)


def ssimulacra2(a: Pixels, b: Pixels) -> float:
    """SSIMULACRA 2 of two pictures of the same size, by the package of that name.

    It was fitted to what people say of compressed photographs: 90 cannot be told from the original
    side by side, 70 is good, 50 is poor.

    Returns:
        The score, at most 100; NaN if a side is below 8 pixels.
    """
    from PIL import Image
    from ssimulacra2 import compute_ssimulacra2

    if min(a.shape[:2]) < 8:
        return math.nan
    scores = []
    for pair in _seen(a, b):
        files = io.BytesIO(), io.BytesIO()
        for pixels, file in zip(pair, files, strict=True):
            Image.fromarray(np.rint(pixels).astype(np.uint8)).save(file, "BMP")
        scores.append(float(compute_ssimulacra2(*files)))
    return sum(scores) / len(scores)


def decibel(index: float) -> float:
    """MS-SSIM in dB, where equal steps look alike: −10·log10(1 − index), at most `PSNR_CAP`."""
    return min(PSNR_CAP, -10 * math.log10(max(1 - index, 1e-9)))


def _seen(a: Pixels, b: Pixels) -> list[tuple[Floats, Floats]]:
    """Pairs of opaque pictures to compare, 0..255: one, or two over black and white."""
    if a.shape[2] == b.shape[2] == 3:
        return [(a.astype(np.float64), b.astype(np.float64))]
    return [(_over(a, ground), _over(b, ground)) for ground in (0.0, 255.0)]


def _over(pixels: Pixels, ground: float) -> Floats:
    colour = pixels[..., :3].astype(np.float64)
    if pixels.shape[2] == 3:
        return colour
    alpha = pixels[..., 3:] / 255.0
    return np.asarray(colour * alpha + ground * (1 - alpha))


def _ms_ssim(x: Floats, y: Floats) -> float:
    scales = 0
    while scales < len(SCALE_WEIGHTS) and min(x.shape[:2]) >> scales >= WINDOW:
        scales += 1
    if not scales:
        return math.nan
    weights = np.array(SCALE_WEIGHTS[:scales]) / sum(SCALE_WEIGHTS[:scales]) * sum(SCALE_WEIGHTS)
    index = np.ones(x.shape[2])
    for scale, weight in enumerate(weights):
        luminance, structure = _ssim(x, y)
        factor = structure * luminance if scale == scales - 1 else structure
        index *= np.maximum(factor.mean((0, 1)), 0) ** weight
        if scale < scales - 1:
            x, y = _halved(x), _halved(y)
    return float(index.mean())


def _ssim(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Luminance term, and product of contrast and structure, at pixels where the window fits."""
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    mx, my = _blurred(x), _blurred(y)
    vx, vy, vxy = _blurred(x * x) - mx * mx, _blurred(y * y) - my * my, _blurred(x * y) - mx * my
    luminance = (2 * mx * my + c1) / (mx * mx + my * my + c1)
    return luminance, (2 * vxy + c2) / (vx + vy + c2)


def _blurred(x: Floats) -> Floats:
    half = WINDOW // 2
    kernel = np.exp(-(np.arange(-half, half + 1) ** 2) / (2 * 1.5**2))
    kernel /= kernel.sum()
    out = np.asarray(cv2.sepFilter2D(x, cv2.CV_64F, kernel, kernel), np.float64)
    return out[half:-half, half:-half]


def _halved(x: Floats) -> Floats:
    """Means of 2x2 pixels; the last row or column of an odd size is dropped."""
    h, w = (n // 2 * 2 for n in x.shape[:2])
    return np.asarray(x[:h, :w].reshape(h // 2, 2, w // 2, 2, -1).mean((1, 3)))


def bd_rate(
    curve: Sequence[tuple[float, float]],
    anchor: Sequence[tuple[float, float]],
    rates: tuple[float, float] = (0.0, math.inf),
) -> float:
    """Bjøntegaard delta rate: extra bits of a codec over an anchor at equal quality, in per cent.

    The mean difference of log rate (VCEG-M33, 2001), with monotone cubic interpolation of log rate
    over quality (VCEG-AI11, and the pchip of the JVET tools), over all qualities that both curves
    reach at a rate within `rates`.

    Args:
        curve: Pairs of rate > 0 and quality in dB, in any order. Points that cost more than
            another point and are no better are left out.
        anchor: Pairs of the codec to compare with.
        rates: Least and greatest rate to consider.

    Returns:
        The difference in per cent, negative if the codec is better; NaN if the curves have no
        quality in common, or one of them has fewer than two points.
    """
    spans = [_span(front(c), rates) for c in (curve, anchor)]
    low, high = max(s[0] for s in spans), min(s[1] for s in spans)
    if not low < high:
        return math.nan
    quality = np.linspace(low, high, 1001)
    logs = [_log_rate(front(c), quality) for c in (curve, anchor)]
    difference = logs[0] - logs[1]
    mean = float((difference[1:] + difference[:-1]).mean() / 2)
    return 100 * (math.exp(mean) - 1)


def quality_at(curve: Sequence[tuple[float, float]], rate: float) -> float:
    """Quality in dB of a curve at a rate, interpolated as in `bd_rate`; NaN beyond its ends."""
    points = front(curve)
    if not points or not points[0][0] <= rate <= points[-1][0]:
        return math.nan
    return points[0][1] if len(points) == 1 else _quality(points, rate)


def smooth(curve: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points (rate, quality) of the interpolated curve that `bd_rate` compares, at 400 qualities.

    Empty if the curve has fewer than two points.
    """
    points = front(curve)
    if len(points) < 2:
        return []
    quality = np.linspace(points[0][1], points[-1][1], 400)
    rate = np.exp(_log_rate(points, quality))
    return list(zip(rate.tolist(), quality.tolist(), strict=True))


def front(curve: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Finite points of a curve that are better than all cheaper ones, by ascending rate."""
    kept: list[tuple[float, float]] = []
    for rate, quality in sorted(curve, key=lambda p: (p[0], -p[1])):
        if math.isfinite(quality) and (not kept or quality > kept[-1][1]):
            kept.append((rate, quality))
    return kept


def _span(points: Sequence[tuple[float, float]], rates: tuple[float, float]) -> tuple[float, float]:
    """Least and greatest quality of a curve within the rates; (inf, -inf) if there is none."""
    if len(points) < 2 or points[0][0] > rates[1] or points[-1][0] < rates[0]:
        return math.inf, -math.inf
    low = points[0][1] if rates[0] <= points[0][0] else _quality(points, rates[0])
    high = points[-1][1] if rates[1] >= points[-1][0] else _quality(points, rates[1])
    return low, high


def _quality(points: Sequence[tuple[float, float]], rate: float) -> float:
    """Quality at which a curve has a rate between those of its ends."""
    grid = np.linspace(points[0][1], points[-1][1], 4001)
    return float(np.interp(math.log(rate), _log_rate(points, grid), grid))


def _log_rate(points: Sequence[tuple[float, float]], quality: Floats) -> Floats:
    x = np.array([q for _, q in points])
    return pchip(x, np.log([r for r, _ in points]), quality)


def pchip(x: Floats, y: NDArray[Any], at: Floats) -> Floats:
    """Monotone cubic interpolation (Fritsch and Butland 1984; ends as in Moler's pchip).

    Args:
        x: float64 [n] increasing knots, n >= 2.
        y: Values [n] at the knots.
        at: float64 [m] positions between the first and the last knot.

    Returns:
        float64 [m] values at these positions.
    """
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    tangent = np.full(len(x), slope[0])
    if len(x) > 2:
        w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        same = slope[:-1] * slope[1:] > 0
        safe = np.where(slope == 0, 1.0, slope)
        tangent[1:-1] = np.where(same, (w1 + w2) / (w1 / safe[:-1] + w2 / safe[1:]), 0.0)
        tangent[0] = _end(h[0], h[1], slope[0], slope[1])
        tangent[-1] = _end(h[-1], h[-2], slope[-1], slope[-2])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    t = (at - x[i]) / h[i]
    rise = t * t * (3 - 2 * t)
    bend = t * (1 - t) * h[i] * ((1 - t) * tangent[i] - t * tangent[i + 1])
    return np.asarray(y[i] + (y[i + 1] - y[i]) * rise + bend)


def _end(h0: float, h1: float, s0: float, s1: float) -> float:
    """Tangent at an end, from three points, limited so that the curve stays monotone."""
    tangent = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if tangent * s0 <= 0:
        return 0.0
    return 3 * s0 if s0 * s1 < 0 and abs(tangent) > 3 * abs(s0) else tangent
