"""Pixels that no layer shows any more leave a file for good."""

from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.edit.purge import hidden_samples, leaves_pixels
from proxyimg_codec.errors import UsageError
from tests.support import hidden
from tests.support.edits import grown


@pytest.fixture(scope="module")
def image():
    return hidden.encoded("red")


@pytest.fixture(scope="module")
def removed(image):
    return image.layers["disc"].removed()


@pytest.fixture(scope="module")
def purged(removed):
    return removed.purged(1)


def test_what_was_removed_is_gone(image, removed, purged):
    data = pxi.from_bytes(purged.to_bytes())
    assert not data.history
    raster = data.layers["back"].texture.planes.raster
    # The disc is far redder than what is around it; what takes its place is not.
    was, now = (v[..., 0] - v[..., 1:].max(-1) for v in
                (image.layers["back"].texture.planes.raster, raster))  # fmt: skip
    around = grown(hidden.OBJECT, 12) & ~grown(hidden.OBJECT, 3)
    assert was[hidden.OBJECT].mean() - was[around].mean() > 0.3
    assert abs(now[hidden.OBJECT].mean() - now[around].mean()) < 0.05
    stream = image.layers["back"].texture.planes.packed["data"]
    assert stream in removed.baked().to_bytes()
    assert stream not in purged.to_bytes()
    assert hidden_samples(removed) > hidden.OBJECT.sum() > hidden_samples(purged)


def test_the_picture_looks_the_same(removed, purged):
    same = pxi.from_bytes(purged.to_bytes())
    np.testing.assert_array_equal(same.render(), purged.render())
    change = np.abs(purged.render().astype(int) - removed.render())
    assert change.max() < 20
    assert change[~grown(hidden.OBJECT, 12)].max() < 5


def test_other_chunks_stay_the_same_bytes(removed, purged):
    for one, two in zip(removed.chunks, purged.chunks, strict=True):
        assert (one == two) == (one.type != "PLAN")


@pytest.mark.parametrize("edit", [
    lambda v: v.image, lambda v: v.moved(20, 9), lambda v: v.hidden(), lambda v: v.with_opacity(0),
    lambda v: v.rotated(30), lambda v: v.reordered("back"), lambda v: v.duplicated(),
])  # fmt: skip
def test_what_a_layer_may_show_again_stays(image, edit):
    edited = edit(image.layers["disc"])
    assert hidden_samples(edited) == 0
    assert edited.purged().to_bytes() == edited.baked().to_bytes()


def test_lent_textures_stay_and_replaced_ones_go(image):
    swapped = image.layers["disc"].textured("back")
    purged = pxi.from_bytes(swapped.purged(1).to_bytes())
    assert purged.layers["disc"].texture.planes is purged.layers["back"].texture.planes
    assert np.abs(purged.render().astype(int) - swapped.render()).max() < 20
    red = purged.layers["back"].texture.planes.raster[hidden.OBJECT]
    assert red[:, 0].mean() < image.layers["back"].texture.planes.raster[hidden.OBJECT, 0].mean()


def test_alpha_of_what_was_removed_goes_too():
    pixels = np.full((70, 91, 4), (40, 90, 160, 255), np.uint8)
    rows, columns = np.mgrid[:70, :91]
    pixels[..., 3] = np.clip(255 - 3 * rows, 0, 255)  # soft, so that alpha has planes
    spot = np.hypot(rows - 30, columns - 45) < 19
    pixels[spot] = (220, 30, 30, 140)
    image = pxi.encode(pixels, masks={"spot": spot}, effort=1, quality=70)
    removed = image.layers["spot"].removed()
    purged = pxi.from_bytes(removed.purged(1).to_bytes())
    middle = np.s_[24:36, 40:50]
    for one, two in zip(removed.layers[0].texture.sources, purged.layers[0].texture.sources,
                        strict=True):  # fmt: skip
        assert np.abs(one.raster - two.raster)[middle].mean() > 0.1


def test_previews_in_metadata_go(image):
    jpeg = b"\xff\xd8\xff\xe0" + bytes(range(200)) + b"\xff\xd9"
    blocks = {"exif": b"II*\0head" + jpeg + b"tail",
              "xmp": b"<x><xmpGImg:image>/9j/4AAQ</xmpGImg:image></x>"}  # fmt: skip
    purged = pxi.Image(replace(image.picture, blocks=blocks)).purged()
    assert purged.blocks == {
        "exif": b"II*\0head" + bytes(len(jpeg)) + b"tail",
        "xmp": b"<x><xmpGImg:image></xmpGImg:image></x>",
    }


def test_files_without_planes_lose_their_history_only(small_pxi):
    edited = pxi.open(small_pxi).layers["disc"].removed()
    assert edited.purged().to_bytes() == edited.baked().to_bytes()


def test_when_pixels_stay_is_known(image, removed, small_pxi):
    assert leaves_pixels(image.picture, removed.picture)
    assert leaves_pixels(image.picture, image.layers["disc"].textured("back").picture)
    assert not leaves_pixels(image.picture, image.layers["disc"].moved(9, 9).picture)
    assert not leaves_pixels(removed.picture, removed.layers["back"].recoloured(hue=9).picture)
    assert not leaves_pixels(removed.picture, removed.undone().picture)
    # Textures that have nothing in common with others are in the history alone.
    small = pxi.open(small_pxi)
    gone = small.layers["disc"].removed()
    assert leaves_pixels(small.picture, gone.picture)
    assert not leaves_pixels(small.picture, gone.baked().picture)


def test_effort_is_checked(removed):
    with pytest.raises(UsageError, match="effort is 0"):
        removed.purged(0)


def test_what_lies_behind_is_kept():
    """Planes of a view's own have another origin than the part, and all of them can show."""
    rng = np.random.default_rng(4)
    picture = rng.integers(0, 256, (70, 90, 3), np.uint8)
    mask = np.zeros((70, 90), bool)
    mask[20:50, 30:61] = True
    behind = np.full_like(picture, (0, 200, 0))
    image = pxi.encode(picture, masks={"a": mask}, behind=behind, effort=1, texture="pyramid")
    gone = image.layers["a"].removed()
    before, after = gone.render(), gone.purged().render()
    assert (abs(before[28:42, 38:53].astype(int) - (0, 200, 0)) < 30).all()
    assert (before[28:42, 38:53] == after[28:42, 38:53]).all()
