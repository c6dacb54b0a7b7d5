"""Pictures through the pyramid encoder and back."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import torch

from proxyimg_codec import encode, from_bytes
from proxyimg_codec.encoder.pyramid import encode as pyramid
from proxyimg_codec.encoder.pyramid import (
    engine_native,
    engine_torch,
    goal,
    rate,
    refine,
    window,
)
from proxyimg_codec.encoder.pyramid.encode import Effort, Raster
from proxyimg_codec.encoder.pyramid.load import load
from proxyimg_codec.encoder.pyramid.shifts import SHIFTS
from proxyimg_codec.encoder.pyramid.window import Window
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.errors import UsageError
from proxyimg_codec.render.quality import psnr
from proxyimg_codec.texture import registered_model
from proxyimg_codec.texture.pyramid import PyramidTexture

FAST = {"texture": "pyramid", "effort": 1, "jobs": 1}


def textured(width, height, seed=0):
    """A smooth uint8 picture with detail."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    base = np.stack([90 + 60 * np.sin(x / 11), 60 + 120 * y / height, 130 + 50 * np.cos(y / 7)], 2)
    base[(x - width / 2) ** 2 + (y - height / 2) ** 2 < (min(width, height) / 4) ** 2] += 50
    return np.clip(base + rng.normal(0, 4, base.shape), 0, 255).astype(np.uint8)


def test_file_decodes_to_what_was_promised():
    picture = textured(96, 80)
    data = encode(picture, quality=60, max_layers=1, **FAST).to_bytes()
    assert len(data) * 8 / (96 * 80) < 3
    assert psnr(picture, from_bytes(data)) > 32


def test_quality_is_continuous():
    picture = textured(96, 80)
    sizes = [len(encode(picture, quality=q, max_layers=1, **FAST).to_bytes())
             for q in (10, 30, 50, 70, 90)]  # fmt: skip
    assert sizes == sorted(sizes)
    assert sizes[-1] > 3 * sizes[0]


