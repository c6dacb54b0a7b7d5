"""Edits of a picture whose views are cut by boundaries: what is seen is what is saved."""

import io
import zipfile

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import ellipse
from proxyimg_codec.container.file import parse
from proxyimg_codec.export import openraster
from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.io import raster
from proxyimg_codec.model import Layers
from proxyimg_codec.render.compose import outline
from proxyimg_codec.render.view import make_view
from proxyimg_codec.texture.occlusion import ALL_IN_PLACE, ALL_REMOVED, Moved, Occlusion
from tests.support.edits import EDITS, covered, grown, near
from tests.support.images import changed
from tests.support.pyramids import SIZE, cut_picture, filled, implicit, planes, showing, view


@pytest.fixture
def cut(made_up_planes):
    """A picture of 64x48 pixels with the layers back, bar and disc, all cut."""
    return cut_picture()


def kinds(image):
    """Cuts of each layer's TEXR, ``mask`` or the number of the layer whose texture it shares."""
    return [
        t["texture"] if t["coder"] == 0 else "mask" if t.get("mask") else t.get("cuts")
        for t in parse(image.to_bytes()).textures
    ]


def alone(layer):
    """The view of a layer, masked as if it were the only one."""
    return layer.texture.masked(layer.texture.cuts.everything)


def same_when_loaded(image):
    """Asserts that a picture, and each layer by itself, looks the same after saving."""
    data = image.to_bytes()
    again = pxi.from_bytes(data)
    assert again.to_bytes() == data
    np.testing.assert_array_equal(again.render(), image.render())
    for layer in image.layers:
        # Enlarged, so that samples beside those that the layer shows matter too.
        alone = [v.render(layers=[layer.name], scale=2) for v in (image, again)]
        np.testing.assert_array_equal(*alone)
    return again


def test_files_come_back_to_the_byte(cut):
    assert kinds(cut) == [[1, 2], [1, 2], [2]]
    again = same_when_loaded(cut)
    back, bar, disc = again.layers
    assert back.texture.cuts.fronts == (bar.boundary, disc.boundary)
    assert (bar.texture.cuts.own, back.texture.cuts.own) == (bar.boundary, None)
    assert disc.texture.cuts.box == disc.box


def test_the_hole_is_not_what_was_there(cut):
    hole = cut.render(layers=["back", "bar"])
    flat = changed(cut.layers["back"], texture=view(planes("colour")))
    shown = changed(cut, layers=Layers([flat]), info=None).render()
    inside = np.hypot(*(np.mgrid[0:48, 0:64] - np.array([24, 32])[:, None, None])) < 12
    assert np.abs(hole.astype(int) - shown)[inside].mean() > 10
    np.testing.assert_array_equal(hole[:7], shown[:7])


KEPT = {
    "move": [[1, 2], [1, 2], [2]],
    "rotate": [[1, 2], [1, 2], [2]],
    "drag": [[1, 2], [1, 2], [2]],
    "hide": [[1, 2], [1, 2], [2]],
    "recolour": [[1, 2], [1, 2], [2]],
    "rename": [[1, 2], [1, 2], [2]],
    "duplicate": [[1, 2], [1, 2], [2], 2],
    "order": [[1, 2], [1], "mask"],
    "remove": ["mask", "mask"],
    "point": ["mask", "mask", "mask"],
    "texture": [[1, 2], [1, 2], "mask"],
}
"""What is left of the cuts after an edit of the disc."""


@pytest.mark.parametrize("name", EDITS)
@pytest.mark.parametrize("layer", ["disc", "bar"])
def test_edits_look_the_same_when_loaded(cut, name, layer):
    edited = EDITS[name](cut.layers[layer])
    same_when_loaded(edited)
    if layer == "disc" and name in KEPT:
        assert kinds(edited) == KEPT[name]
    for image in (edited, pxi.from_bytes(edited.to_bytes())):
        assert image.undone().to_bytes() == cut.to_bytes()


@pytest.mark.parametrize("name", ["move", "scale", "drag", "remove", "order", "duplicate"])
def test_the_same_with_alpha(made_up_planes, name):
    image = cut_picture(planes("colour"), planes("soft", components=1))
    edited = EDITS[name](image.layers["disc"])
    assert same_when_loaded(edited).channels == 4
    assert edited.undone().to_bytes() == image.to_bytes()


def test_there_and_back_is_exact(cut):
    there = cut.layers["disc"].moved(9, -2.5)
    assert there.baked().to_bytes() != cut.to_bytes()
    assert there.layers["disc"].moved(-9, 2.5).baked().to_bytes() == cut.to_bytes()
    old, new = ({(c.type, c.payload) for c in v.chunks} for v in (cut, there))
    assert {t for t, _ in new - old} == {"POSE"}


