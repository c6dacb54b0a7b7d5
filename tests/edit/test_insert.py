"""Layers of other files, and cut-out pictures, that are inserted."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.cli.edit_flags import FLAGS
from proxyimg_codec.errors import InputError, UsageError
from proxyimg_codec.io import raster
from tests.support.edits import covered, grown
from tests.support.pictures import disc, smooth
from tests.support.pyramids import cut_picture, planes


def same_when_loaded(edited, before):
    again = pxi.from_bytes(edited.to_bytes())
    assert again.to_bytes() == edited.to_bytes()
    np.testing.assert_array_equal(again.render(), edited.render())
    assert again.undone().to_bytes() == before.to_bytes()


@pytest.fixture(params=["implicit", "pyramid"])
def other(request, small_pxi, made_up_planes, tmp_path):
    """File of another picture of the same size, with each kind of texture."""
    path = tmp_path / "other.pxi"
    if request.param == "implicit":
        pxi.open(small_pxi).layers["disc"].recoloured(hue=90).save(path)
    else:
        cut_picture(planes("other")).save(path)
    return path


def test_a_layer_of_another_file(small_pxi, made_up_planes, other):
    """It looks as alone in its file, well inside of its outline, in whichever picture it lies."""
    home = pxi.open(other)
    alone = home.render(layers=["disc"])
    for image in (pxi.open(small_pxi), cut_picture()):
        both = image.inserted(str(other), "disc")
        assert [v.name for v in both.layers] == ["back", "bar", "disc", "disc 2"]
        same_when_loaded(both, image)
        far = ~grown(covered(home, "disc"), 1)
        np.testing.assert_array_equal(both.render()[far], image.render()[far])
        inside = ~grown(~covered(home, "disc"), 4)
        np.testing.assert_array_equal(both.render()[inside], alone[inside][:, :3])
        old, new = ({(c.type, c.payload) for c in v.chunks} for v in (image, both))
        assert {t for t, _ in old - new} <= {"HEAD", "iNFO"}


def test_what_its_neighbours_were_does_not_come_along(made_up_planes, tmp_path):
    image = cut_picture()
    path = tmp_path / "other.pxi"
    cut_picture(planes("other")).save(path)
    new = image.inserted(str(path), "bar").layers["bar 2"]
    assert new.texture.cuts is None
    assert new.texture.mask is not None
    shown = new.texture.shown
    x, y, w, h = new.box
    assert not (shown & covered(image, "disc")[y : y + h, x : x + w]).any()


def test_places_and_order(small_pxi, other):
    image = pxi.open(small_pxi)
    put = image.inserted(str(other), 2, at=(20, 30), over="back", name="sun")
    assert [v.name for v in put.layers] == ["back", "sun", "bar", "disc"]
    x0, y0, x1, y1 = put.layers["sun"].outline.bounds()
    assert abs((x0 + x1) / 2 - 20) <= 1
    assert abs((y0 + y1) / 2 - 30) <= 1
    under = image.inserted(str(other), "disc", under="disc")
    assert [v.name for v in under.layers] == ["back", "bar", "disc 2", "disc"]
    twice = put.inserted(str(other), "disc", name="moon")
    assert twice.layers["moon"].texture.network == put.layers["sun"].texture.network


def test_a_back_becomes_a_rectangle(small_pxi, other):
    image = pxi.open(small_pxi)
    both = image.inserted(str(other), "back", at=(10, 10)).layers["back 2"].scaled(0.5)
    assert both.opaque
    x0, y0, x1, y1 = both.layers["back 2"].outline.bounds()
    assert (x0, y0, x1, y1) == (-6, -2, 26, 22)
    np.testing.assert_array_equal(both.render()[23:, 27:], image.render()[23:, 27:])


def test_poses_come_along_and_motions_do_not(moving_pxi, small_pxi, tmp_path):
    moving = pxi.open(moving_pxi)
    name = next(v.name for v in moving.layers if v.track)
    path = tmp_path / "bent.pxi"
    moving.layers[name].rotated(20).layers[name].with_opacity(0.5).save(path)
    image = pxi.open(small_pxi)
    both = image.inserted(str(path), name, name="new")
    new, old = both.layers["new"], pxi.open(path).layers[name]
    assert new.track is None
    assert (new.pose.matrix, new.pose.shift) == (old.pose.matrix, old.pose.shift)
    same_when_loaded(both, image)
    assert both.layers["new"].moved(3, 1).layers["new"].moved(-3, -1).baked() == both.baked()


def test_what_cannot_be_inserted(small_pxi, other, tmp_path):
    image = pxi.open(small_pxi)
    with pytest.raises(UsageError, match=r"no file 'nothing\.png'"):
        image.inserted("nothing.png")
    with pytest.raises(UsageError, match="no file"):
        image.inserted(str(tmp_path))
    with pytest.raises(UsageError, match="no layer 'cat'"):
        image.inserted(str(other), "cat")
    with pytest.raises(UsageError, match="over or under"):
        image.inserted(str(other), over="bar", under="disc")
    with pytest.raises(UsageError, match="behind 'back', the opaque back"):
        image.inserted(str(other), under="back")
    with pytest.raises(UsageError, match="already"):
        image.inserted(str(other), name="bar")
    with pytest.raises(UsageError, match="range"):
        image.inserted(str(other), at=(1e9, 0))


@pytest.mark.encoder
def test_a_cut_out_picture(small_pxi, tmp_path):
    """Its clear parts stay clear; its rim has its own colours, not those of what was clear."""
    image = pxi.open(small_pxi)
    shape = disc(40, 32)
    pixels = np.dstack([smooth(40, 32), 255 * shape.astype(np.uint8)])
    pixels[~shape, :3] = (255, 0, 255)
    raster.write(tmp_path / "star.png", pixels)
    both = image.inserted(str(tmp_path / "star.png"), at=(20, 16), effort=1)
    assert both.layers[-1].name == "star"
    same_when_loaded(both, image)
    alone = both.render(layers=["star"])
    there = alone[:32, :40, 3] > 127
    assert (there & shape).sum() > 0.97 * (there | shape).sum()
    rim = there & shape & grown(~shape, 1)
    off = alone[:32, :40, :3].astype(int) - smooth(40, 32)
    assert np.abs(off[rim]).mean() < 12
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError):
        image.inserted(str(tmp_path / "text.png"))
    far = ~grown(covered(both, "star"), 1)
    np.testing.assert_array_equal(both.render()[far], image.render()[far])
    whole = image.inserted(str(tmp_path / "star.png"), effort=1).layers["star"]
    x0, y0, x1, y1 = whole.outline.bounds()
    assert np.abs(np.subtract(((x0 + x1) / 2, (y0 + y1) / 2), (32, 24))).max() <= 2


def test_flags(tool, small_pxi, other, tmp_path):
    parse = next(flag.parse for flag in FLAGS if flag.name == "--insert")
    for words, values in (
        ("a.png", {"source": "a.png"}),
        ("cat=a.pxi:sun@3,-4.5", {"over": "cat", "source": "a.pxi", "from_layer": "sun",
                                  "at": [3.0, -4.5]}),
        ("under:2=me@home.png", {"under": 2, "source": "me@home.png"}),
    ):  # fmt: skip
        assert parse(words) == {"op": "insert", **values}
    out = tmp_path / "out.pxi"
    tool("edit", small_pxi, out, "--insert", f"under:1={other}:disc@9,9", "--move", "disc 2", "1,1")
    assert [v.name for v in pxi.open(out).layers] == ["back", "disc 2", "bar", "disc"]
    tool("edit", small_pxi, other, "--insert", f"{other}:disc", "--force", code=2)
    tool("edit", small_pxi, out, "--insert", "bar=", code=2)
