import numpy as np
import pytest

from proxyimg_codec.encoder.implicit import fit
from proxyimg_codec.encoder.implicit.fit_native import NativeTrainer
from proxyimg_codec.encoder.implicit.fit_problem import build
from proxyimg_codec.encoder.implicit.fit_torch import TorchTrainer
from proxyimg_codec.encoder.implicit.state import best_steps, quantize
from proxyimg_codec.native import kernel
from proxyimg_codec.texture.network import NetShape
from tests.support.meshes import square

needs_kernel = pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")


def problem(channels=3, size=32, octaves=2):
    """Two layers with a soft-edged square; the picture has structure everywhere."""
    y, x = np.mgrid[0:size, 0:size] / size
    picture = np.stack([x, y, 0.5 + 0.4 * np.sin(9 * x + 5 * y), np.ones_like(x)], 2)
    if channels == 4:
        picture *= np.clip(1.2 - 1.5 * np.hypot(x - 0.5, y - 0.5), 0, 1)[..., None]
    outlines = [None, square(8, 6, 24, 25)]
    shape = NetShape(4, octaves, 8, 2, channels)
    return build(picture.astype(np.float32), outlines, shape, 5.0)


def batches(p, steps=3, batch=256):
    rng = np.random.default_rng(0)
    return np.sort(rng.integers(0, p.pixels, (steps, batch)).astype(np.int32), axis=1)


def after(trainer, p, bits=0, steps=3):
    state = fit.initial(p, 0)
    state.codes *= 20
    if bits:
        fit.choose_steps(p, state, bits, 8)
    rates = np.full(steps, 1e-3, np.float32)
    loss = trainer.run(state, batches(p, steps), rates, rates)
    return state, loss


@needs_kernel
@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("bits", [0, 4])
def test_kernel_and_torch_take_the_same_steps(channels, bits):
    """Adam's first steps have the size of the rate, so even the sign of a gradient shows."""
    p = problem(channels)
    steps = 1 if bits else 3  # rounding turns tiny differences into steps of a symbol
    (a, loss_a), (b, loss_b) = (
        after(t, p, bits, steps) for t in (NativeTrainer(p, 1), TorchTrainer(p, "cpu"))
    )
    assert loss_a == pytest.approx(loss_b, rel=1e-3)
    start = fit.initial(p, 0)
    moved = np.abs(a.weights - start.weights).max()
    assert moved > 0.9e-3
    for x, y in ((a.weights, b.weights), (a.codes, b.codes)):
        assert np.mean(np.abs(x - y) > 2e-4) < 0.02


@needs_kernel
def test_threads_do_not_change_the_result():
    p = problem()
    states = [after(NativeTrainer(p, jobs), p, steps=8)[0] for jobs in (1, 2, 3, 4)]
    for s in states[1:]:
        assert (s.codes == states[0].codes).all()
        assert (s.weights == states[0].weights).all()


@pytest.mark.parametrize("trainer", [pytest.param(NativeTrainer, marks=needs_kernel), TorchTrainer])
def test_training_lowers_the_loss_in_two_phases(trainer, monkeypatch):
    if trainer is TorchTrainer:
        monkeypatch.setattr(kernel, "available", lambda: False)
    p = problem(octaves=4)
    state = fit.fit(p, 240, 4, 8, seed=0)
    top = 1 << 3
    codes = quantize(state.codes, state.code_steps[0], 4)
    assert codes.min() >= -top
    assert codes.max() <= top - 1
    _, loss = (None, fit.make_trainer(p, "cpu", 1).run(
        state, batches(p, 1, 1024), np.zeros(1, np.float32), np.zeros(1, np.float32)))  # fmt: skip
    assert loss < 4e-3


def test_best_steps_minimize_the_error():
    values = np.random.default_rng(0).normal(0, 1, (3, 500)).astype(np.float32)
    steps = best_steps(values, 4)
    error = [
        ((quantize(values, s[:, None], 4) * s[:, None] - values) ** 2).sum()
        for s in (steps, 1.3 * steps, 0.75 * steps, np.abs(values).max(1) / 7)
    ]
    assert error[0] == min(error)


def test_quantize_clamps_and_rounds_half_to_even():
    values = np.array([-9.0, -8.4, 0.5, 1.5, 7.4, 99.0], np.float32)
    assert quantize(values, np.float32(1), 4).tolist() == [-8, -8, 0, 2, 7, 7]


def test_cost_a_pixel_does_not_grow():
    assert fit.batch_size(512 * 512) == 2048
    assert fit.batch_size(2040 * 1360) / (2040 * 1360) == pytest.approx(1 / 128, rel=0.02)
    assert fit.batch_size(10) == 256