def test_a_removed_object_leaves_nothing(cut):
    """What lies within 2 samples of it is filled, in whole cells; the rest is not touched."""
    gone = cut.layers["disc"].removed()
    spoilt = near(covered(cut, "disc"))
    for layer in gone.layers:
        x, y, w, h = layer.box
        assert not (layer.texture.shown & spoilt[y : y + h, x : x + w]).any()
    cells = spoilt.reshape(24, 2, 32, 2).any((1, 3)).repeat(2, 0).repeat(2, 1)
    changed = (gone.render() != cut.render()).any(-1)
    assert changed[spoilt].mean() > 0.9
    assert not changed[~cells].any()


def test_masks_trust_nobody_where_a_boundary_was(cut):
    """Where it is the layer's own, or in front of it, as before, mixed samples stay."""
    disc = cut.layers["disc"]
    gone, own = Moved(frozenset([disc.boundary])), Moved(behind=ALL_REMOVED)
    left = {
        "remove": {"back": gone, "bar": gone},
        "point": {"back": gone, "bar": gone, "disc": own},
        "order": {"bar": gone},
    }
    for name, layers in left.items():
        edited = EDITS[name](disc)
        for layer, apart in layers.items():
            expected = cut.layers[layer].texture.masked(apart).mask
            np.testing.assert_array_equal(edited.layers[layer].texture.mask, expected)
            trusted = alone(cut.layers[layer]).mask
            assert (edited.layers[layer].texture.mask != trusted).any() == (apart != own)


def test_masks_are_of_what_is_gone_and_cuts_of_what_is_left(cut):
    """Which is removed or moved first makes no difference: there is never a rim."""
    bar, disc = cut.layers["bar"].boundary, cut.layers["disc"].boundary
    moved = cut.layers["disc"].moved(0, -7).layers["bar"].removed()
    back = moved.layers["back"].texture
    expected = cut.layers["back"].texture.masked(Moved(frozenset([bar]))).mask
    np.testing.assert_array_equal(back.mask, expected)
    assert back.cuts.fronts == (disc,)
    same_when_loaded(moved)
    removed = cut.layers["bar"].removed().layers["disc"].moved(0, -7)
    np.testing.assert_array_equal(removed.render(), moved.render())
    shown = removed.layers["back"].texture.kept(removed.layers["back"].moved_neighbours)
    assert not (shown & near(covered(cut, "disc"))).any()
    hidden = cut.layers["bar"].hidden().layers["disc"].with_point(0, 0, 3, 1)
    expected = cut.layers["disc"].texture.masked(Moved(behind=ALL_REMOVED)).mask
    np.testing.assert_array_equal(hidden.layers["disc"].texture.mask, expected)


def test_a_white_object_on_black_leaves_and_takes_no_grey(made_up_planes):
    """The samples at its rim are mixed; they show only where both lie as they did."""
    shape = Boundary(4, (ellipse((31, 23), (13, 11)),))
    image = stack([(0, 0, *SIZE), (16, 10, 30, 26)], [None, shape], [[1], [1]])
    share = share_of(image, "1")
    showing(image.layers[0].texture.planes, share[..., None].repeat(3, 2))
    disc = image.layers["1"]

    def grey(picture):
        return picture.render(dtype=np.float32)[..., 0]

    np.testing.assert_allclose(grey(image), share, atol=1e-6)
    moved = disc.moved(-9, 4)
    np.testing.assert_allclose(grey(moved), np.roll(share, (4, -9), (0, 1)), atol=1e-4)
    np.testing.assert_allclose(grey(moved.layers["1"].moved(9, -4)), share, atol=1e-6)
    np.testing.assert_allclose(grey(disc.with_opacity(0.4)), 0.4 * share, atol=1e-4)
    for turned in (disc.rotated(45), disc.dragged({(31, 14): (5, -6), (31, 34): (0, 0)})):
        np.testing.assert_allclose(grey(turned), share_of(turned, "1"), atol=1e-4)
    for gone in (disc.hidden(), disc.removed()):
        assert grey(gone).max() == 0


