"""The guide of a pipeline of diffusers, against the same computed by hand, with random weights."""

import json
import shutil

import numpy as np
import pytest
import torch

from proxyimg_codec.errors import InputError, UnsupportedError, UsageError
from proxyimg_codec.generate.diffusers_guide import LatentGuide, Words, pipeline_guide
from proxyimg_codec.generate.guide import Batch, Wishes
from proxyimg_codec.generate.run import Run
from proxyimg_codec.generate.settings import Settings

pytest.importorskip("diffusers", reason="not installed: diffusers (the extra generate)")
pytest.importorskip("transformers", reason="not installed: transformers (the extra generate)")

from tests.support import pipelines

KINDS = [("1", "epsilon"), ("1", "v_prediction"), ("1", "sample"), ("xl", "epsilon")]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folders of pipelines by kind and prediction."""
    return {key: pipelines.write(tmp_path_factory.mktemp("-".join(key)), *key) for key in KINDS}


def batch(count=2, kind=torch.float64):
    images = torch.rand((count, 3, 16, 16), generator=torch.Generator().manual_seed(4)).to(kind)
    times = torch.tensor([0.25, 0.8123, 0.5][:count], dtype=kind)
    random = torch.Generator().manual_seed(11)
    return Batch(images, times, torch.ones((count, 1, 16, 16), dtype=kind), random)


def loaded(path, **settings):
    return pipeline_guide(path, Wishes(Settings("tiger fur", str(path), **settings), Run()))


@pytest.mark.parametrize("weighting", ["sds", "uniform"])
@pytest.mark.parametrize("key", KINDS, ids="-".join)
def test_the_gradient_is_that_by_hand(made, key, weighting):
    """In float64, from the parts of the pipeline as diffusers loads them itself."""
    from diffusers import DiffusionPipeline

    guide = loaded(made[key], guidance=7.0, weighting=weighting, negative="mud")
    guide = LatentGuide(
        guide._vae.double(), guide._unet.double(), Scheduler(guide), doubled(guide._words), 7.0,
        weighting, torch.float64,
    )  # fmt: skip
    given = batch()
    found = guide.judge(given)
    pipe = DiffusionPipeline.from_pretrained(made[key], local_files_only=True)
    with torch.no_grad():
        wanted, plain, *pooled = pipe.encode_prompt(
            "tiger fur", device="cpu", num_images_per_prompt=1, do_classifier_free_guidance=True,
            negative_prompt="mud",
        )  # fmt: skip
    vae, unet = pipe.vae.double(), pipe.unet.double()
    noise = torch.randn(
        (2, 4, 8, 8), generator=torch.Generator().manual_seed(11), dtype=torch.float64
    )
    betas = torch.linspace(0.00085**0.5, 0.012**0.5, 1000) ** 2
    for k, t in enumerate((250, 812)):
        a2 = torch.cumprod(1 - betas, 0)[t].double()
        a, s = a2.sqrt(), (1 - a2).sqrt()
        image = given.images[k : k + 1].clone().requires_grad_()
        latent = vae.encode(image * 2 - 1).latent_dist.mean * 0.3
        noisy = (a * latent + s * noise[k]).detach()

        def by(states, pooled, noisy=noisy, t=t, a=a, s=s):
            added = None
            if pooled is not None:
                ids = torch.tensor([[16, 16, 0, 0, 16, 16]], dtype=torch.float64)
                added = {"text_embeds": pooled.double(), "time_ids": ids}
            with torch.no_grad():
                out = unet(noisy, t, states.double(), added_cond_kwargs=added).sample
            return {"epsilon": out, "v_prediction": a * out + s * noisy,
                    "sample": (noisy - a * out) / s}[key[1]]  # fmt: skip

        yes, no = (by(v, pooled[i] if pooled else None) for i, v in enumerate((wanted, plain)))
        weight = s**2 if weighting == "sds" else 1
        goal = weight * (no + 7 * (yes - no) - noise[k])
        (latent * goal).sum().backward()
        want = image.grad[0]
        assert float((found.gradient[k] - want).norm() / want.norm()) < 1e-10
        assert float(found.loss[k]) == pytest.approx(
            float(((yes - noise[k]) ** 2).mean()), rel=1e-9
        )


class Scheduler:
    """The noise of a guide's scheduler."""

    def __init__(self, guide):
        self.alphas_cumprod = guide._shares
        self.config = self
        self.prediction_type = guide._predicts


def doubled(words):
    added = words.added and {k: v.double() for k, v in words.added.items()}
    return Words(words.states.double(), added)


