"""The next model starts from model 2, and its contexts see only what was coded before."""

import sys

import cv2
import numpy as np
import pytest
import torch

from proxyimg_codec.encoder.pyramid.convolutions import eight_bit, through, weight_step
from proxyimg_codec.encoder.pyramid.load import load
from proxyimg_codec.encoder.pyramid.rate import around, bits_at, bits_of_integers
from proxyimg_codec.encoder.pyramid.refine import Target, cost
from proxyimg_codec.texture.registered_model import WIDE
from training import compare, compare_synthesis, export_wider, pictures
from training import latents as made
from training.compare import parsed
from training.structures import Context, Structure
from training.wider import WiderModel


def latents(seed=1):
    random = torch.Generator().manual_seed(seed)

    def draw(*shape):
        return torch.round(3 * torch.randn(*shape, generator=random))

    return [draw(1, 9, 24, 32), draw(1, 9, 12, 16), draw(1, 9, 6, 8), draw(1, 3, 6, 8)]


def test_it_starts_as_model_2():
    torch.manual_seed(3)
    model = load(2)
    target = Target(torch.rand(1, 3, 48, 64) * 255, None, None, None, torch.tensor([21.0]))
    wider = WiderModel(model)
    with torch.no_grad():
        old, new = (cost(m, target, latents(), smooth=False) for m in (model, wider))
    assert new.error.item() == pytest.approx(old.error.item(), rel=1e-5)
    assert new.spent.item() == pytest.approx(old.spent.item(), rel=1e-5)


def test_it_fits_the_file_and_the_decoder():
    wider = WiderModel(load(2))
    assert wider.bytes < 400_000
    assert wider.operations < 2 * WiderModel(load(2), [Structure()] * 4, [32] * 4).operations


@pytest.mark.parametrize("text", [
    "-", "turns=3,chroma_turns=2,shaped=1,grand=1,deeper=1,mixes=2", "rows=3,reach=4,view=5",
    "passes=2", "passes=4,turns=3,chroma_turns=6", "signed=1,width=40,ahead=48",
])  # fmt: skip
def test_contexts_see_only_what_was_coded_before(text):
    structure = parsed(text)
    torch.manual_seed(5)
    net = Context(structure, load(2).level(1))
    for p in net.parameters():
        torch.nn.init.normal_(p, std=0.1)
    ys = latents()
    low, y, q = torch.randn(1, 3, 24, 32), ys[0].clone().requires_grad_(), torch.zeros(1, 1, 1, 1)
    found = net(low, ys[1], ys[2], y, q)
    row, column = 9, 14
    for group in net.groups:
        slope = torch.autograd.grad(found.log_scale[0, group, row, column].sum() * 1e3, y,
                                    retain_graph=True)[0]  # fmt: skip
        seen = slope[0].abs().sum(0) > 0
        later = torch.zeros(24, 32, dtype=torch.bool)
        if structure.passes == 0:
            later[row + 1 :] = True
            later[row, column + 1 :] = True
        else:
            turn = turns(structure.passes)
            later = turn >= turn[row, column]
            later[row, column] = False
        assert not (seen & later).any()
        assert not slope[0, group[0] :, row, column].any()
        if group[0]:
            assert slope[0, : group[0], row, column].any()


def turns(passes):
    y, x = torch.arange(24)[:, None], torch.arange(32)[None]
    return (x + y) % 2 if passes == 2 else torch.tensor([[0, 2], [3, 1]])[y % 2, x % 2]


def test_a_chosen_share_of_0_odds_is_that_of_model_2():
    y, mean = latents()[0], torch.rand(1, 9, 24, 32)
    scale = torch.rand(1, 9, 24, 32) * 4 - 2
    new = bits_of_integers(y, mean, scale, torch.zeros_like(scale))
    assert torch.allclose(new, bits_at(y - mean, scale), atol=1e-3, rtol=1e-3)
    flat, far = torch.zeros_like(scale), mean.round() + 8
    assert (bits_of_integers(far, mean, flat, flat + 3) < bits_of_integers(far, mean, flat)).all()


def test_bits_of_neighbours_with_a_chosen_share():
    torch.manual_seed(7)
    y, mean = latents()[0].clamp(-4, 4), torch.rand(1, 9, 24, 32)
    scale, odds = torch.rand(1, 9, 24, 32) * 3 - 0.5, torch.rand(1, 9, 24, 32) * 6 - 3
    found = around(y, mean, scale, odds)
    for shift, bits in ((-1, found.below), (0, found.here), (1, found.above)):
        assert torch.allclose(bits, bits_of_integers(y + shift, mean, scale, odds), atol=1e-2)
    moving = y.clone().requires_grad_()
    slope = torch.autograd.grad(bits_of_integers(moving, mean, scale, odds).sum(), moving)[0]
    assert torch.allclose(slope, found.slope, atol=1e-2)


def test_exported_weights_are_those_of_simulated_integers(tmp_path):
    wider = WiderModel(load(2))
    torch.manual_seed(11)
    with torch.no_grad():
        for p in wider.parameters():
            p += torch.randn_like(p) * 0.003
    arrays = dict(export_wider.arrays_of(wider))
    net = wider.levels[0].context
    for name, layer in (("second", net.second), ("out1", net.out[1]), ("back0", net.back[0])):
        step = weight_step(layer.weight)
        simulated = through(layer.weight, step, -127, 127).detach().numpy()
        assert np.array_equal(
            arrays[f"context 0 {name}"].floats.reshape(simulated.shape), simulated
        )
    third = wider.levels[3].wider.third.weight
    found = arrays["synthesis 3 third"].floats
    assert np.array_equal(found, eight_bit(third).detach().numpy())
    size = sum(a.values.size * (4 if any(w in n for w in WIDE) else 1) for n, a in arrays.items())
    assert len(export_wider.pack(wider)) == 8 + 4 * 6 + len(arrays) + size < 400_000


def test_sums_that_are_not_exact_are_refused():
    wider = WiderModel(load(2))
    with torch.no_grad():
        wider.levels[3].context.second.weight.fill_(0.99)
    with pytest.raises(ValueError, match="layer second"):
        list(export_wider.arrays_of(wider))


def test_latents_and_comparisons(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pictures, "SIZE", 128)
    monkeypatch.setattr(made, "SIZE", 128)
    monkeypatch.setattr(made, "SHARD", 4)
    monkeypatch.setattr(made, "ROUNDS", 2)
    (tmp_path / "pictures").mkdir()
    rng = np.random.default_rng(3)
    for k in range(2):
        picture = cv2.GaussianBlur(rng.integers(0, 256, (140, 150, 3)).astype(np.uint8), (0, 0), 3)
        cv2.imwrite(str(tmp_path / "pictures" / f"{k}.png"), picture)

    def run(module, *words):
        monkeypatch.setattr(sys, "argv", [module.__name__, *(str(w) for w in words)])
        module.main()
        return capsys.readouterr().out

    run(made, tmp_path, tmp_path / "pictures", "--judging", 1, "--learning", 1)
    found = np.load(tmp_path / "judging-000.npz")
    assert found["level1"].shape == (4, 9, 64, 64)
    assert found["lowest"].shape == (4, 3, 2, 2)
    out = run(compare, tmp_path, "-", "turns=3", "--epochs", 1, "--level", 3)
    assert "before +0.00" in out
    assert out.count("judged") == 2
    out = run(compare_synthesis, tmp_path, "filter=8", "middle=3,hidden=40", "--epochs", 1)
    assert out.count("judged") == 2
