"""The next model starts from model 2, and its contexts see only what was coded before."""

import pytest
import torch

from proxyimg_codec.encoder.pyramid.load import load
from proxyimg_codec.encoder.pyramid.rate import around, bits_at, bits_of_integers
from proxyimg_codec.encoder.pyramid.refine import Target, cost
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