def test_the_gradient_agrees_with_finite_differences_of_the_encoder(made):
    """With what the UNet says held fixed, as score distillation has it."""
    guide = loaded(made["1", "epsilon"], guidance=3.0)
    guide = LatentGuide(
        guide._vae.double(), guide._unet.double(), Scheduler(guide), doubled(guide._words), 3.0,
        "sds", torch.float64,
    )  # fmt: skip
    given = batch(1)
    found = guide.judge(given).gradient[0]
    way = torch.randn(found.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    base, up, down = (
        guide._encoded(given.images + k * 1e-6 * way, torch.float64) for k in (0, 1, -1)
    )
    slope = (up - down) / 2e-6
    noise = torch.randn(
        (1, 4, 8, 8), generator=torch.Generator().manual_seed(11), dtype=torch.float64
    )
    share = guide._shares[250]
    a, s = float(share.sqrt()), float((1 - share).sqrt())
    no, yes = guide._noise(a * base + s * noise, torch.tensor(250), a, s, torch.float64)
    goal = s**2 * (no + 3 * (yes - no) - noise[0])
    assert float((found * way).sum()) == pytest.approx(float((slope * goal).sum()), rel=1e-6)


def test_what_is_offloaded_comes_back(made):
    """The same gradients; modules move to the device and back, in this order."""
    plain = loaded(made["1", "epsilon"])
    path = made["1", "epsilon"]
    moved = pipeline_guide(path, Wishes(Settings("tiger fur", str(path)), Run(offload=True)))
    seen = []
    for name, module in (("vae", moved._vae), ("unet", moved._unet)):
        to = module.to

        def noted(where, name=name, to=to):
            seen.append((name, str(where)))
            return to(where)

        module.to = noted
    one, two = (guide.judge(batch(2, torch.float32)) for guide in (plain, moved))
    torch.testing.assert_close(one.gradient, two.gradient)
    assert [name for name, _ in seen] == ["vae", "vae", "unet", "unet", "vae", "vae"]


def test_prompts_matter_and_so_does_guidance(made):
    path = made["1", "epsilon"]

    def gradient(prompt, guidance=7.0):
        wishes = Wishes(Settings(prompt, str(path), guidance=guidance), Run())
        return pipeline_guide(path, wishes).judge(batch(1, torch.float32)).gradient

    assert not torch.equal(gradient("fur"), gradient("stone"))
    assert not torch.equal(gradient("fur"), gradient("fur", 1.0))
    torch.testing.assert_close(gradient("fur", 0.0), gradient("stone", 0.0))


@pytest.mark.parametrize("precision", ["half", "bfloat"])
def test_half_precision_that_fails_is_counted_and_done_in_full(made, precision):
    path = made["1", "epsilon"]
    guide, full = loaded(path, precision=precision), loaded(path)
    fine = guide.judge(batch(1, torch.float32))
    assert guide.retries == 0
    want = full.judge(batch(1, torch.float32)).gradient
    assert float((fine.gradient - want).norm() / want.norm()) < 0.1
    unet, forward = guide._unet, guide._unet.forward

    def overflowing(*args, **more):
        out = forward(*args, **more)
        if out.sample.dtype != torch.float32:
            out.sample[..., 0, 0] = np.nan
        return out

    unet.forward = overflowing
    again = guide.judge(batch(1, torch.float32)).gradient
    assert guide.retries == 1
    assert float((again - want).norm() / want.norm()) < 0.02
    assert next(unet.parameters()).dtype != torch.float32
    unet.forward = lambda *args, **more: spoilt(forward(*args, **more))
    with pytest.raises(InputError, match="not finite"):
        guide.judge(batch(1, torch.float32))


def spoilt(out):
    out.sample[...] = np.nan
    return out


def test_folders_that_are_no_such_pipelines(made, tmp_path):
    path = tmp_path / "a"
    shutil.copytree(made["1", "epsilon"], path)
    index = json.loads((path / "model_index.json").read_text())
    for part in ("unet", "text_encoder"):
        lacking = {**index, part: [None, None]}
        (path / "model_index.json").write_text(json.dumps(lacking))
        with pytest.raises(InputError, match=f"StableDiffusionPipeline has no {part}"):
            loaded(path)
    (path / "model_index.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        loaded(path)
    (path / "model_index.json").write_text(json.dumps(index))
    for file in (path / "unet").glob("*.safetensors"):
        file.write_bytes(b"nothing")
    with pytest.raises(InputError, match="cannot be used as a pipeline"):
        loaded(path)
    shutil.rmtree(path / "unet")
    with pytest.raises(InputError, match="cannot be used as a pipeline"):
        loaded(path)


def test_sizes_that_do_not_fit(made):
    given = batch(1, torch.float32)._replace(images=torch.rand(1, 3, 18, 18))
    with pytest.raises(UsageError, match="resolution 18 must be a multiple of 4"):
        loaded(made["1", "epsilon"]).judge(given)


def test_without_diffusers_it_says_which_extra(made, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "diffusers", None)
    with pytest.raises(UnsupportedError, match=r"diffusers.*proxyimg-codec\[generate\]"):
        loaded(made["1", "epsilon"])


def test_a_layer_is_textured_by_a_pipeline(pictures, made):
    path = made["1", "epsilon"]
    image = pictures["implicit"]
    out = image.layers["disc"].generated("tiger fur", guide=str(path), steps=3)
    assert out.layers["back"].texture.packed == image.layers["back"].texture.packed
    assert not np.array_equal(out.render(), image.render())
