"""Every operation on a picture of pyramid textures, and textures to and from such files."""

import json
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import polygon
from proxyimg_codec.container.chunks import read
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.model import Layers
from proxyimg_codec.texture.completion import Copies
from proxyimg_codec.texture.occlusion import ALL_IN_PLACE, Occlusion
from proxyimg_codec.texture.pyramid import PyramidTexture
from tests.support.edits import EDITS, covered, grown
from tests.support.images import changed
from tests.support.pyramids import cut_picture, implicit, picture, planes, view


def saved(image, path):
    image.save(path)
    return str(path)


@pytest.mark.parametrize("name", EDITS)
def test_only_the_object_changes_and_undo_restores_the_file(pyramid, name):
    before = pyramid.render()
    edited = EDITS[name](pyramid.layers["disc"])
    after = edited.render()
    near = grown(covered(pyramid, "disc"))
    for layer in edited.layers:
        if layer.name not in ("back", "bar"):
            near |= grown(covered(edited, layer.name))
    assert not near.all()
    np.testing.assert_array_equal(after[~near], before[~near])
    if name not in ("duplicate", "order", "rename"):
        assert (after != before).any()
    assert edited.undone().to_bytes() == pyramid.to_bytes()
    assert [json.loads(s.operation)["op"] for s in edited.history] == [name.split()[0]]
    data = edited.to_bytes()
    again = pxi.from_bytes(data)
    assert again.to_bytes() == data
    np.testing.assert_array_equal(again.render(), after)
    assert again.undone().to_bytes() == pyramid.to_bytes()
    assert again.baked().to_bytes() == edited.baked().to_bytes()


@pytest.mark.parametrize("name", EDITS)
def test_the_same_with_alpha(made_up_planes, name):
    image = picture(planes("colour"), planes("soft", components=1))
    edited = EDITS[name](image.layers["disc"])
    again = pxi.from_bytes(edited.to_bytes())
    np.testing.assert_array_equal(again.render(), edited.render())
    assert again.undone().to_bytes() == image.to_bytes()
    assert again.channels == 4


def test_an_edit_stores_no_pixels_anew(pyramid):
    edited = pyramid.layers["disc"].dragged({(32, 14): (6, -2), (32, 34): (0, 0)})
    old, new = ({(c.type, c.payload) for c in v.chunks} for v in (pyramid, edited))
    assert {t for t, _ in new - old} == {"MESH", "POSE"}
    assert not old - new


@pytest.mark.parametrize("by", [(7, -4), (-12, 3)])
def test_a_whole_move_moves_the_samples_themselves(pyramid, by):
    dx, dy = by
    source = planes("colour").raster
    moved = pyramid.layers["disc"].moved(dx, dy).render(layers=["disc"], dtype=np.float32)
    there = moved[24 + dy - 8 : 24 + dy + 8, 32 + dx - 8 : 32 + dx + 8]
    np.testing.assert_array_equal(there[..., :3], source[16:32, 24:40])
    assert (there[..., 3] == 1).all()


def test_quarter_turns_turn_the_samples(pyramid):
    turned = pyramid.layers["disc"].rotated(90, (32, 24))
    out = turned.render(layers=["disc"], dtype=np.float32)[16:32, 24:40, :3]
    source = planes("colour").raster[16:32, 24:40]
    np.testing.assert_allclose(out, np.rot90(source, -1), atol=1e-6)


def test_removal_shows_the_smooth_back(pyramid):
    gone = pyramid.layers["disc"].removed()
    np.testing.assert_array_equal(gone.render(), pyramid.render(layers=["back", "bar"]))
    # The planes are shared: what was removed cannot leave them.
    kinds = [[(c.type, c.payload) for c in v.chunks if c.type == "PLAN"] for v in (pyramid, gone)]
    assert kinds[0] == kinds[1]