def test_a_white_object_on_black_is_white_where_it_stands_alone(made_up_planes):
    """Without the other, over another back, and in another colour; the back stays black."""
    shape = Boundary(4, (ellipse((31, 23), (13, 11)),))
    image = stack([(0, 0, *SIZE), (16, 10, 30, 26)], [None, shape], [[1], [1]])
    share = share_of(image, "1")
    showing(image.layers[0].texture.planes, share[..., None].repeat(3, 2))
    for alone in (image.render(layers=["1"]), image.render(background=False)):
        np.testing.assert_allclose(alone[..., 3], 255 * share, atol=0.51)
        assert alone[alone[..., 3] > 0, :3].min() == 255
    assert image.render(layers=["0"]).max() == 0
    np.testing.assert_array_equal(image.render(layers=["1", "0"]), image.render())
    red = image.layers["1"].recoloured(tint="#ff0000").render(dtype=np.float32)
    np.testing.assert_allclose(red, share[..., None] * red.max((0, 1)), atol=1e-4)
    assert image.layers["1"].textured("0").render().max() == 0
    white = image.layers["0"].textured("1").render(dtype=np.float32)
    np.testing.assert_allclose(white, 1, atol=1e-4)


def share_of(image, name):
    """How much of each pixel a layer covers, 0..1."""
    view = make_view((image.width, image.height))
    paths = outline(image.layers[name].outline, view)
    return cover.coverage(paths, 0, 0, *SIZE).astype(np.float32) / cover.FULL


def test_what_is_beside_a_moved_layer_stays(cut):
    """The rims of others are mixed with what is still there, but where it was."""
    for name, by in (("bar", (4, 9)), ("disc", (5, -3))):
        moved = cut.layers[name].moved(*by)
        changed = (moved.render() != cut.render()).any(-1)
        near = grown(covered(cut, name)) | covered(moved, name)
        assert not changed[~near].any()
    bar = cut.layers["bar"].moved(40, 9)
    discs = cut.layers["disc"], bar.layers["disc"]
    shown = [v.texture.kept(v.moved_neighbours) for v in discs]
    lost = shown[0] & ~shown[1]
    assert lost.sum() > 20
    x, y, w, h = discs[0].box
    assert not (lost & ~grown(covered(cut, "bar"))[y : y + h, x : x + w]).any()


def test_what_moves_together_keeps_what_is_between(cut):
    moved = cut.edited(
        {"op": "group", "layers": ["bar", "disc"], "name": "both"},
        {"op": "move", "layer": "both", "by": [-2, 1]},
    )
    rest, now = cut.render()[:-1, 2:], moved.render()[1:, :-2]
    union = covered(cut, "bar") | covered(cut, "disc")
    inside = ~grown(~union, 3)[:-1, 2:]
    meeting = inside & (grown(covered(cut, "disc"), 1) & ~covered(cut, "disc"))[:-1, 2:]
    assert meeting.sum() > 20
    np.testing.assert_array_equal(now[inside], rest[inside])
    assert (now != rest)[union[:-1, 2:]].any()


def test_orders_that_leave_all_fronts_in_front(cut):
    """The numbers in the file follow; a copy may stand for the original."""
    both = cut.layers["disc"].duplicated("twin")
    assert kinds(both) == [[1, 2], [1, 2], [2], 2]
    assert kinds(both.layers["disc"].removed()) == [[1, 2], [1, 2], [2]]
    loaded = pxi.from_bytes(both.to_bytes())
    assert kinds(loaded.layers["disc"].removed()) == [[1, 2], [1, 2], [2]]
    swapped = both.layers["twin"].reordered(1)
    assert kinds(swapped) == [[1, 2], [1], [2, 3], 1]
    for image in (both, swapped, both.layers["disc"].removed()):
        same_when_loaded(image)
    bare = cut.layers["back"].removed()
    assert kinds(bare) == [[0, 1], [1]]
    same_when_loaded(bare)


def test_textures_are_lent_without_rims(cut):
    """The lender keeps its own."""
    lent = cut.layers["bar"].textured("disc")
    assert kinds(lent) == [[1, 2], "mask", [2]]
    np.testing.assert_array_equal(lent.layers["bar"].texture.mask, alone(cut.layers["disc"]).mask)
    same_when_loaded(lent)
    back = cut.layers["disc"].textured("back")
    assert kinds(back) == [[1, 2], [1, 2], "mask"]
    same_when_loaded(back)
    assert cut.layers["disc"].textured("disc").layers["disc"].texture.cuts is not None


def test_copies_that_lie_elsewhere(made_up_planes):
    whole, shape = (0, 0, *SIZE), rectangle(5, 5, 50, 40)
    image = stack([(8, 6, 30, 25), whole, whole], [shape, None, shape], [[], [2], []])
    lent = image.layers["0"].textured("1")
    assert kinds(lent) == ["mask", [2], []]
    same_when_loaded(lent)
    bare = image.layers["2"].textured("1").layers["1"].removed()
    assert kinds(bare) == [[], "mask"]  # it is not in front of itself
    trusted = alone(image.layers["1"]).mask
    np.testing.assert_array_equal(bare.layers["2"].texture.mask, trusted)
    assert (trusted != image.layers["1"].texture.masked(ALL_IN_PLACE).mask).any()


