"""Layers that are cut out of others: the picture stays, and what is taken shows once only."""

import json
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.cli.edit_flags import FLAGS
from proxyimg_codec.codec.read import from_state
from proxyimg_codec.codec.write import state
from proxyimg_codec.edit.regions import coverage
from proxyimg_codec.errors import InputError, UsageError
from proxyimg_codec.geometry.coverage import FULL
from proxyimg_codec.io import raster
from proxyimg_codec.texture.completion import Copies
from tests.support import pyramids
from tests.support.edits import covered, grown
from tests.support.images import changed
from tests.support.pyramids import cut_picture, picture, planes

pytestmark = pytest.mark.encoder

WIDTH, HEIGHT = 64, 48
KINDS = ["implicit", "pyramid", "masked", "alpha", "behind"]


@pytest.fixture(params=KINDS)
def image(request, small_pxi, made_up_planes, monkeypatch):
    """A picture with the layers back, bar and disc, of each kind of texture."""
    made_up = pyramids.raster

    def made(name, size, components):
        found = made_up(name, size, components)
        return np.ones_like(found) if name == "white" else found

    monkeypatch.setattr(pyramids, "raster", made)
    makers = {
        "implicit": lambda: pxi.open(small_pxi),
        "pyramid": cut_picture,
        "masked": picture,
        "behind": with_more_behind,
        "alpha": lambda: cut_picture(planes("colour"), planes("white", components=1)),
    }
    return makers[request.param]()


