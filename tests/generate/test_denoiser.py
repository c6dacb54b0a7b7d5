"""The small denoiser: its file, its noise, and that a class turns one layer and nothing else."""

import math

import numpy as np
import pytest
import torch

import proxyimg_codec as pxi
from proxyimg_codec.errors import InputError, UsageError
from proxyimg_codec.generate.denoiser import Denoiser, Shape, load, save
from proxyimg_codec.generate.find_guide import guide_for
from proxyimg_codec.generate.guide import Batch, Wishes
from proxyimg_codec.generate.run import Run
from proxyimg_codec.generate.settings import Settings
from tests.support.edits import covered, grown

SHAPE = Shape(16, (8, 16), ("red", "blue"))
COLOURS = torch.tensor([[0.85, 0.15, 0.1], [0.1, 0.25, 0.9]])


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A denoiser of two classes, of about one colour each, that has learnt for some seconds."""
    torch.manual_seed(0)
    random = torch.Generator().manual_seed(0)
    model = Denoiser(SHAPE)
    optimizer = torch.optim.Adam(model.parameters(), 3e-3)
    for _ in range(250):
        label = torch.randint(3, (16,), generator=random)
        colour = COLOURS[torch.where(label == 2, torch.randint(2, (16,), generator=random), label)]
        grain = torch.randn((16, 3, 16, 16), generator=random)
        x = 2 * (colour[:, :, None, None] + 0.03 * grain) - 1
        noise = torch.randn(x.shape, generator=random)
        times = torch.rand(16, generator=random)
        angle = times[:, None, None, None] * math.pi / 2
        found = model(angle.cos() * x + angle.sin() * noise, times, label)
        loss = ((found - (angle.cos() * noise - angle.sin() * x)) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    path = tmp_path_factory.mktemp("denoiser") / "two.pt"
    save(path, model)
    return path


def wishes(path, prompt="red", **settings):
    return Wishes(Settings(prompt, str(path), **settings), Run())


@pytest.mark.parametrize("coder", ["pyramid", "implicit"])
@pytest.mark.parametrize("number", [0, 1])
def test_a_class_turns_one_layer_and_nothing_else(pictures, file, colour_of, coder, number):
    image = pictures[coder]
    made = image.layers["disc"].generated(
        SHAPE.classes[number], guide=str(file), steps=150, guidance=3
    )
    again = pxi.from_bytes(made.to_bytes())
    away = np.linalg.norm(COLOURS.numpy() - colour_of(again, "disc"), axis=1)
    assert away[number] < 0.25
    assert away[1 - number] > 0.7
    beyond = ~grown(covered(image, "disc"), 2)
    np.testing.assert_array_equal(again.render()[beyond], image.render()[beyond])


def test_files_keep_the_network(file):
    model, again = load(file), load(file)
    x, t, label = torch.randn(2, 3, 16, 16), torch.tensor([0.2, 0.9]), torch.tensor([0, 2])
    torch.testing.assert_close(model(x, t, label), again(x, t, label), rtol=0, atol=0)
    assert model.shape == SHAPE
    assert file.stat().st_size < 100_000


def test_its_noise_fits_its_picture(file):
    """That of x = cos x0 + sin e, where v says x0 = cos x - sin v."""
    guide, model = guide_for(wishes(file)), load(file)
    x, t = torch.randn(2, 3, 16, 16), torch.tensor([0.3, 0.7])
    angle = t[:, None, None, None] * math.pi / 2
    v = model(x, t, torch.tensor([0, 0]))
    picture = angle.cos() * x - angle.sin() * v
    noise = guide._predict(x, t, True)
    torch.testing.assert_close(angle.cos() * picture + angle.sin() * noise, x)


@pytest.mark.parametrize("precision", ["half", "bfloat"])
def test_half_precision_that_fails_is_counted_and_done_in_full(file, precision):
    def judged(guide):
        images = torch.rand((1, 3, 16, 16), generator=torch.Generator().manual_seed(1))
        random = torch.Generator().manual_seed(2)
        return guide.judge(Batch(images, torch.tensor([0.5]), images[:, :1], random)).gradient

    guide, want = guide_for(wishes(file, precision=precision)), judged(guide_for(wishes(file)))
    assert float((judged(guide) - want).norm() / want.norm()) < 0.1
    assert guide.retries == 0
    predict = guide._predict
    guide._predict = lambda x, *rest: (
        predict(x, *rest) * (math.nan if x.dtype != torch.float32 else 1)
    )
    # The weights themselves keep what half precision took from them.
    assert float((judged(guide) - want).norm() / want.norm()) < 0.05
    assert guide.retries == 1
    guide._predict = lambda x, *rest: predict(x, *rest) * math.nan
    with pytest.raises(InputError, match="not finite"):
        judged(guide)


def test_prompts_are_its_classes(file):
    guide_for(wishes(file, " Blue ", negative="red"))
    with pytest.raises(UsageError, match="'tiger' is not one of its classes: red, blue"):
        guide_for(wishes(file, "tiger"))
    with pytest.raises(UsageError, match="'mud'"):
        guide_for(wishes(file, negative="mud"))
    with pytest.raises(UsageError, match="prompt is empty"):
        guide_for(wishes(file, "  "))


def test_what_is_no_denoiser(file, tmp_path):
    values = torch.load(file, weights_only=True)
    for wrong in (
        {**values, "kind": "other"}, {**values, "widths": [8, 24]}, {**values, "side": None},
        {**values, "weights": {}}, [1, 2],
    ):  # fmt: skip
        torch.save(wrong, tmp_path / "wrong.pt")
        with pytest.raises(InputError, match="is not a denoiser"):
            load(tmp_path / "wrong.pt")
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "nothing.pt")
