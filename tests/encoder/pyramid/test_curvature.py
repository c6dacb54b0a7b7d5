"""The curvature of the error that moves count on, against what a unit of a latent shows."""

import numpy as np
import pytest

from proxyimg_codec.encoder.pyramid import engine_native
from proxyimg_codec.encoder.pyramid.borders import ALPHA, COLOUR, RING, bordered
from proxyimg_codec.encoder.pyramid.curvature import bends, norms
from proxyimg_codec.encoder.pyramid.encode import Job, Raster
from proxyimg_codec.native import kernel

STEP = 256


@pytest.mark.parametrize("size", [64, 57, 3, 1])
def test_norms_are_one_inside_and_larger_or_smaller_where_lines_are_mirrored(size):
    found = norms(size, 3)
    assert [v.shape for v in found] == [(2, -(-size >> k)) for k in (1, 2, 3)]
    if size > 50:
        low, high = found[0]
        np.testing.assert_allclose(low[5:-5], low[6], rtol=1e-5)
        assert 0.9 < low[6] < 1.1
        assert 0.9 < high[6] < 1.1
        assert low[0] < 0.9 * low[6]  # half of the filter is beyond the border
        last = high[-1] if size % 2 == 0 else low[-1]
        assert abs(last - 1) > 0.1


@pytest.mark.skipif(not kernel.available(), reason="the kernel is not built")
def test_bends_are_those_of_the_synthesis_at_coarse_levels():
    """The learned filters of level 4 are nearly those of the wavelet; weights are smooth."""
    rows, columns = 66, 83
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    weight = 1 + (x + y) / 60
    busy = np.random.default_rng(1).normal(90, 25, (rows, columns, 3)) + x[..., None]
    job = Job(2, Raster(busy.astype(np.float32), weight), STEP, 1)
    goal = job._goal(job.windows()[0], job.latents)
    factors = bends((rows, columns), job.count, weight)
    gain = engine_native._weights(2, STEP)[3]["gain"]
    start = [np.rint(v) for v in job.latents]
    middle = engine_native.slopes(goal, start, 1)[0]
    for place in ((0, 0, 0), (0, 2, 3), (1, 0, 2), (2, 1, 4), (0, 4, 2)):
        errors = []
        for way in (1, -1):
            moved = [v.copy() for v in start]
            moved[3][place] += way
            errors.append(engine_native.slopes(goal, moved, 1)[0])
        bend = (sum(errors) - 2 * middle) / 2
        assert gain[place[0]] ** 2 * factors[3][place] == pytest.approx(bend, rel=0.2)


def test_smooth_borders_and_those_of_alpha_weigh_more():
    samples = np.full((120, 150, 3), 90, np.float32)
    samples[60:] += np.random.default_rng(0).normal(0, 60, (60, 150, 1))
    colour, alpha = (bordered(samples, None, kind, STEP) for kind in (False, True))
    assert colour[0, 75] == colour[30, -1] == 1 + COLOUR
    assert 1 < colour[-1, 75] < 1.1  # busy
    np.testing.assert_array_equal(colour[2 * RING : -2 * RING, 2 * RING : -2 * RING], 1)
    assert alpha[-1, 75] == alpha[RING - 1, 40] == 1 + ALPHA
    own = np.zeros((120, 150), np.float32)
    own[:, 75:] = 0.5
    np.testing.assert_array_equal(bordered(samples, own, True, STEP), own * alpha)


def test_no_picture_is_all_border():
    weights = bordered(np.zeros((40, 33, 3), np.float32), None, True, STEP)
    assert weights[20, 16] == 1


@pytest.mark.skipif(not kernel.available(), reason="the kernel is not built")
def test_samples_beyond_the_bounds_are_no_error():
    """They are shown as 0 or 255."""
    job = Job(2, Raster(np.full((33, 46, 3), 255, np.float32)), STEP, 1)
    goal = job._goal(job.windows()[0], job.latents)
    brighter = [np.rint(v) for v in job.latents]
    brighter[-1][0] += 9
    assert engine_native.slopes(goal, brighter, 1)[0] < 1e-3
    darker = [v.copy() for v in brighter]
    darker[-1][0] -= 30
    assert engine_native.slopes(goal, darker, 1)[0] > 100


def test_borders_count_in_ms_ssim_if_it_mirrors():
    """Without, the weight of the first column is that of the last sample of one window."""
    torch = pytest.importorskip("torch")
    from proxyimg_codec.encoder.pyramid.similarity import ms_ssim

    a = torch.rand(1, 3, 40, 31, generator=torch.Generator().manual_seed(0)) * 255
    less = []
    for column in (0, 15):
        b = a.clone()
        b[..., column] = 255 - b[..., column]
        less.append([1 - float(ms_ssim(a, b, mirror)) for mirror in (False, True)])
    (edge, mirrored), (inside, _) = less
    assert edge < 0.1 * inside
    assert mirrored > 0.15 * inside