def test_planes_that_nothing_shows_leave_the_file(made_up_planes):
    image = picture()
    other = changed(image.layers["disc"], texture=view(planes("other")))
    image = changed(image, layers=Layers([*image.layers[:2], other]))
    gone = image.layers["disc"].removed()
    names = [{c.payload[-5:] for c in v.chunks if c.type == "PLAN"} for v in (image, gone)]
    assert len(names[0]) == 2
    assert len(names[1]) == 1
    assert gone.undone().to_bytes() == image.to_bytes()


def test_order_numbers_planes_anew(made_up_planes):
    image = picture()
    bar, disc = (
        changed(v, texture=replace(v.texture, planes=planes(v.name))) for v in image.layers[1:]
    )
    image = changed(image, layers=Layers([image.layers[0], bar, disc]))
    for edited in (
        image.layers["bar"].reordered("front"), image.layers["disc"].reordered(0),
        image.layers["back"].removed(), image.layers["disc"].duplicated(),
    ):  # fmt: skip
        again = pxi.from_bytes(edited.to_bytes())
        assert again.to_bytes() == edited.to_bytes()
        np.testing.assert_array_equal(again.render(), edited.render())
        assert again.undone().to_bytes() == image.to_bytes()


def test_a_copy_shares_its_view(pyramid):
    copy = pyramid.layers["disc"].duplicated("twin").baked()
    assert copy.layers["twin"].texture is copy.layers["disc"].texture
    assert [len(c.payload) for c in copy.chunks if c.type == "TEXR"][-1] < 20
    assert copy.info["areas"] == [*pyramid.info["areas"], pyramid.info["areas"][2]]


def test_groups_scripts_and_undo(pyramid):
    script = [
        {"op": "group", "layers": ["bar", "disc"], "name": "both"},
        {"op": "move", "layer": "both", "by": [3, 4]},
        {"op": "recolour", "layer": "both", "hue": 90},
        {"op": "texture", "layer": "bar", "source": "disc", "fit": "shape"},
        {"op": "remove", "layer": "disc"},
        {"op": "ungroup", "name": "both"},
    ]
    edited = pxi.from_bytes(pyramid.edited(*script).to_bytes())
    np.testing.assert_array_equal(edited.render(), pyramid.edited(*script).render())
    for steps in range(1, len(script)):
        before = pyramid.edited(*script[:-steps])
        assert edited.undone(steps).to_bytes() == before.to_bytes()
    assert edited.undone(len(script)).to_bytes() == pyramid.to_bytes()


def test_a_box_fit_stretches_the_part(pyramid):
    changed = pyramid.layers["bar"].textured("disc")
    assert changed.layers["bar"].texture is pyramid.layers["disc"].texture
    out = changed.render(layers=["bar"], dtype=np.float32)
    # The bar's box is 59 wide for 31 samples, 11 high for 30; this is the point 18.5, 40.5.
    texture = pyramid.layers["disc"].texture
    want = texture.sample(np.array([18.5]), np.array([40.5]), (3, 36, 59, 11))
    np.testing.assert_allclose(out[40, 18, :3], want[0], atol=1e-6)
    x, y = (18.5 - 3) * 31 / 59 - 0.5, (40.5 - 36) * 30 / 11 - 0.5
    near = planes("colour").raster[9:39, 16:47][round(y), round(x)]
    assert np.abs(out[40, 18, :3] - near).max() < 0.1


@pytest.mark.parametrize("fit", ["box", "shape"])
def test_textures_from_an_implicit_file(pyramid, tmp_path, fit):
    other = saved(implicit(), tmp_path / "implicit.pxi")
    given = pyramid.layers["disc"].textured(other, "bar", fit).baked()
    again = pxi.from_bytes(given.to_bytes())
    assert len(again.networks) == 1
    assert [v.network for v in again.layers] == [None, None, again.networks[0]]
    np.testing.assert_array_equal(again.render(), given.render())
    shown = again.render(layers=["disc"], engine="numpy")
    assert (covered(again, "disc") == (shown[..., 3] > 0)).all()
    if fit == "box":
        bar = implicit().layers["bar"]
        stretched = changed(again.layers["disc"], texture=bar.texture)
        expected = changed(implicit(), layers=Layers([stretched]), info=None, opaque=False)
        np.testing.assert_array_equal(shown, expected.render(engine="numpy"))
    # Without that layer the network goes too.
    assert again.layers["disc"].removed().networks == ()


