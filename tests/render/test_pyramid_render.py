"""Pictures of pyramid textures: three layers, each with its part of one raster."""

from dataclasses import replace

import numpy as np
import pytest

from proxyimg_codec.api import Image
from proxyimg_codec.errors import FormatError
from proxyimg_codec.model import Layers
from proxyimg_codec.render import compose
from proxyimg_codec.texture.planes import Planes
from tests.support.images import changed
from tests.support.pyramids import SIZE, cut_picture, filled, picture, planes, showing, view
from tests.support.textures import ENGINES


def test_at_rest_the_picture_is_the_raster(pyramid):
    """Edges too: layers in front and behind show the same samples there."""
    expected = planes("colour").raster
    out = pyramid.render(dtype=np.float32)
    np.testing.assert_allclose(out, expected, atol=1e-6)
    assert pyramid.networks == ()
    assert not any(filled(v.texture) for v in pyramid.layers)


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("by", [None, (0, 0), (3, -2)])
def test_outlines_are_covered_once_for_each_tile(monkeypatch, scale, by):
    """Work counts against limits: nothing is computed to be thrown away."""
    asked, own = [], compose.cover.coverage

    def counted(paths, *box_and_budget):
        asked.append((id(paths), box_and_budget[:4]))
        return own(paths, *box_and_budget)

    monkeypatch.setattr(compose.cover, "coverage", counted)
    monkeypatch.setattr(compose, "TILE_SAMPLES", 700)
    still = Image(cut_picture())
    image = still if by is None else still.layers[1].moved(*by)
    image.render(scale=scale)
    assert len(asked) > 2
    assert len(asked) == len(set(asked))


def test_what_was_hidden_is_smooth(pyramid):
    back = pyramid.render(layers=["back"], dtype=np.float32)
    expected = planes("colour").raster
    known = pyramid.layers["back"].texture.mask.repeat(4, 0).repeat(4, 1)
    np.testing.assert_allclose(back[known], expected[known], atol=1e-6)
    hidden = back[~known]
    assert 0 < len(hidden) < 300
    seen = expected[known]
    assert (hidden >= seen.min(0)).all()
    assert (hidden <= seen.max(0)).all()
    assert np.abs(hidden - expected[~known]).mean() > 0.02


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_agree(engine, pyramid):
    reference = pyramid.render(engine="numpy", scale=1.7)
    pyramid.cache.clear()
    np.testing.assert_array_equal(pyramid.render(engine=engine, scale=1.7), reference)


def test_enlarging_interpolates_and_reducing_averages(pyramid):
    back = changed(pyramid.layers["back"], texture=view(planes("colour")))
    flat = changed(pyramid, layers=Layers([back]), info=None)
    expected = planes("colour").raster
    small = flat.render(scale=0.5, dtype=np.float32)
    np.testing.assert_allclose(small, expected.reshape(24, 2, 32, 2, 3).mean((1, 3)), atol=1e-6)
    large = flat.render(scale=3, dtype=np.float32)
    np.testing.assert_allclose(large[1::3, 1::3], expected, atol=1e-6)
    assert np.abs(large[10, 10:170] - expected[3, np.arange(10, 170) // 3]).max() > 0.01


def test_regions_and_tiles_are_parts_of_the_whole(pyramid, monkeypatch):
    whole = pyramid.render(scale=3)
    part = pyramid.render(region=(10, 7, 20, 15), scale=3)
    np.testing.assert_array_equal(whole[21:66, 30:90], part)
    for samples in (50, 5000):
        monkeypatch.setattr(compose, "TILE_SAMPLES", samples)
        np.testing.assert_array_equal(pyramid.render(scale=3), whole)


def test_grey_planes_are_grey(made_up_planes):
    source = planes("grey", components=1)
    out = picture(source).render(dtype=np.float32)
    np.testing.assert_allclose(out, source.raster.repeat(3, 2), atol=1e-6)


def test_alpha_is_straight_in_the_planes(made_up_planes):
    """What is clear multiplies the colour, and comes out again as straight alpha."""
    source, soft = planes("colour"), planes("soft", components=1)
    showing(soft, np.maximum(soft.raster, np.float32(0.1)))
    image = picture(source, soft)
    back = changed(image.layers[0], texture=view(source, soft))
    out = changed(image, layers=Layers([back]), info=None).render(dtype=np.float32)
    np.testing.assert_allclose(out[..., :3], source.raster, atol=1e-5)
    np.testing.assert_allclose(out[..., 3:], soft.raster, atol=1e-6)
    over = image.render(layers=["back", "disc"], dtype=np.float32)[24, 40]
    a, c = soft.raster[24, 40, 0], source.raster[24, 40]
    fill = image.render(layers=["back"], dtype=np.float32)[24, 40]
    behind = fill[3] * (1 - a)
    assert over[3] == pytest.approx(a + behind, abs=1e-5)
    np.testing.assert_allclose(over[:3], (a * c + behind * fill[:3]) / (a + behind), atol=1e-5)


def test_overshoot_of_the_kernel_is_clamped(pyramid):
    source = planes("colour")
    showing(source, np.zeros((48, 64, 3), np.float32))
    source.raster[:, 32:] = 1
    back = changed(pyramid.layers["back"], texture=view(source))
    image = changed(pyramid, layers=Layers([back]), info=None)
    plain = back.texture.sample(np.array([31.25, 32.75]), np.array([9.5, 9.5]), back.box)
    assert plain[0, 0] < -0.05
    assert plain[1, 0] > 1.05
    out = image.render(scale=4, dtype=np.float32)
    assert out.min() == 0
    assert out.max() == 1


def test_other_textures_in_the_same_place_are_not_mixed_up(pyramid):
    """Images made from each other share a cache."""
    pyramid.render()
    other = planes("other")
    disc = pyramid.layers["disc"]
    for texture in (
        replace(disc.texture, planes=other), replace(disc.texture, part=(0, 0, 31, 30)),
        replace(disc.texture, mask=None),
    ):  # fmt: skip
        layers = [*pyramid.layers[:2], changed(disc, texture=texture)]
        other = changed(pyramid, layers=Layers(layers))
        assert other.cache is pyramid.cache
        fresh = Image(other)
        np.testing.assert_array_equal(other.render(scale=2), fresh.render(scale=2))


def test_corrupt_planes_are_found_when_they_are_drawn(pyramid, monkeypatch):
    def corrupt(self, window):
        raise FormatError("the stream is corrupt", "chunk PLAN 0")

    monkeypatch.setattr(Planes, "samples", corrupt)
    with pytest.raises(FormatError, match="PLAN 0: the stream"):
        picture(Planes(planes("colour").packed)).render()


def test_the_size_of_the_raster_is_free(made_up_planes):
    """Half as many samples as pixels: those in the middle of four pixels mix their neighbours."""
    source = planes("half", (32, 24))
    image = picture(planes("colour"))
    back = changed(image.layers[0], texture=view(source))
    out = changed(image, layers=Layers([back]), info=None).render(dtype=np.float32)
    means = out.reshape(24, 2, 32, 2, 3).mean((1, 3))
    assert np.abs(means - source.raster).mean() < 0.03
    assert out.shape == (SIZE[1], SIZE[0], 3)
    # At a quarter of a sample, cubic convolution with a = -1/2 in both directions.
    w = np.array([-9, 111, 29, -3]) / 128
    around = source.raster[np.ix_([6, 5, 4, 3], [10, 9, 8, 7])]
    np.testing.assert_allclose(out[10, 18], np.einsum("y,x,yxc->c", w, w, around), atol=1e-5)
