"""Two layers that become one: what was cut is whole again, and the picture stays."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.edit.regions import coverage
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.coverage import FULL
from tests.edit.test_cut import HEIGHT, WHERE, WIDTH, image, mask, round_, with_more_behind
from tests.support.edits import covered, grown
from tests.support.pyramids import cut_picture, picture

__all__ = ["image", "mask"]
pytestmark = pytest.mark.encoder
CANVAS = 0, 0, WIDTH, HEIGHT


@pytest.mark.parametrize("where", WHERE)
@pytest.mark.parametrize("saved", [False, True])
def test_what_was_cut_is_whole_again(image, mask, where, saved):
    layer = "disc" if where == "beside" else where
    cut = image.layers[layer].cut(mask(round_(*WHERE[where])))
    there = cut.layers["part"].moved(6, 3).layers["part"].moved(-6, -3)
    if saved:
        there = pxi.from_bytes(there.to_bytes())
    whole = there.layers[layer].merged("part")
    assert whole.baked().to_bytes() == image.to_bytes()
    assert whole.undone(4).to_bytes() == image.to_bytes()
    assert whole.undone().to_bytes() == there.to_bytes()
    other = there.layers["part"].merged(layer)
    assert [v.name for v in other.layers] == [
        "part" if v.name == layer else v.name for v in image.layers
    ]


def test_two_parts_become_one(image, mask):
    """Parts that lie apart have the paths of both; those that overlap one around both."""
    one = image.layers["back"].cut(mask(round_(*WHERE["back"]), "one"))
    for x, paths in ((20, 1), (52, 2)):
        two = one.layers["back"].cut(mask(round_(x, 8, 5.2), "two"))
        both = two.layers["one"].merged("two")
        same_when_loaded(both)
        assert len(both.layers["one"].boundary.paths) == paths
        np.testing.assert_allclose(
            both.render(dtype=np.float32), image.render(dtype=np.float32), atol=1e-5
        )
        shape = coverage(both.layers["one"].boundary, CANVAS)
        parts = [coverage(two.layers[name].boundary, CANVAS) for name in ("one", "two")]
        off = np.abs(shape - np.maximum(*parts)) / FULL
        assert off.max() <= (0 if paths == 2 else 0.35)
        whole = both.layers["back"].merged("one")
        assert whole.baked().to_bytes() == image.to_bytes()


def test_hidden_samples_stay_with_the_layer_that_holds_the_other(made_up_planes, mask):
    image = with_more_behind()
    both = image.layers["back"].merged("bar")
    assert both.layers["back"].texture.behind is image.layers["back"].texture.behind
    same_when_loaded(both)
    with pytest.raises(UsageError, match="stored beside the planes"):
        image.layers["bar"].merged("disc")


def same_when_loaded(edited):
    again = pxi.from_bytes(edited.to_bytes())
    assert again.to_bytes() == edited.to_bytes()
    np.testing.assert_array_equal(again.render(), edited.render())


@pytest.mark.parametrize("made", [cut_picture, picture])
@pytest.mark.parametrize("names", [("bar", "disc"), ("disc", "bar"), ("back", "bar")])
def test_layers_of_one_raster(made_up_planes, made, names):
    """At rest nothing changes; the merged layer moves as one and leaves nothing behind."""
    image = made()
    both = image.layers[names[0]].merged(names[1])
    assert {v.name for v in both.layers} == {"back", "bar", "disc"} - {names[1]}
    same_when_loaded(both)
    assert both.undone().to_bytes() == image.to_bytes()
    if "back" not in names:
        off = np.abs(both.render(dtype=np.float32) - image.render(dtype=np.float32)).max(-1)
        rim = coverage(both.layers[names[0]].boundary, CANVAS)
        rim = grown((rim > 0) & (rim < rim.max()), 1)
        assert off[~rim].max() < 1e-5
        if made is cut_picture:
            assert off.max() < 1e-5
            shown = both.layers["back"].texture.shown
            gone = both.layers[names[0]].removed().layers["back"].texture.shown
            assert not (gone & ~shown).any()
            assert not (gone & covered(both, names[0])).any()


def test_others_between_may_be_passed_if_they_are_beside(made_up_planes, mask):
    image = cut_picture()
    one = image.layers["back"].cut(mask(round_(*WHERE["back"]), "one"))
    front = one.layers["one"].reordered("front")
    whole = front.layers["back"].merged("one")
    np.testing.assert_array_equal(whole.render(), image.render())
    assert whole.baked().to_bytes() == image.to_bytes()
    disc = image.layers["disc"].cut(mask(round_(*WHERE["disc"])))
    between = disc.layers["part"].reordered("front").layers["bar"].reordered(2)
    assert [v.name for v in between.layers] == ["back", "disc", "bar", "part"]
    ok = between.layers["disc"].merged("part")
    assert [v.name for v in ok.layers] == ["back", "disc", "bar"]
    over = between.layers["bar"].moved(0, -12)
    with pytest.raises(UsageError, match="'bar' between 'disc' and 'part'"):
        over.layers["disc"].merged("part")


def test_children_follow_the_merged_layer(image, mask):
    cut = image.layers["disc"].cut(mask(round_(*WHERE["disc"])))
    led = cut.layers["bar"].with_parent("part")
    whole = led.layers["disc"].merged("part")
    assert [v.parent for v in whole.layers] == [None, "disc", None]
    assert led.layers["part"].merged("disc").layers["part"].parent is None
    grouped = cut.edited({"op": "group", "layers": ["disc"], "name": "g"})
    looped = grouped.edited({"op": "parent", "layer": "g", "to": "bar"})
    assert looped.layers["disc"].merged("part").groups["g"] == "bar"


def test_what_cannot_be_merged(image, small_pxi, mask):
    cut = image.layers["disc"].cut(mask(round_(*WHERE["disc"])))
    part = cut.layers["part"]
    for edited, said in (
        (part.moved(1, 0), "moved apart; move one back"),
        (part.hidden(), "one is hidden"),
        (part.recoloured(hue=40), "differ in colour"),
        (part.with_opacity(0.5), "translucent"),
        (part.dragged({(33, 19): (2, -3), (33, 26): (0, 0)}), "bent or moves; --group"),
    ):
        with pytest.raises(UsageError, match=said):
            edited.layers["disc"].merged("part")
    with pytest.raises(UsageError, match="twice"):
        part.merged("part")
    with pytest.raises(UsageError, match="--group NAME=bar,disc"):
        pxi.open(small_pxi).layers["disc"].merged("bar")


def test_flag(tool, small_pxi, tmp_path, mask):
    out = tmp_path / "out.pxi"
    name = mask(round_(*WHERE["disc"]))
    tool("edit", small_pxi, out, "--cut", f"disc={name}", "--merge", "2", "part", "--bake")
    assert out.read_bytes() == small_pxi.read_bytes()
