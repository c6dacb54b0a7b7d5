"""Rivals: as many parameters as they should have, and they learn a small picture."""

from functools import partial

import numpy as np
import pytest
import torch

from proxyimg_codec.bench import features
from proxyimg_codec.bench.measure import psnr
from proxyimg_codec.bench.paper.implicit import maker
from proxyimg_codec.bench.rivals import (
    bezier,
    fitting,
    gaussians,
    grids,
    quantized,
    sines,
    traced,
)  # fmt: skip
from tests.support.pictures import disc, smooth

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


def flat(width, height):
    """A red disc on white."""
    return np.where(disc(width, height)[..., None], np.uint8([220, 60, 40]), np.uint8(255))


def test_paths_learn_flat_art():
    found = bezier.fit(flat(37, 29), 1, 300)
    assert found.psnr > 25
    assert found.parameters == 28
    again = bezier.fit(flat(37, 29), 1, 300)
    assert (again.psnr, again.shown.tobytes()) == (found.psnr, found.shown.tobytes())


def test_paths_start_where_the_picture_is_worst():
    picture = flat(37, 29)
    shown = np.full_like(picture, 255)
    x, y, radius, colour = bezier._worst(picture, shown)
    assert (x, y) == pytest.approx((18.5, 14.5), abs=1.5)
    assert 0.3 * 29 - 2 < radius < 0.3 * 29 + 1
    assert colour == pytest.approx(np.array([220, 60, 40]) / 255, abs=0.06)


def test_paths_cover_what_is_inside():
    paths = bezier.Paths(2, 40, 40)
    paths.start(20, 18, 10, np.array([0.2, 0.4, 0.6]))
    at = torch.tensor([[20.0, 18.0], [20.0, 26.0], [20.0, 31.0], [2.0, 2.0]])
    assert paths.coverage(at).tolist() == [[1, 1, 0, 0]]
    corners = paths.corners()[0].detach() - torch.tensor([20.0, 18.0])
    assert 8 < float(corners.norm(dim=1).min()) < float(corners.norm(dim=1).max()) < 10.1
    edge = (corners[3] + torch.tensor([20.0, 18.0]))[None]
    assert float(paths.coverage(edge).detach()) == pytest.approx(0.5, abs=0.01)
    drawn = fitting.picture(paths, 40, 40)
    assert drawn[18, 20].tolist() == [51, 102, 153]
    assert drawn[1, 1].tolist() == [255, 255, 255]


def test_traced_paths_are_drawn_as_they_are_written():
    svg = """<path d="M0 0 L10 0 L10 8 L0 8 Z M2 2 L2 4 L4 4 Z " fill="#FF8000" """ + (
        """transform="translate(5,3)"/>"""
    )
    drawn, count = traced.drawn(svg, (20, 24, 3))
    assert count == 3 + 6 + 4
    assert drawn[4, 6].tolist() == [255, 128, 0]
    assert drawn[9, 14].tolist() == [255, 128, 0]
    assert drawn[13, 6].tolist() == drawn[4, 16].tolist() == [255, 255, 255]
    path = "M0 0 C0 4 4 8 8 8 C8 4 4 0 0 0 Z "
    curve = f'<path d="{path}" fill="#000000" transform="translate(0,0)"/>'
    assert traced.drawn(curve, (9, 9, 3))[1] == 3 + 12


def test_outlines_are_traced_within_a_budget():
    pytest.importorskip("vtracer")
    picture = flat(64, 48)
    shown, count = traced.traced(picture, 280)
    assert count <= 280
    assert psnr(picture, shown) > 18
    assert traced.traced(picture, 1)[1] < 100


@pytest.mark.parametrize(
    ("code", "size", "steps"), [(quantized.coin, 8000, 250), (quantized.splats, 1500, 100)]
)
def test_rivals_are_coded_in_the_bytes_they_may(code, size, steps):
    coded = code(PICTURE, size, steps)
    assert 0.9 * size < coded.size <= size
    assert psnr(PICTURE, coded.shown) > 22


def test_rounding_keeps_the_ends():
    values = torch.tensor([-1.0, 0.1, 3.0])
    assert quantized._rounded(values, 1).tolist() == [-1, -1, 3]
    assert float((quantized._rounded(values, 8) - values).abs().max()) <= 4 / 255 / 2 + 1e-6


def test_frechet_distances():
    """They are nothing for the same blocks, and the formula's for known distributions."""
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (64, 80, 3)).astype(np.uint8)
    stripes = np.repeat(np.uint8(127 + 100 * np.sin(np.mgrid[:64, :80][1] / 3))[..., None], 3, 2)
    assert features.frechet([noise], [noise]) == pytest.approx(0, abs=1e-6)
    assert features.frechet([noise], [stripes]) > 10 * features.frechet([noise], [noise[::-1]])


def test_frechet_distances_are_those_of_the_formula(monkeypatch):
    blocks = {0: np.random.default_rng(1).normal(size=(500, 4)), 1: None}
    blocks[1] = blocks[0] * 2 + 3
    monkeypatch.setattr(features, "blocks", lambda k: [blocks[k]])
    spread = float(np.trace(np.cov(blocks[0], rowvar=False)))
    away = float(((blocks[0].mean(0) + 3) ** 2).sum())
    # The root of the product of C and 4 C is 2 C, so 1 + 4 - 2 * 2 traces of C are left.
    assert features.frechet([0], [1]) == pytest.approx(away + spread)
