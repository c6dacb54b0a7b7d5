"""Erasure of samples from planes: nothing is left of them, and little else changes."""

import cv2
import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.pyramid import encode as pyramid
from proxyimg_codec.encoder.pyramid import window
from proxyimg_codec.encoder.pyramid.encode import Effort, Raster
from proxyimg_codec.encoder.pyramid.erase import erased
from proxyimg_codec.texture.latents import Latents
from proxyimg_codec.texture.planes import encoded as coded
from tests.support import hidden
from tests.support.edits import grown

QUICK = Effort(0, 1)
KEPT = ~grown(hidden.OBJECT, 3)
"""Samples that stay: those clear of the object."""


def all_latents(planes):
    found = planes.latents
    return [*found.levels, found.lowest]


def over(samples, like, level):
    """Positions of a level, bool like the last two axes of an array, over any of some samples."""
    rows, columns = like.shape[1:]
    side = 1 << level
    h, w = samples.shape
    whole = np.pad(samples, ((0, rows * side - h), (0, columns * side - w)))
    return whole.reshape(rows, side, columns, side).any((1, 3))


@pytest.fixture(scope="module")
def planes():
    """Planes of two pictures that differ in the object, before and after it was erased."""
    before = {c: hidden.encoded(c).layers["disc"].texture.planes for c in hidden.COLOURS}
    return before, {c: erased(p, KEPT, QUICK, 0) for c, p in before.items()}


def test_no_sample_tells_what_was_there(planes):
    before, after = ({c: p.raster * 255 for c, p in v.items()} for v in planes)
    signal = (before["red"] - before["blue"])[hidden.OBJECT]
    left = (after["red"] - after["blue"])[hidden.OBJECT]
    assert np.abs(signal).mean() > 90
    assert np.sqrt((left**2).mean()) < 2
    assert abs((signal * left).sum() / (signal**2).sum()) < 0.003
    # Not even which squares of the pattern are dark.
    y, x = np.mgrid[: hidden.ROWS, : hidden.COLUMNS]
    chequers = ((x // 5 + y // 5) % 2 * 2 - 1)[hidden.OBJECT]
    for colour in before:
        shown = [v[colour][hidden.OBJECT].mean(1) - v[colour][hidden.OBJECT].mean() for v in
                 (before, after)]  # fmt: skip
        was, now = ((v * chequers).mean() for v in shown)
        assert abs(was) > 15
        assert abs(now) < 0.25


def test_no_latent_tells_what_was_there(planes):
    (red, blue), (bare_red, bare_blue) = (map(all_latents, v.values()) for v in planes)
    for k, (a, b, c, d) in enumerate(zip(red, blue, bare_red, bare_blue, strict=True)):
        at = over(hidden.OBJECT, a, min(k + 1, len(red) - 1))
        signal, left = (a - b)[:, at], (c - d)[:, at]
        assert (signal**2).sum() > 100
        assert (left**2).sum() < 0.01 * (signal**2).sum()
        assert abs((signal * left).sum()) < 0.02 * (signal**2).sum()


def test_far_latents_stay_and_samples_nearly(planes):
    before, after = (v["red"] for v in planes)
    for k, (a, b) in enumerate(zip(all_latents(before), all_latents(after), strict=True)):
        level = min(k + 1, 6)
        reach = 4 << level  # of the filters of the analysis of this level and all finer ones
        near = cv2.dilate((~KEPT).astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1))) > 0
        away = ~over(near, a, level)
        # But for one that its changed context takes for certainly 0, see `_Erasure.planes`.
        assert np.abs(a - b)[:, away].sum() <= 1
    change = np.abs(after.raster - before.raster).max(-1) * 255
    distance = cv2.distanceTransform(KEPT.astype(np.uint8), cv2.DIST_L2, 5)
    for least, most in ((1, 24), (3, 14), (9, 7), (25, 2)):
        assert change[distance >= least].max() < most
    assert np.sqrt((change[KEPT] ** 2).mean()) < 1.5


def test_cells_in_the_middle_have_no_latents(planes):
    before, after = (v["red"] for v in planes)
    assert before.support.all()
    assert not after.support[5:8, 7:10].any()
    assert after.support[0].all()
    assert len(after.packed["data"]) < len(before.packed["data"])
    same = ("model", "size", "components", "step", "levels", "cell")
    assert [before.packed[k] for k in same] == [after.packed[k] for k in same]


def test_the_same_again_and_what_is_nothing(planes):
    before, after = (v["red"] for v in planes)
    assert erased(before, KEPT, QUICK, 0).packed == after.packed
    assert erased(before, np.ones_like(KEPT), QUICK, 0) is before


def test_grey_planes_and_windows(monkeypatch):
    """Small windows see only parts of what goes."""
    monkeypatch.setattr(window, "WINDOW", 64)
    samples = np.repeat(hidden.pixels("red")[..., :1], 3, 2).astype(np.float32)
    before, _ = pyramid.encode(Raster(samples, grey=True), 250, QUICK, 0, lambda n: None)
    after = erased(before, KEPT, QUICK, 0)
    assert after.components == 1
    assert after.packed["grey"] == after.packed["levels"]
    inside = [p.raster[hidden.OBJECT].std() for p in (before, after)]
    assert inside[1] < 0.5 * inside[0]
    assert np.abs(after.raster - before.raster)[grown(~KEPT, 9) == 0].max() * 255 < 4


def test_planes_of_model_1():
    """Padded planes keep their model."""
    picture = np.pad(hidden.pixels("blue"), ((0, 11), (0, 53), (0, 0)), mode="edge")
    whole = pxi.encode(picture, max_layers=1, effort=1, quality=70).layers[0].texture.planes
    found = whole.latents
    assert all(y.shape[1:] == (128 >> k, 192 >> k) for k, y in enumerate(found.levels, 1))
    size = hidden.COLUMNS, hidden.ROWS
    latents = Latents(found.levels, found.lowest)
    before = coded(latents, size, whole.packed["step"], number=1)
    after = erased(before, KEPT, QUICK, 0)
    assert after.packed["model"] == 1
    assert after.raster[hidden.OBJECT].std() < 0.5 * before.raster[hidden.OBJECT].std()
    assert np.abs(after.raster - before.raster)[grown(~KEPT, 9) == 0].max() * 255 < 4