@pytest.mark.parametrize(
    ("width", "height"), [(1, 1), (1, 70), (67, 1), (5, 3), (65, 63), (33, 90)]
)
def test_odd_sizes(width, height):
    picture = textured(width, height)
    if width * height == 1:
        picture = np.concatenate([picture, picture[:, :1] // 2], 1)
    image = from_bytes(encode(picture, quality=80, max_layers=1, **FAST).to_bytes())
    assert image.render().shape == picture.shape
    assert psnr(picture, image) > 28


def test_grey_pictures_have_no_chroma():
    picture = textured(64, 64)[..., 0]
    image = from_bytes(encode(picture, quality=60, max_layers=1, **FAST).to_bytes())
    planes = image.layers[0].texture.planes
    assert planes.components == 1
    shown = image.render()
    assert (shown == shown[..., :1]).all()


def test_soft_alpha_has_planes_of_its_own():
    picture = np.dstack([textured(72, 64), np.zeros((64, 72), np.uint8)])
    y, x = np.mgrid[:64, :72]
    picture[..., 3] = np.clip(400 - 12 * np.hypot(x - 36, y - 32), 0, 255)
    image = from_bytes(encode(picture, quality=75, **FAST).to_bytes())
    texture = image.layers[0].texture
    assert isinstance(texture, PyramidTexture)
    assert texture.alpha is not None
    assert texture.alpha.components == 1
    alpha = image.render()[..., 3].astype(int)
    assert np.abs(alpha - picture[..., 3]).mean() < 3


def test_layers_share_planes_and_cost_little(small_masks):
    from proxyimg_codec.encoder.shapes.masks import Region

    picture = textured(64, 48)
    picture[small_masks["disc"]] = (210, 60, 50)
    regions = [Region(name, mask) for name, mask in small_masks.items()]
    one = encode(picture, quality=50, max_layers=1, **FAST)
    many = encode(picture, quality=50, masks=regions, **FAST)
    assert len(many.layers) == 3
    assert len({id(v.texture.planes) for v in many.layers}) == 1
    difference = np.abs(one.render().astype(int) - many.render())
    assert difference.mean() < 0.5  # a sample of which little is seen may be filled


def test_removing_a_layer_shows_a_smooth_fill(small_masks):
    from proxyimg_codec.encoder.shapes.masks import Region

    picture = textured(64, 48)
    picture[:] = (40, 120, 200)
    picture[small_masks["disc"]] = (250, 20, 20)
    picture[::7, ::5] += 3
    image = encode(picture, quality=70, masks=[Region("disc", small_masks["disc"])], **FAST)
    bare = image.edited({"op": "remove", "layer": "disc"}).render().astype(int)
    assert np.abs(bare - (40, 120, 200)).max() < 40
    assert np.abs(bare[small_masks["disc"]] - (40, 120, 200)).mean() < 12


def test_refinement_lowers_the_cost():
    net = load(1)
    x = torch.from_numpy(textured(128, 128).astype(np.float32)).permute(2, 0, 1)[None]
    step = torch.tensor([2.0 ** (300 / 64)])
    target = refine.Target(x, None, None, None, step)
    with torch.no_grad():
        start = net.analyse(x, step, 4)

    def costs(latents):
        with torch.no_grad():
            return float(refine.cost(net, target, [torch.round(y) for y in latents], False).total)

    random = torch.Generator().manual_seed(0)
    greedy = refine.improved(net, target, start, 6, lambda: None)
    annealed = refine.refined(net, target, start, 12, random, lambda: None)
    both = refine.improved(net, target, annealed, 6, lambda: None)
    assert costs(greedy) < 0.97 * costs(start)
    assert costs(both) < costs(annealed)
    assert all((y == torch.round(y)).all() for y in greedy)


ENGINES = {"native": engine_native, "torch": engine_torch}


@pytest.mark.parametrize("engine", ENGINES)
def test_shifts_take_the_fewest_bits(monkeypatch, engine):
    monkeypatch.setattr(pyramid, "engine", lambda structural=False: ENGINES[engine])
    job = pyramid.Job(2, Raster(textured(96, 96, 3).astype(np.float32)), 256)
    best = job.shifts
    latents = [torch.round(torch.from_numpy(y))[None] for y in job.latents]
    likely = load(2).likelihoods(latents, torch.tensor([2.0 ** (256 / 64)]))
    few = slice(None, None, engine_torch.SPARSE[0])
    for k, (y, p) in enumerate(zip(latents, likely, strict=False)):
        for group, at in enumerate((slice(3), slice(3, 9))):
            across = few if engine == "torch" else slice(None)
            y_, mean, scale = (v[:, at, few, across] for v in (y, *p))
            spent = {
                s: rate.bits_of_integers(y_, mean, (scale + s / 8).clamp(-4, 3.875)).sum().item()
                for s in SHIFTS
            }
            chosen = best[2 * k + group]
            for near in {chosen - 1, chosen + 1} & set(SHIFTS):
                assert spent[chosen] <= spent[near] + 0.01


def test_relaxed_latents_lie_between_their_neighbours():
    random = torch.Generator().manual_seed(0)
    y = torch.randn(1, 9, 8, 8, generator=random) * 3
    (chosen,) = refine.relaxed([y], 0.3, random)
    assert (chosen >= torch.floor(y)).all()
    assert (chosen <= torch.floor(y) + 1).all()
    cold = torch.stack([refine.relaxed([y], 1e-3, random)[0] for _ in range(64)]).mean(0)
    # Drawn up as often as the fraction is large.
    near = (y - torch.floor(y)) > 0.9
    assert (cold - torch.floor(y))[near].mean() > 0.8


def test_windows_change_little(monkeypatch):
    picture = textured(128, 96)
    raster = Raster(picture.astype(np.float32))
    whole, _ = pyramid.encode(raster, 300, Effort(0, 4), 0, lambda n: None)
    monkeypatch.setattr(window, "WINDOW", 64)
    tiled, _ = pyramid.encode(raster, 300, Effort(0, 4), 0, lambda n: None)
    costs = []
    for planes in (whole, tiled):
        error = ((255 * planes.raster - picture) ** 2).sum() / 2 ** (300 / 32)
        costs.append(error + goal.RATE_WEIGHT * 8 * len(planes.packed["data"]))
    # Windows of 64 samples have edges everywhere; real ones are 768.
    assert costs[1] == pytest.approx(costs[0], rel=0.1)


def test_windows_cover_everything_once():
    seen = np.zeros((320, 448), int)
    for top in range(0, 320, 128):
        for left in range(0, 448, 128):
            window = Window.of((top, left), 128, 64, (320, 448))
            seen[window.inner] += 1
            assert window.partial
    assert (seen == 1).all()


def test_same_seed_same_bytes():
    picture = textured(64, 64)
    first, second = (
        encode(picture, quality=50, max_layers=1, effort=4, texture="pyramid", jobs=j).to_bytes()
        for j in (1, 2)
    )
    assert first == second


class Interrupting:
    """Progress that interrupts the encoder when it hears of textures for the `at`-th time."""

    def __init__(self, at):
        self.at, self.calls = at, 0

    def __call__(self, stage, done, total):
        self.calls += stage == "texture"
        if self.calls == self.at:
            raise KeyboardInterrupt


def test_interrupt_keeps_the_best_so_far():
    picture, progress = textured(64, 64), Interrupting(3)
    image = encode(
        picture, quality=50, max_layers=1, effort=9, texture="pyramid", progress=progress
    )
    assert progress.calls == 3
    assert psnr(picture, from_bytes(image.to_bytes())) > 30


def test_auto_picks_and_says_so():
    assert Settings().pyramid
    assert not Settings(sampling="node").pyramid
    assert not Settings(net_bits=4).pyramid
    flat = encode(np.full((20, 30, 3), 90, np.uint8), effort=1)
    assert len(flat.networks) == 1
    assert not encode(textured(40, 40), max_layers=1, effort=1).networks


@pytest.mark.parametrize(
    "wrong",
    [
        {"texture": "pyramid", "net_bits": 4},
        {"texture": "implicit", "target_bpp": 1.0},
        {"target_bpp": 1.0, "target_psnr": 30.0},
        {"target_psnr": -1.0},
        {"tune": "ms-ssim", "sampling": "node"},
        {"tune": "vmaf"},
        {"texture": "wavelet"},
    ],
)
def test_contradictions(wrong):
    with pytest.raises(UsageError):
        Settings(**wrong)


def test_registered_weights_are_what_the_specification_says():
    files = Path(registered_model.__file__).parents[1] / "models"
    for entry in registered_model.REGISTERED.values():
        data = (files / f"{entry.file}.bin").read_bytes()
        assert hashlib.sha256(data).hexdigest() == entry.digest
        assert len(data) <= 250_000


@pytest.mark.parametrize("size", [(1, 2), (3, 5), (8, 8), (9, 1), (13, 10)])
@pytest.mark.parametrize("channels", [1, 3])
def test_small_pictures_are_tuned_too(size, channels):
    pixels = np.random.default_rng(2).integers(0, 256, (*size, channels)).astype(np.uint8)
    image = encode(pixels, tune="ms-ssim", effort=1, quality=90)
    assert psnr(pixels, from_bytes(image.to_bytes())) > 20


def test_windows_without_support_are_passed_over(monkeypatch):
    """Progress counts them, and what is stored does not change."""
    samples = textured(1610, 24).astype(np.float32)
    cells = np.zeros((3, 202), bool)
    cells[:, 5:20] = True
    raster, found = Raster(samples, None, cells), []
    for holds in (pyramid.Job.holds, lambda self, box: True):
        refined, ticks = [], []
        refine_one = pyramid.Job.refine

        def refined_too(self, box, *rest, refine_one=refine_one, refined=refined):
            refined.append(box)
            refine_one(self, box, *rest)

        with monkeypatch.context() as patch:
            patch.setattr(pyramid.Job, "holds", holds)
            patch.setattr(pyramid.Job, "refine", refined_too)
            planes, _ = pyramid.encode(raster, 300, Effort(0, 2), 0, ticks.append)
        found.append((len(refined), sum(ticks), planes.raster[:, 40:160]))
    assert [count for count, _, _ in found] == [1, 3]
    assert found[0][1] == found[1][1] == 2 * 1610 * 24
    assert np.abs(found[0][2] - found[1][2]).max() < 0.02