@pytest.mark.parametrize("fit", ["box", "shape"])
def test_textures_into_an_implicit_file(pyramid, tmp_path, fit):
    other = saved(pyramid, tmp_path / "pyramid.pxi")
    image = implicit()
    changed = image.layers["disc"].textured(other, "disc", fit).baked()
    again = pxi.from_bytes(changed.to_bytes())
    kinds = [type(v.texture) is PyramidTexture for v in again.layers]
    assert kinds == [False, False, True]
    assert again.networks[0].packed == image.networks[0].packed
    assert again.to_bytes() == changed.to_bytes()
    out = again.render(layers=["disc"])
    # Box and outline are the same, so what it shows is too; by shape up to 1/16 px of the nodes.
    inside = out[..., 3] == 255
    away = np.abs(out.astype(int) - pyramid.render(layers=["disc"]))[inside]
    assert away.max() <= (0 if fit == "box" else 8)
    assert inside.sum() > 500
    assert again.layers["disc"].textured("bar").networks == again.networks


def test_planes_that_are_there_already_are_not_stored_again(pyramid, tmp_path):
    other = saved(pyramid.layers["bar"].renamed("plank"), tmp_path / "other.pxi")
    changed = pyramid.layers["disc"].textured(other, "plank").baked()
    assert [c.type for c in changed.chunks].count("PLAN") == 1
    np.testing.assert_array_equal(changed.render(), pyramid.layers["disc"].textured("bar").render())
    twice = pyramid.edited(
        *({"op": "texture", "layer": n, "source": other, "from_layer": "plank"}
          for n in ("disc", "bar"))
    )  # fmt: skip
    assert [c.type for c in twice.chunks].count("PLAN") == 1


def test_alpha_comes_along(pyramid, made_up_planes, tmp_path):
    glass = picture(planes("other"), planes("soft", components=1))
    changed = pyramid.layers["disc"].textured(saved(glass, tmp_path / "glass.pxi"), "disc")
    again = pxi.from_bytes(changed.to_bytes())
    assert (again.channels, again.opaque) == (4, True)
    assert len(again.layers["disc"].texture.sources) == 2
    alone = again.render(layers=["disc"], dtype=np.float32)
    expected = planes("soft", components=1).raster
    np.testing.assert_allclose(alone[20:28, 28:36, 3], expected[20:28, 28:36, 0], atol=1e-6)
    back = pyramid.layers["back"].textured(str(tmp_path / "glass.pxi"), "back")
    assert not back.opaque
    assert back.undone().to_bytes() == pyramid.to_bytes()


def test_node_sampled_layers_lend_and_borrow(pyramid, tmp_path):
    """A texture at nodes brings its way of sampling; a view takes it away."""
    from conformance.make.builders import Numbers
    from conformance.make.valid.samplings import CASES

    nodes = saved(pxi.Image(CASES["node"].build(Numbers("node"))), tmp_path / "node.pxi")
    changed = pyramid.layers["disc"].textured(nodes, "ring")
    assert changed.layers["disc"].sampling == 1
    assert pxi.from_bytes(changed.to_bytes()).render().shape == (48, 64, 3)
    back = changed.layers["disc"].textured("bar")
    assert back.layers["disc"].sampling == 0
    assert back.networks == ()
    np.testing.assert_array_equal(
        pxi.from_bytes(back.to_bytes()).render(), pyramid.layers["disc"].textured("bar").render()
    )
    with pytest.raises(UsageError, match="at its own nodes"):
        pyramid.layers["disc"].textured(nodes, "ring", "shape")


