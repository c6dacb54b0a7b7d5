"""Targets: a size of the file or a PSNR, met in hardly more work than one encoding."""

import math

import numpy as np
import pytest

from proxyimg_codec import encode
from proxyimg_codec.encoder.pyramid import encode as pyramid
from proxyimg_codec.encoder.pyramid import target
from proxyimg_codec.encoder.pyramid.encode import EFFORTS, Job, Raster
from proxyimg_codec.errors import UsageError
from proxyimg_codec.io import raster
from proxyimg_codec.render.quality import psnr
from tests.encoder.pyramid.test_encode import Interrupting, textured
from tests.support.paths import ROOT

FAST = {"texture": "pyramid", "effort": 1, "jobs": 1, "max_layers": 1}


def by_size(image, pixels):
    return len(image.to_bytes())


def by_bpp(image, pixels):
    return 8 * len(image.to_bytes()) / pixels[..., 0].size


def by_psnr(image, pixels):
    return psnr(pixels, image)


@pytest.fixture(scope="module")
def photo():
    whole = raster.read(ROOT / "docs" / "images" / "photo.png").pixels
    return np.ascontiguousarray(whole[100:223, 380:541, :3])


@pytest.mark.parametrize("effort", [1, 4])
@pytest.mark.parametrize(
    ("name", "measure", "wanted", "low", "high"),
    [
        ("target_bpp", by_bpp, 1.2, 0.98, 1.0),
        ("target_size", by_size, 1500, 0.98, 1.0),
        ("target_psnr", by_psnr, 33.0, 1 - 0.1 / 33, 1 + 0.1 / 33),
        ("target_psnr", by_psnr, 41.0, 1 - 0.1 / 41, 1 + 0.1 / 41),
    ],
)
def test_targets_are_met(photo, effort, name, measure, wanted, low, high):
    """Sizes are never more than asked for."""
    image = encode(photo, **{name: wanted}, **FAST | {"effort": effort})
    assert low <= measure(image, photo) / wanted <= high


def test_a_picture_whose_noise_is_coded_or_not():
    """A step further, it is twice as large, and what is rounded stays; begun anew, it is met."""
    picture = textured(96, 80)
    image = encode(picture, target_bpp=1.2, **FAST)
    assert 0.95 <= by_bpp(image, picture) / 1.2 <= 1


def test_targets_count_metadata_and_layers(photo):
    mask = np.zeros(photo.shape[:2], bool)
    mask[20:70, 30:90] = True
    blocks = {"exif": bytes(400)}
    options = FAST | {"max_layers": 4}
    image = encode(photo, masks=[mask], blocks=blocks, target_size=2200, **options)
    assert len(image.layers) == 2
    assert 0.98 * 2200 <= len(image.to_bytes()) <= 2200


def test_more_bytes_than_a_picture_can_use():
    """A size is an upper bound: the finest step is taken."""
    picture = textured(40, 32)
    image = encode(picture, target_size=1e6, **FAST)
    assert image.planes[0].packed["step"] == target.FIRST_STEP
    assert psnr(picture, image) > 45


@pytest.mark.parametrize("wanted", [{"target_size": 3}, {"target_psnr": 90.0}])
def test_out_of_reach(wanted):
    with pytest.raises(UsageError, match="out of reach"):
        encode(textured(64, 64), **wanted, **FAST)


@pytest.mark.parametrize("kind", ["size", "psnr"])
def test_a_target_takes_hardly_more_work(monkeypatch, photo, kind):
    """Half as many rounds more than without a target at most; borders weigh as they do then."""
    rounds, jobs = [], []
    refine, begin = Job.refine_all, Job.__init__

    def counted(self, part, seed, tick):
        rounds.append(part.rounds)
        refine(self, part, seed, tick)

    def begun(self, *args, **options):
        jobs.append(self)
        begin(self, *args, **options)

    monkeypatch.setattr(Job, "refine_all", counted)
    monkeypatch.setattr(Job, "__init__", begun)
    wanted = {"size": {"target_size": 3000}, "psnr": {"target_psnr": 32.0}}[kind]
    encode(photo, **wanted, **FAST | {"effort": 5})
    assert sum(rounds) <= 1.5 * EFFORTS[4].rounds
    assert len(jobs) <= 3
    assert all(job.raster.weight[0].min() > 1 for job in jobs)


def test_bits_are_estimated(photo):
    job = Job(2, Raster(photo.astype(np.float32)), 250)
    coded = len(job.planes(keep=True).packed["data"])
    assert target._bytes(job) == pytest.approx(coded, rel=0.05)


def test_bits_are_estimated_in_windows(monkeypatch):
    monkeypatch.setattr(pyramid.windows, "__defaults__", (64,))
    monkeypatch.setattr("proxyimg_codec.encoder.pyramid.window.WINDOW", 128)
    job = Job(2, Raster(textured(330, 200).astype(np.float32)), 300)
    assert len(job.windows()) == 6
    coded = len(job.planes(keep=True).packed["data"])
    assert target._bytes(job) == pytest.approx(coded, rel=0.05)


def test_latents_are_scaled_to_another_step():
    """They show the same, however coarse their step is."""
    picture = textured(96, 80).astype(np.float32)
    job = Job(2, Raster(picture), 64)
    before = job.samples()
    error = np.square(before * 255 - picture).mean()
    job.rescale(74)
    assert np.abs(job.samples() - before).max() * 255 < 6
    assert math.sqrt(np.square(job.samples() * 255 - picture).mean()) < 1.5 * math.sqrt(error)


def test_an_interrupt_ends_the_search():
    picture, progress = textured(96, 80), Interrupting(2)
    image = encode(picture, target_size=1500, progress=progress, **FAST | {"effort": 7})
    assert progress.calls == 2
    assert psnr(picture, image) > 25
