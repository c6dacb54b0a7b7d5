"""The compiled engine of the encoder against that in torch, its judge."""

import ctypes as ct
import subprocess
import sys

import numpy as np
import pytest
import torch

from proxyimg_codec.encoder.pyramid import encode as pyramid
from proxyimg_codec.encoder.pyramid import engine_native, engine_torch, rate, refine
from proxyimg_codec.encoder.pyramid.encode import Job, Raster
from proxyimg_codec.encoder.pyramid.goal import Effort
from proxyimg_codec.encoder.pyramid.load import load, native_bfloat16
from proxyimg_codec.native import kernel

pytestmark = pytest.mark.skipif(not kernel.available(), reason="the kernel is not built")
STEP = 230
CASES = {
    "whole": ((96, 64), {}),
    "odd": ((97, 51), {}),
    "weighted": ((75, 58), {"weighted": True}),
    "support": ((130, 75), {"cells": True}),
    "grey": ((41, 66), {"grey": True}),
    "window": ((90, 61), {"partial": True}),
    "column": ((1, 33), {}),
    "tiny": ((5, 3), {}),
}


@pytest.fixture(autouse=True)
def exact():
    """float32 in torch too."""
    load(2).set_mode(fast=False)
    yield
    load(2).set_mode(fast=native_bfloat16())


def raster(size, weighted=False, cells=False, grey=False):
    w, h = size
    rng = np.random.default_rng(w)
    y, x = np.mgrid[:h, :w]
    samples = np.stack([120 + 90 * np.sin(x / 9 + y / 23), 40 + x / 3, 200 - y / 2], 2)
    samples[h // 4 : h // 2, w // 4 : w // 2] = 220
    samples = np.clip(samples + rng.normal(0, 6, samples.shape), 0, 255).astype(np.float32)
    if grey:
        samples[:] = samples[..., :1]
    weight = rng.random((h, w)).astype(np.float32) if weighted else None
    held = None
    if cells:
        held = np.zeros((-(-h // 8), -(-w // 8)), bool)
        held[:, : held.shape[1] // 2] = True
    return Raster(samples, weight, held, grey)


def case(name):
    """Job, goal and integer latents of a case."""
    size, options = CASES[name]
    partial = options.pop("partial", False) if (options := dict(options)) else False
    job = Job(2, raster(size, **options), STEP, 1)
    goal = job._goal(job.windows()[0], job.latents)
    if partial:
        rng = np.random.default_rng(1)
        goal = goal._replace(free=[rng.random(y.shape) < 0.6 for y in job.latents])
    return job, goal, [np.rint(y) for y in job.latents]


@pytest.mark.parametrize("name", CASES)
def test_cost_and_slopes_are_those_of_torch(name):
    _, goal, latents = case(name)
    error, bits, found = engine_native.slopes(goal, latents, 2)
    target = engine_torch.target_of(goal)
    ys = [engine_torch.tensor(y).requires_grad_() for y in latents]
    cost = refine.cost(load(2), target, ys, smooth=False)
    slopes = torch.autograd.grad(cost.total, ys)
    assert error == pytest.approx(cost.error.item(), rel=1e-4)
    assert bits == pytest.approx(cost.spent.item(), rel=1e-4)
    for k, (mine, theirs) in enumerate(zip(found, slopes, strict=True)):
        wanted = theirs
        if k < len(cost.likely):  # without what a latent's own bits give
            own = goal.price * rate.around(ys[k].detach(), *cost.likely[k]).slope
            wanted = theirs - (own if target.support is None else own * target.support[k])
        wanted = wanted[0].numpy()
        # Where an activation is within rounding of its bound, one passes a gradient, the other not.
        off, most = np.abs(mine - wanted), max(1, np.abs(wanted).max())
        assert np.quantile(off, 0.99) < 1e-3 * most
        assert off.max() < 0.03 * most


@pytest.mark.parametrize("name", CASES)
def test_latents_are_those_of_torch(name):
    job, goal, _ = case(name)
    found = engine_torch.analysed(2, job.picture, STEP, job.grid, 1)
    for mine, theirs in zip(job.analysis(job.picture), found, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=2e-3)
    for rounds in (1, 5):
        effort = Effort(0, rounds)
        ours, theirs = (
            e.improved(goal, job.latents, effort, 0, 1, lambda: None)[0]
            for e in (engine_native, engine_torch)
        )
        # Sums in another order decide a move differently now and then.
        differ = sum((a != b).sum() for a, b in zip(ours, theirs, strict=True))
        assert differ <= 0.002 * sum(y.size for y in ours)
        costs = [engine_native.slopes(goal, y, 1)[:2] for y in (ours, theirs)]
        (a, b), (c, d) = costs
        assert a + goal.price * b == pytest.approx(c + goal.price * d, rel=1e-3)


def test_threads_do_not_change_latents():
    job, goal, latents = case("support")
    one, more = (
        engine_native.improved(goal, latents, Effort(0, 4), 0, n, lambda: None)[0] for n in (1, 3)
    )
    for a, b in zip(one, more, strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(job.latents, Job(2, job.raster, STEP, 3).latents, strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_may_not_move_stays():
    _, goal, latents = case("window")
    found, _ = engine_native.improved(goal, latents, Effort(0, 6), 0, 1, lambda: None)
    moved = 0
    for free, a, b in zip(goal.free, latents, found, strict=True):
        np.testing.assert_array_equal(a[~free], b[~free])
        moved += (a != b).sum()
    assert moved > 50


def test_an_interrupt_ends_rounds_and_keeps_the_best():
    _, goal, latents = case("whole")
    ticks = []

    def tick():
        ticks.append(1)
        if len(ticks) == 2:
            raise KeyboardInterrupt

    found, raised = engine_native.improved(goal, latents, Effort(0, 9), 0, 1, tick)
    assert isinstance(raised, KeyboardInterrupt)
    assert len(ticks) == 2
    two, _ = engine_native.improved(goal, latents, Effort(0, 2), 0, 1, lambda: None)
    for a, b in zip(found, two, strict=True):
        np.testing.assert_array_equal(a, b)


def test_structures_mirror_those_of_the_kernel():
    assert ct.sizeof(engine_native._Weights) == 21 * 8 + 16
    _, goal, latents = case("whole")
    wrong = goal._replace(support=[y.astype(np.float64) for y in latents])
    with pytest.raises(ValueError, match="float32"):
        engine_native.improved(wrong, latents, Effort(0, 1), 0, 1, lambda: None)


def test_without_the_kernel_torch_does_the_work(monkeypatch):
    monkeypatch.setattr(kernel, "library", lambda: None)
    assert pyramid.engine() is engine_torch


def test_pyramids_need_no_torch():
    script = """
import sys
sys.modules["torch"] = None
import numpy, proxyimg_codec as pxi
y, x = numpy.mgrid[:40, :50]
picture = numpy.stack([y * 5, x * 5, x * y % 256], 2).astype(numpy.uint8)
image = pxi.encode(picture, max_layers=1, texture="pyramid")
assert len(image.to_bytes()) > 100
try:
    pxi.encode(picture, max_layers=1, texture="pyramid", tune="ms-ssim")
except pxi.PxiError as error:
    assert "torch" in str(error), error
else:
    raise AssertionError
"""
    subprocess.run([sys.executable, "-c", script], check=True)