def with_more_behind():
    """A picture whose layers have hidden samples of their own, and copy others."""
    image = cut_picture()
    layers = []
    for layer in image.layers:
        _, _, width, height = layer.box
        sources = np.ones((-(-height // 8), -(-width // 8)), np.uint8)
        copies = Copies(3, np.array([[9, -5]], np.int32), sources)
        own = planes("hidden", (width, height)) if layer.name == "back" else None
        layers.append(
            replace(layer.data, texture=replace(layer.texture, behind=own, copies=copies))
        )
    return changed(image, layers=layers)


@pytest.fixture
def mask(tmp_path):
    """Writes what a function of x and y says of pixel centres as a mask, and returns its name."""

    def write(inside, name="part"):
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
        values = np.repeat(inside(x, y)[..., None] * np.uint8(255), 3, 2)
        raster.write(tmp_path / f"{name}.png", values)
        return str(tmp_path / f"{name}.png")

    return write


def round_(cx, cy, r):
    return lambda x, y: np.hypot(x - cx, y - cy) < r


WHERE = {"disc": (33, 22, 5.5), "bar": (12, 40, 7.5), "back": (9, 11, 7.3), "beside": (40, 24, 9)}
"""Parts of layers: the last reaches beyond the outline of the disc."""


@pytest.mark.parametrize("where", WHERE)
@pytest.mark.parametrize("moved", [False, True])
def test_the_picture_stays_and_comes_back(image, mask, where, moved):
    cx, cy, r = WHERE[where]
    layer = "disc" if where == "beside" else where
    if moved:
        if layer == "back":
            pytest.skip("a back that has moved leaves holes")
        image = image.layers[layer].scaled(1.1, 0.9, pivot=(cx, cy)).layers[layer].moved(3, -2)
        cx, cy = cx + 3, cy - 2
    cut = image.layers[layer].cut(mask(round_(cx, cy, r)))
    assert [v.name for v in cut.layers] == [
        n for v in image.layers for n in ((v.name, "part") if v.name == layer else (v.name,))
    ]
    before, after = (v.render(dtype=np.float32, engine="numpy") for v in (image, cut))
    off = np.abs(after - before)
    if moved:
        # Interpolation reaches beyond outlines, to samples that are filled there; so are those at
        # the rim of what has moved, from samples that are no longer the same.
        inside = coverage(cut.layers["part"].outline, (0, 0, WIDTH, HEIGHT))
        rim = grown((inside > 0) & (inside < FULL), 4)
        if getattr(image.layers[layer].texture, "copies", None) is None:  # those made up copy noise
            assert off[~rim].max() < 0.03
        assert off.mean() < 0.01
    else:
        assert off.max() < 1e-5
    again = pxi.from_bytes(cut.to_bytes())
    assert again.to_bytes() == cut.to_bytes()
    np.testing.assert_array_equal(again.render(), cut.render())
    assert again.undone().to_bytes() == image.to_bytes()
    there = cut.layers["part"].moved(6, 3)
    assert (there.render() != cut.render()).any()
    back = there.layers["part"].moved(-6, -3)
    assert back.baked().to_bytes() == cut.baked().to_bytes()


@pytest.mark.parametrize("where", ["disc", "back"])
def test_what_is_taken_shows_once(image, mask, where):
    """Where the part was, the old layer no longer has its colours: it takes those around."""
    cut = image.layers[where].cut(mask(round_(*WHERE[where])))
    old, part = cut.layers[where], cut.layers["part"]
    whole = coverage(part.boundary, (0, 0, WIDTH, HEIGHT)) == FULL
    assert whole.sum() > 40
    if old.texture.network is None:
        x, y, w, h = old.box
        assert not old.texture.shown[whole[y : y + h, x : x + w]].any()
    else:
        stored = image.layers[where].texture.stored
        assert part.texture.stored.sum() < stored.sum()
        np.testing.assert_array_equal(old.texture.stored | part.texture.stored, stored)
        return
    left = cut.layers["part"].hidden().render().astype(int)
    assert (np.abs(left - image.render())[whole].max(-1) > 1).mean() > 0.5
    far = ~grown(covered(image, "disc") | covered(cut, "part"), 9)
    np.testing.assert_array_equal(left[far], image.render()[far])


def test_parts_follow_what_they_were_cut_from(image, mask):
    cut = image.layers["disc"].cut(mask(round_(*WHERE["disc"])))
    assert cut.layers["part"].parent == "disc"
    assert image.layers["back"].cut(mask(round_(*WHERE["back"]))).layers["part"].parent is None
    moved = cut.layers["disc"].moved(4, 1)
    assert moved.layers["part"].pose.shift == (4 << 10, 1 << 10)


def test_a_part_has_a_mesh_if_others_have(image, mask):
    cut = image.layers["disc"].cut(mask(round_(*WHERE["disc"])))
    assert (cut.layers["part"].mesh is None) == (image.layers["disc"].mesh is None)
    bent = cut.layers["part"].dragged({(33, 19): (2, -3), (33, 26): (0, 0)})
    np.testing.assert_array_equal(pxi.from_bytes(bent.to_bytes()).render(), bent.render())


def test_a_moving_layer_and_its_part_move_alike(moving_pxi, mask):
    image = pxi.open(moving_pxi)
    layer = next(v for v in image.layers if v.track)
    x, y, w, h = layer.box
    cut = layer.cut(mask(round_(x + w / 2, y + h / 2, 5)))
    for t in (0.0, 0.3):
        np.testing.assert_allclose(
            cut.render(t=t).astype(int), image.render(t=t).astype(int), atol=1
        )


def test_names(image, mask):
    one = image.layers["disc"].cut(mask(round_(*WHERE["disc"]), "2 bar"))
    assert "bar 2" in {v.name for v in one.layers}
    named = image.layers["disc"].cut(mask(round_(*WHERE["disc"])), name="eye")
    assert named.layers[-1].name == "eye"
    with pytest.raises(UsageError, match="already"):
        image.layers["disc"].cut(mask(round_(*WHERE["disc"])), name="bar")


def test_points_find_what_is_there(plain_maps):
    pixels = np.full((48, 64, 3), 200, np.uint8)
    pixels[10:30, 20:50] = (180, 40, 30)
    image = pxi.encode(pixels, effort=1, max_layers=1)
    cut = image.layers["picture"].cut(points=[(35, 20)], outside=[(5, 5)])
    assert [v.name for v in cut.layers] == ["picture", "picture part"]
    found = coverage(cut.layers[1].boundary, (0, 0, 64, 48)) > 0
    box = (pixels != 200).any(-1)
    assert (found & box).sum() > 0.85 * (found | box).sum()
    np.testing.assert_allclose(cut.render().astype(int), image.render().astype(int), atol=1)
    assert len(cut.baked().to_bytes()) < len(image.to_bytes()) + 200


def test_what_cannot_be_cut(image, mask):
    disc, good = image.layers["disc"], mask(round_(*WHERE["disc"]))
    for edited, said in (
        (disc.hidden(), "hidden"),
        (disc.with_opacity(0.5), "translucent"),
        (disc.dragged({(32, 14): (4, 0), (32, 34): (0, 0)}), "bent"),
        (disc.textured("bar", fit="shape"), "fitted|stretched"),
    ):
        with pytest.raises(UsageError, match=said):
            edited.layers["disc"].cut(good)
    with pytest.raises(UsageError, match="nothing of layer 'disc'; it lies elsewhere"):
        disc.cut(mask(round_(5, 5, 4), "a"))
    with pytest.raises(UsageError, match="all of layer 'disc'"):
        disc.cut(mask(lambda x, y: x >= 0, "b"))
    with pytest.raises(InputError, match=r"cannot read the mask"):
        disc.cut("nowhere.png")
    with pytest.raises(UsageError, match="either a mask"):
        disc.cut(good, points=[(3, 3)])
    with pytest.raises(InputError, match="outside"):
        disc.cut(points=[(300, 3)])


def test_hidden_and_translucent_parts_are_refused(made_up_planes, mask):
    image = cut_picture()
    with pytest.raises(UsageError, match="others hide it"):
        image.layers["back"].cut(mask(round_(32, 23, 5)))
    soft = cut_picture(planes("colour"), planes("soft", components=1))
    with pytest.raises(UsageError, match="translucent in places"):
        soft.layers["disc"].cut(mask(round_(*WHERE["disc"])))


def test_a_mask_of_another_size(image, tmp_path):
    raster.write(tmp_path / "m.png", np.full((20, 20, 3), 255, np.uint8))
    with pytest.raises(InputError, match="20x20"):
        image.layers["disc"].cut(str(tmp_path / "m.png"))


def test_the_state_before_is_what_is_undone(image, mask):
    cut = image.layers["bar"].cut(mask(round_(*WHERE["bar"])))
    assert state(from_state(cut.history[-1].chunks)) == state(image)
    assert json.loads(cut.history[-1].operation)["op"] == "cut"


def test_words_of_the_command_line(tool, small_pxi, mask, tmp_path):
    parse = next(flag.parse for flag in FLAGS if flag.name == "--cut")
    assert parse("cat@1,2@!3,4@5,6") == {
        "op": "cut", "layer": "cat", "points": [[1.0, 2.0], [5.0, 6.0]], "outside": [[3.0, 4.0]],
    }  # fmt: skip
    name = mask(round_(*WHERE["disc"]))
    tool("edit", small_pxi, tmp_path / "out.pxi", "--cut", f"2={name}", "--move", "part", "1,2")
    assert pxi.open(tmp_path / "out.pxi").layers["part"].pose.shift == (1 << 10, 2 << 10)
    tool("edit", small_pxi, name, "--cut", f"2={name}", "--force", code=2)
    for bad in ("disc", "disc=", "disc@1", "disc@1,2,3"):
        tool("edit", small_pxi, tmp_path / "no.pxi", "--cut", bad, code=2)