def test_groups_scripts_and_undo(cut):
    script = [
        {"op": "group", "layers": ["bar", "disc"], "name": "both"},
        {"op": "move", "layer": "both", "by": [3, 4]},
        {"op": "duplicate", "layer": "bar"},
        {"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [3, -2]},
        {"op": "order", "layer": "disc", "to": "back"},
        {"op": "remove", "layer": "both"},
    ]
    edited = cut.edited(*script)
    for steps in range(1, len(script)):
        before = cut.edited(*script[:-steps])
        same_when_loaded(before)
        assert edited.undone(steps).to_bytes() == before.to_bytes()
    assert edited.undone(len(script)).to_bytes() == cut.to_bytes()


@pytest.mark.parametrize("fit", ["box", "shape"])
@pytest.mark.parametrize("name", ["back", "bar", "disc"])
def test_textures_for_other_files(cut, made_up_planes, tmp_path, fit, name):
    cut.save(tmp_path / "cut.pxi")
    for image in (implicit(), cut_picture(planes("other"))):
        changed = image.layers["disc"].textured(str(tmp_path / "cut.pxi"), name, fit)
        same_when_loaded(changed)
        taken = changed.layers["disc"].texture
        assert kinds(changed)[2] == "mask"
        np.testing.assert_array_equal(taken.mask, alone(cut.layers[name]).mask)


def test_openraster_has_what_is_hidden(cut):
    pytest.importorskip("OpenImageIO")
    with zipfile.ZipFile(io.BytesIO(openraster.build(cut))) as archive:
        back = raster.parse(archive.read("data/layer0.png"), "back").pixels
    np.testing.assert_array_equal(back, cut.render(layers=["back"]))


def rectangle(x0, y0, x1, y1):
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    after = np.roll(corners, -1, 0)
    return Boundary(0, (np.stack([corners, corners, after], 1).reshape(-1, 2),))


def stack(boxes, boundaries, numbers, placed=True):
    """A picture of layers 0, 1, ..., whose views are cut by layers `numbers`.

    Each shows what the raster has in its place, or if not `placed` its top left corner.
    """
    colour = planes("colour")
    layers = [
        changed(
            cut_picture(colour).layers[0],
            name=str(k),
            box=box,
            boundary=boundary,
            texture=view(
                colour,
                part=box if placed else (0, 0, *box[2:]),
                cuts=Occlusion.of(by, k, boundaries, box),
            ),
        )
        for k, (box, boundary, by) in enumerate(zip(boxes, boundaries, numbers, strict=True))
    ]
    return changed(cut_picture(colour), layers=Layers(layers), info=None)


@pytest.mark.parametrize("region", [None, (20, 11, 23, 17)])
def test_a_picture_at_rest_needs_no_fill(made_up_planes, region):
    """It looks like its planes wherever outlines run, alone or where they meet."""
    ellipses = (ellipse((20, 21), (13, 11)), ellipse((37, 26), (12, 17)))
    shapes = [None, *(Boundary(4, (v,)) for v in ellipses), rectangle(10, 8, 36, 29)]
    boxes = [(0, 0, *SIZE), (5, 8, 30, 26), (23, 7, 28, 38), (8, 6, 30, 25)]
    image = stack(boxes, shapes, [[1, 2, 3], [1, 2, 3], [2, 3], [3]])
    shown = image.render(dtype=np.float32, region=region)
    x, y, w, h = region or (0, 0, *SIZE)
    raster = planes("colour").raster[y : y + h, x : x + w]
    np.testing.assert_allclose(shown, raster, atol=1e-6)
    assert all(not v.texture.shown.all() for v in image.layers)
    assert not any(filled(v.texture) for v in image.layers)
    image.layers["1"].moved(3, 0).render()
    assert filled(image.layers["0"].texture)


def test_equal_numbers_may_mean_different_samples(made_up_planes):
    """Such views are not stored as one."""
    whole, shape = (0, 0, *SIZE), rectangle(5, 5, 50, 40)
    front = stack([whole, whole], [None, shape], [[1], [1]])
    assert kinds(front) == [[1], [1]]
    same_when_loaded(front)
    boxes = [whole, (0, 0, 30, 20), (9, 4, 30, 20), (9, 4, 30, 20)]
    apart = stack(
        boxes, [None, shape, shape, rectangle(20, 10, 60, 30)], [[], [3], [3], [3]], False
    )
    assert kinds(apart) == [[], [3], [3], [3]]
    same_when_loaded(apart)
    alike = stack([whole, whole, whole], [None, None, shape], [[2], [2], []])
    assert kinds(alike) == [[2], 0, []]
    same_when_loaded(alike)