def test_cached_and_fresh_renders_agree(pyramid):
    pyramid.render()
    for edited in (pyramid.layers["disc"].rotated(40), pyramid.layers["disc"].textured("bar")):
        np.testing.assert_array_equal(edited.render(), pxi.from_bytes(edited.to_bytes()).render())


def test_an_edit_that_adds_planes_numbers_no_others_anew(pyramid, tmp_path):
    """Not even one of a layer behind all: its planes are appended, all other chunks stay."""
    first = saved(picture(planes("first")), tmp_path / "first.pxi")
    second = saved(picture(planes("second")), tmp_path / "second.pxi")
    start = pyramid.layers["disc"].textured(first, "disc").baked()
    edited = start.layers["bar"].textured(second, "bar")
    edited = edited.layers["back"].textured(saved(picture(planes("third")), tmp_path / "3"), "back")
    names = [p.packed["data"] for p in edited.planes]
    assert names == [b"first", b"second", b"third"], "that of the back is not used any more"
    only = start.layers["back"].textured(second, "back")
    assert [p.packed["data"] for p in only.planes] == [b"colour", b"first", b"second"]
    kinds = ("LAYR", "PLAN", "TEXR")
    before, after = ([c for c in read(v.to_bytes()) if c.type in kinds] for v in (start, only))
    new = [
        c.type for c in after if (c.type, c.payload) not in {(b.type, b.payload) for b in before}
    ]
    assert new == ["TEXR", "PLAN"]
    assert only.undone().to_bytes() == start.to_bytes()
    assert pxi.from_bytes(only.to_bytes()).to_bytes() == only.to_bytes()


def test_edits_keep_what_is_behind(pyramid):
    """Moved, cut loose, renamed and given to others: planes behind and references stay."""
    bar = pyramid.layers["bar"]
    own = planes("own", bar.texture.part[2:])
    references = Copies(2, np.array([[5, -1]], np.int32), np.ones((3, 15), np.uint8))
    mask = np.ones((11, 59), bool)
    mask[2:9, 9:30] = False
    shown = replace(bar.texture, behind=own, copies=references, mask=mask)
    layers = [changed(v, texture=shown) if v.name == "bar" else v for v in pyramid.layers]
    image = changed(pyramid, layers=Layers(layers))
    for edited in (
        image.layers["bar"].moved(4, -9),
        image.layers["disc"].removed(),
        image.layers["bar"].renamed("other"),
        image.layers["disc"].textured("bar"),
        image.layers["bar"].recoloured(brightness=0.1),
    ):
        again = pxi.from_bytes(edited.to_bytes())
        views = [v.texture for v in again.layers if v.texture.behind is not None]
        assert views
        for texture in views:
            assert texture.behind.packed["data"] == b"own"
            np.testing.assert_array_equal(texture.copies.offsets, references.offsets)
        np.testing.assert_array_equal(again.render(), edited.render())
        assert edited.undone().to_bytes() == image.to_bytes()


def test_a_view_that_is_freed_of_its_cuts_keeps_what_is_behind(made_up_planes):
    """Until all of it shows."""
    image = cut_picture()
    disc = image.layers["disc"]
    own = planes("own", disc.texture.part[2:])
    references = Copies(2, np.array([[5, -1]], np.int32), np.ones((8, 8), np.uint8))
    shown = replace(disc.texture, behind=own, copies=references)
    masked = shown.masked(shown.cuts.everything)
    assert masked.mask is not None
    assert (masked.behind, masked.copies) == (own, references)
    whole = replace(
        shown,
        cuts=Occlusion(None, (Boundary(4, (polygon((-9, -9), (-8, -9), (-8, -8)),)),), disc.box),
    )
    freed = whole.masked(ALL_IN_PLACE)
    assert freed.sources == (disc.texture.planes,)
    assert freed.copies is None
