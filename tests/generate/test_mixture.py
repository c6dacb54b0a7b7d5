"""Score distillation by a denoiser whose score is exact: what theory says must come out."""

import numpy as np
import pytest
import torch

import proxyimg_codec as pxi
from proxyimg_codec.generate.guide import Batch
from tests.generate.conftest import MODES
from tests.support.edits import covered, grown
from tests.support.guides import SIDE, Mixture, mixture_guide
from tests.support.pictures import smooth

STEPS = 220


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("coder", ["pyramid", "implicit"])
def test_it_converges_to_the_mode_that_is_meant(pictures, mixture, colour_of, seed, coder):
    image = pictures[coder]
    made = image.layers["disc"].generated("1", guide="mixture", steps=STEPS, seed=seed)
    again = pxi.from_bytes(made.to_bytes())
    start, found = (np.linalg.norm(colour_of(v, "disc") - MODES[1]) for v in (image, again))
    assert found <= 0.02 * start
    beyond = ~grown(covered(image, "disc"), 2)
    np.testing.assert_array_equal(again.render()[beyond], image.render()[beyond])


@pytest.mark.parametrize("coder", ["pyramid", "implicit"])
def test_with_guidance_it_leaves_the_mode_that_is_nearer(mixture, coder):
    """Little noise lets no doubt which mode is near; near its own, the prompt adds nothing."""
    image = pxi.encode(smooth(50, 41), effort=1, max_layers=1, texture=coder)
    start = image.render(dtype=np.float32).mean((0, 1))
    assert np.argmin([np.linalg.norm(start - mode) for mode in MODES]) == 2
    made = image.layers[0].generated(
        "1", guide="mixture", steps=600, guidance=4.0, times=(0.02, 0.5)
    )
    found = made.render(dtype=np.float32).mean((0, 1))
    assert np.linalg.norm(found - MODES[1]) <= 0.02 * np.linalg.norm(start - MODES[1])


def test_the_score_of_the_mixture_is_the_slope_of_its_density():
    mixture = Mixture(MODES, 1, 0.3)
    random = torch.Generator().manual_seed(2)
    x = torch.randn((2, 3, 4, 4), generator=random, dtype=torch.float64)
    times = torch.tensor([0.3, 0.8], dtype=torch.float64)
    for prompted in (False, True):
        found = mixture.noise(x, times, prompted)
        for at in ((0, 0, 1, 2), (1, 2, 3, 0)):
            step = torch.zeros_like(x)
            step[at] = 1e-5
            up, down = (mixture.log_density(x + s, times, prompted) for s in (step, -step))
            slope = float((up - down).sum()) / 2e-5
            sine = float(torch.sin(times[at[0]] * torch.pi / 2))
            assert float(found[at]) == pytest.approx(-sine * slope, rel=1e-6)


@pytest.mark.parametrize("weighting", ["sds", "uniform"])
def test_the_gradient_is_that_of_the_formula(weighting):
    guide = mixture_guide(MODES, 2, 5.0, weighting)
    images = torch.rand((2, 3, SIDE, SIDE), dtype=torch.float64)
    times = torch.tensor([0.2, 0.7], dtype=torch.float64)
    shown = torch.ones((2, 1, SIDE, SIDE), dtype=torch.float64)
    found = guide.judge(Batch(images, times, shown, torch.Generator().manual_seed(9)))
    noise = torch.randn(
        images.shape, generator=torch.Generator().manual_seed(9), dtype=torch.float64
    )
    for k in range(2):
        angle = float(times[k]) * np.pi / 2
        x = np.cos(angle) * (2 * images[k] - 1) + np.sin(angle) * noise[k]
        one = torch.tensor([float(times[k])], dtype=torch.float64)
        mixture = Mixture(MODES, 2)
        plain, wanted = (mixture.noise(x[None], one, p)[0] for p in (False, True))
        weight = np.sin(angle) ** 2 if weighting == "sds" else 1
        want = 2 * weight * (plain + 5 * (wanted - plain) - noise[k])
        torch.testing.assert_close(found.gradient[k], want, rtol=1e-12, atol=1e-12)
        torch.testing.assert_close(found.loss[k], ((wanted - noise[k]) ** 2).mean())
