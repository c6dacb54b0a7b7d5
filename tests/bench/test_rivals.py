"""Rivals: as many parameters as they should have, and they learn a small picture."""

from functools import partial

import numpy as np
import pytest
import torch

from proxyimg_codec.bench.paper.implicit import maker
from proxyimg_codec.bench.rivals import fitting, gaussians, grids, sines
from tests.support.pictures import smooth

PICTURE = smooth(37, 29)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize(("hidden", "count"), [(3, 50307), (5, 83331)])
def test_siren_has_the_paper_s_parameters(hidden, count):
    assert sines.siren(128, hidden).parameters_used == count == sines.count(128, hidden + 1)


def test_coin_of_its_paper():
    """13 layers of width 49 at 16 bits are COIN's 1.209 bits a pixel of Kodak."""
    assert round(16 * sines.count(49, 13) / (768 * 512), 3) == 1.208
    assert sines.coin(29697).parameters_used == 29697
    assert sines.coin(29696).parameters_used == sines.count(48, 13)


@pytest.mark.parametrize("label", ["COIN", "LIIF-like grid", "hash grid", "2-D Gaussians"])
@pytest.mark.parametrize("parameters", [12867, 50307])
def test_rivals_use_the_parameters_they_may(label, parameters):
    count = maker(label, parameters, 64, 128, (256, 256))().parameters_used
    assert 0.95 * parameters < count <= parameters


RIVALS = {
    "siren": (partial(sines.siren, 32, 3), 150, 37),
    "coin": (partial(sines.coin, 4000), 300, 27),
    "local grid": (partial(grids.LocalGrid, 3000, 16), 300, 28),
    "hash grid": (partial(grids.HashGrid, 8000, 16, 32), 150, 34),
    "gaussians": (partial(gaussians.Gaussians, 2000, 37, 29), 200, 30),
}


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_learn(name):
    make, steps, floor = RIVALS[name]
    found = fitting.fit(make, PICTURE, steps)
    assert found.psnr > floor
    assert found.parameters == make().parameters_used
    again = fitting.fit(make, PICTURE, steps)
    assert (again.psnr, again.ms_ssim) == (found.psnr, found.ms_ssim)


def test_gaussians_are_those_of_the_formula():
    """Lists of near Gaussians change nothing but what lies three deviations away."""
    torch.manual_seed(0)
    rival = gaussians.Gaussians(240, 37, 29)
    with torch.no_grad():
        rival.factor += torch.randn(30, 3)
        at, factor = rival._shape()
        points = (fitting.places(29, 37) + 1) / 2 * rival.size
        lower = torch.zeros(30, 2, 2)
        lower[:, 0, 0], lower[:, 1, 0], lower[:, 1, 1] = factor.unbind(1)
        inverse = torch.linalg.inv(lower @ lower.transpose(1, 2))
        offset = points[:, None] - at
        square = torch.einsum("pni,nij,pnj->pn", offset, inverse, offset)
        whole = torch.exp(-square / 2) @ rival.colour
        assert float((rival(fitting.places(29, 37)) - whole).abs().max()) < 30 * 0.5 * np.exp(-4.5)
        near = torch.exp(-square / 2) * (square < 1)
        assert float((near @ rival.colour).abs().mean()) > 0.01


def test_tables_fit_the_budget():
    sizes = grids.table_sizes([9, 100, 400], 250)
    assert sizes == [9, 100, 141]
    assert grids.table_sizes([9, 100, 400], 5000) == [9, 100, 400]


def test_converged_means_that_more_steps_gain_little(monkeypatch):
    values = {10: 20.0, 20: 25.0, 40: 25.05, 80: 30.0}

    def fit(make, pixels, steps, seed=0):
        return fitting.Fitted(values[steps], 1.0, 5, steps, 0.1)

    monkeypatch.setattr(fitting, "fit", fit)
    found = fitting.fit_converged(None, PICTURE, 10, 100)
    assert (found.steps, found.converged) == (40, True)
    found = fitting.fit_converged(None, PICTURE, 10, 30)
    assert (found.steps, found.converged) == (20, False)


def test_equal_time_is_the_same_time(monkeypatch):
    asked = []

    def fit(make, pixels, steps, seed=0):
        asked.append(steps)
        return fitting.Fitted(20.0, 1.0, 5, steps, 0.01 * steps)

    monkeypatch.setattr(fitting, "fit", fit)
    assert fitting.fit_for(None, PICTURE, 3.0).seconds == pytest.approx(3)
    assert asked == [20, 300]


def test_pictures_at_any_size_agree():
    """What a rival learned is drawn larger as the same picture."""

    class Ramp(fitting.Rival):
        def forward(self, place):
            return torch.stack([(place[:, 0] + 1) / 2, (place[:, 1] + 1) / 2, place[:, 0] * 0], 1)

    drawn = fitting.picture(Ramp(), 20, 30)
    assert drawn.shape == (20, 30, 3)
    assert (drawn[0, :, 0] == np.rint((np.arange(30) + 0.5) / 30 * 255)).all()
    assert (drawn[:, 0, 1] == np.rint((np.arange(20) + 0.5) / 20 * 255)).all()
