"""The model in torch against what the decoder does, and against the mathematics behind it."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from torch.nn import functional

from proxyimg_codec.encoder.pyramid import rate
from proxyimg_codec.encoder.pyramid.load import load, native_bfloat16
from proxyimg_codec.encoder.pyramid.model import LEVELS, Model, plain_synthesis
from proxyimg_codec.encoder.pyramid.similarity import ms_ssim
from proxyimg_codec.entropy import laplace
from proxyimg_codec.texture import context, registered_model
from proxyimg_codec.texture.grid import Grid
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.planes import encoded
from tests.support.pyramids import synthesized

STEP = 300
conv2d = functional.conv2d


@pytest.fixture(scope="module")
def shipped():
    return load(1)


@pytest.fixture
def exact(shipped):
    """The model with float32 convolutions and whole activations, as in the decoder."""
    shipped.set_mode(fast=False, integer=True)
    yield shipped
    shipped.set_mode(fast=native_bfloat16(), integer=False)


def picture(height=128, width=192):
    y, x = np.mgrid[:height, :width]
    planes = [120 + 90 * np.sin(x / 9 + y / 23), 40 + x, 200 - 0.5 * y + 20 * np.cos(x / 3)]
    planes[0][30:70, 40:90] = 220
    return torch.from_numpy(np.stack(planes).astype(np.float32))[None].clamp(0, 255)


def latents_of(net, size=(128, 192)):
    with torch.no_grad():
        return [torch.round(y) for y in net.analyse(picture(*size), step_of(STEP), 4)]


def step_of(index):
    return torch.tensor([2.0 ** (index / 64)])


def whole(latents):
    arrays = [y[0].numpy().astype(np.int32) for y in latents]
    return Latents(tuple(arrays[:-1]), arrays[-1])


@pytest.mark.parametrize("size", [(128, 192), (127, 193), (50, 99), (33, 17), (2, 5), (1, 70)])
def test_untrained_transform_reconstructs_perfectly(size):
    net = Model()
    shown = picture(*size)
    with torch.no_grad():
        found = net.analyse(shown, step_of(256), LEVELS - 1)
        back = net.synthesise(found, step_of(256), size)
    assert (back - shown).abs().max() < 1e-3


@pytest.mark.parametrize("size", [(128, 192), (125, 154)])
def test_synthesis_is_the_decoders(exact, size):
    found = latents_of(exact, size)
    with torch.no_grad():
        ours = exact.synthesise(found, step_of(STEP), size)[0].permute(1, 2, 0).numpy()
    own = whole(found)
    weights, grid = registered_model.registered(2), Grid(size[::-1], 4)
    theirs = synthesized(weights, grid, own, STEP)
    assert np.abs(ours - theirs).max() < 0.01


def test_bfloat16_hardly_changes_the_picture(shipped):
    found = latents_of(shipped)
    with torch.no_grad():
        now = {}
        for fast in (True, False):
            shipped.set_mode(fast=fast)
            now[fast] = shipped.synthesise(found, step_of(STEP), (128, 192))
        shipped.set_mode(fast=native_bfloat16())
    assert 0 < (now[True] - now[False]).abs().max() < 1


@pytest.mark.parametrize(
    ("capabilities", "fast"),
    [
        ({"avx2": True, "avx512_f": True, "avx512_bf16": False, "amx_bf16": False}, False),
        ({"avx512_bf16": True, "amx_bf16": False}, True),
        ({"avx512_bf16": False, "amx_bf16": True}, True),
        ({"architecture": "arm64", "neon": True, "bf16": True}, False),
        (None, False),
    ],
)
def test_bfloat16_is_used_where_the_processor_has_it(monkeypatch, capabilities, fast):
    if capabilities is None:  # older versions of torch do not tell
        monkeypatch.delattr(torch.cpu, "get_capabilities", raising=False)
    else:
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities, raising=False)
    seen = []
    monkeypatch.setattr(
        functional, "conv2d", lambda x, *a, **k: seen.append(x.dtype) or conv2d(x, *a, **k)
    )
    model = load.__wrapped__(1)
    with torch.no_grad():
        model.likelihoods(latents_of(model), step_of(STEP))
    assert (torch.bfloat16 in seen) == fast


@pytest.mark.parametrize("size", [(24, 32), (23, 31), (24, 31)])
def test_plain_wavelet_is_the_decoders_within_its_rounding(size):
    rng = np.random.default_rng(3)
    low = rng.integers(-300, 300, (3, 12, 16)).astype(np.int32)
    high = rng.integers(-20, 20, (9, 12, 16)).astype(np.int32)
    theirs = context.next_plain(low << 4, high, size) / 16
    tensors = (torch.from_numpy(a.astype(np.float32))[None] for a in (low, high))
    ours = plain_synthesis(*tensors, size)[0].numpy()
    # Taps are rounded to 1/256.
    assert np.abs(ours - theirs).max() < 3
    assert np.abs(ours - theirs).mean() < 0.5


class Recorder:
    """An entropy coder that notes distributions."""

    def __init__(self):
        self.means, self.scales = [], []

    def code(self, values, mean, scale):
        self.means.append(mean)
        self.scales.append(scale)
        return values


def test_context_network_is_the_decoders_up_to_rounding(exact):
    found = latents_of(exact)
    with torch.no_grad():
        likely = exact.likelihoods(found, step_of(STEP))
    own = whole(found)
    k = 2  # level 3: what its plain plane is made of is exact in both
    plain = own.lowest << 4
    for level in (4,):
        plain = context.next_plain(plain, own.levels[level - 1], own.levels[k].shape[1:])
    recorder = Recorder()
    bands = np.full(own.levels[k].shape[1:], 7, np.uint8)
    coder = context.LevelCoder(registered_model.registered(2).context[k], STEP, False, (0, 0))
    coder.code(recorder, plain, own.levels[k + 1], bands, own.levels[k])
    mean = np.concatenate([m.reshape(-1, 3) for m in recorder.means[::2]])
    scale = np.concatenate([m.reshape(-1, 3) for m in recorder.scales[::2]])
    order = [w.rows * bands.shape[1] + w.columns for w in context.waves(bands > 0)]
    at = np.concatenate(order)
    ours_mean = likely[k].mean[0, :3].reshape(3, -1).T.numpy()[at] * 16
    ours_scale = likely[k].log_scale[0, :3].reshape(3, -1).T.numpy()[at] * 8 + 32
    assert np.abs(ours_mean - mean).mean() < 0.5
    assert np.abs(ours_scale - scale).mean() < 0.5


def test_bits_predict_the_size_of_the_stream(exact):
    found = latents_of(exact)
    with torch.no_grad():
        likely = exact.likelihoods(found, step_of(STEP))
        bits = sum(
            float(rate.bits_of_integers(y, *p).sum()) for y, p in zip(found, likely, strict=False)
        )
    coded = encoded(whole(found), (192, 128), STEP)
    lowest = 8 * found[-1].numel()
    assert 8 * len(coded.packed["data"]) == pytest.approx(bits + lowest, rel=0.1)


def test_gradients_of_bits():
    torch.manual_seed(0)
    offset = (2 * torch.randn(60, dtype=torch.double)).requires_grad_()
    scale = (0.7 * torch.randn(60, dtype=torch.double)).requires_grad_()
    assert torch.autograd.gradcheck(rate._Bits.apply, (offset, scale))


def test_bits_are_those_of_the_tables():
    tables = laplace.tables()
    for scale in (12, 24, 40):
        mean = np.array([-9, 0, 5])
        at = laplace.locate(mean, np.full(3, scale))
        for n in (-2, -1, 0, 1, 3):
            symbol = n - at.centre + tables.reach[at.row]
            ends = tables.ends[at.row, symbol + 1].astype(int) - tables.ends[at.row, symbol]
            table = 14 - np.log2(ends)
            values = torch.full((3,), float(n), dtype=torch.double)
            ours = rate.bits_of_integers(
                values, torch.from_numpy(mean / 16.0), torch.full_like(values, scale / 8 - 4)
            )
            rare = ends < 8
            np.testing.assert_allclose(ours.numpy()[~rare], table[~rare], atol=0.1)


def test_around_is_bits_at_neighbours():
    torch.manual_seed(1)
    values = torch.randint(-6, 7, (500,)).double()
    mean, scale = torch.randn(500).double() * 2, torch.randn(500).double() * 0.5

    def at(move):
        return rate.bits_of_integers(values + move, mean, scale)

    torch.testing.assert_close(rate.bits_at(values - mean, scale), at(0), atol=1e-4, rtol=1e-4)
    found = rate.around(values, mean, scale)
    for ours, move in ((found.here, 0), (found.below, -1), (found.above, 1)):
        torch.testing.assert_close(ours, at(move), atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(found.slope, (at(1e-5) - at(-1e-5)) / 2e-5, atol=1e-3, rtol=1e-3)


def test_structural_similarity_is_the_benchmarks():
    measure = pytest.importorskip("proxyimg_codec.bench.measure")
    a = picture(256, 192)
    b = (a + 9 * torch.sin(torch.arange(192) / 2)).clamp(0, 255).round()
    arrays = [np.ascontiguousarray(t[0].permute(1, 2, 0).numpy().round().astype(np.uint8))
              for t in (a, b)]  # fmt: skip
    tensors = [torch.from_numpy(v.astype(np.float32)).permute(2, 0, 1)[None] for v in arrays]
    assert float(ms_ssim(*tensors)) == pytest.approx(measure.ms_ssim(*arrays), abs=1e-4)


@pytest.mark.parametrize(("width", "height"), [(2, 2), (4, 6), (8, 8), (10, 11), (2, 64)])
def test_structural_similarity_of_small_pictures(width, height):
    """The window is no larger than the picture."""
    a = torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(5)) * 255
    noise = torch.rand(a.shape, generator=torch.Generator().manual_seed(6)) - 0.5
    values = [float(ms_ssim(a, a + s * noise)) for s in (0, 20, 80, 200)]
    assert values[0] == pytest.approx(1)
    assert all(one > other for one, other in pairwise(values))


def test_levels_halve_the_step():
    """The networks see the step in halves of octaves from 2**(293 / 64)."""
    from proxyimg_codec.encoder.pyramid.model import log_step

    assert float(log_step(step_of(293))) == pytest.approx(0, abs=1e-6)
    assert float(log_step(step_of(293 + 64))) == pytest.approx(0.5, abs=1e-6)
    assert math.isclose((293 + 64 - registered_model.STEP_ORIGIN) / 128, 0.5)
