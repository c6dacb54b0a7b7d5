"""Every operation, on a small picture with the layers back, bar and disc."""

import json

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.container.chunks import Chunk
from proxyimg_codec.edit.operations import OPERATIONS
from proxyimg_codec.edit.transforms import bounds
from proxyimg_codec.errors import UsageError
from proxyimg_codec.io import raster
from tests.support.edits import BAD, EDITS, covered, grown
from tests.support.images import changed


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


@pytest.mark.parametrize("name", EDITS)
def test_only_the_object_changes_and_undo_restores_the_file(image, name):
    before = image.render(engine="numpy")
    edited = EDITS[name](image.layers["disc"])
    after = edited.render(engine="numpy")
    near = grown(covered(image, "disc"))
    for layer in edited.layers:
        if layer.name not in ("back", "bar"):
            near |= grown(covered(edited, layer.name))
    assert not near.all()
    np.testing.assert_array_equal(after[~near], before[~near])
    if name not in ("duplicate", "order", "rename"):
        assert (after != before).any()
    assert edited.undone().to_bytes() == image.to_bytes()
    assert [json.loads(s.operation)["op"] for s in edited.history] == [name.split()[0]]
    again = pxi.from_bytes(edited.to_bytes())
    np.testing.assert_array_equal(again.render(engine="numpy"), after)
    assert again.undone().to_bytes() == image.to_bytes()


def test_what_was_not_touched_is_the_same_bytes(image):
    edited = image.layers["disc"].dragged({(32, 14): (6, -2), (32, 34): (0, 0)})
    old = {(c.type, c.payload) for c in image.chunks}
    new = {(c.type, c.payload) for c in edited.chunks}
    assert {t for t, _ in new - old} == {"POSE"}
    assert not old - new


@pytest.mark.parametrize("by", [(5, -3), (0.3, 0.1), (-7.77, 100), (1 / 3, 2**-11)])
def test_there_and_back_is_exact(image, by):
    there = image.layers["disc"].moved(*by)
    back = there.layers["disc"].moved(-by[0], -by[1])
    assert back.baked().to_bytes() == image.to_bytes()
    assert back.to_bytes() != image.to_bytes()  # the history


def test_two_flips_and_four_quarter_turns_are_exact(image):
    twice = image.edited(*[{"op": "flip", "layer": "disc", "axis": "vertical"}] * 2)
    assert twice.baked().to_bytes() == image.to_bytes()
    turned = image.edited(*[{"op": "rotate", "layer": "disc", "degrees": 90}] * 4)
    assert turned.baked().to_bytes() == image.to_bytes()


def test_operations_that_do_nothing_leave_the_file(image):
    disc = image.layers["disc"]
    for same in (
        disc.moved(0, 0), disc.rotated(0), disc.scaled(1), disc.with_opacity(1), disc.shown(),
        disc.recoloured(), disc.recoloured(hue=360),
    ):  # fmt: skip
        assert same.baked().to_bytes() == image.to_bytes()
    pinned = disc.dragged({(32, 14): (0, 0)})
    np.testing.assert_array_equal(pinned.render(), image.render())


def test_a_tiny_move_changes_tiny_things(image):
    before = image.render(dtype="float32", engine="numpy")
    after = image.layers["disc"].moved(0.01, 0.01).render(dtype="float32", engine="numpy")
    assert 0 < np.abs(after - before).mean() < 1 / 255
    bent = image.layers["disc"].dragged({(32, 14): (0.07, 0), (32, 34): (0, 0)})
    assert np.abs(bent.render(dtype="float32", engine="numpy") - before).mean() < 1 / 255


def test_a_whole_move_moves_the_pixels(image):
    alone = image.render(layers=["disc"], engine="numpy")
    moved = image.layers["disc"].moved(7, -4).render(layers=["disc"], engine="numpy")
    np.testing.assert_array_equal(moved[:-4, 7:], alone[4:, :-7])


def test_cached_and_fresh_renders_agree(image):
    image.render()
    edited = image.layers["disc"].rotated(40)
    warm = edited.render()
    fresh = pxi.from_bytes(edited.to_bytes()).render()
    np.testing.assert_array_equal(warm, fresh)


def test_dragged_points_arrive(image):
    # A mark on the texture arrives where it was dragged to: compare round the two places.
    moved = image.layers["disc"].dragged({(32, 24): (8, -6)})
    alone = image.render(layers=["disc"], engine="numpy").astype(int)
    there = moved.render(layers=["disc"], engine="numpy").astype(int)
    assert np.abs(there[14:22, 36:44] - alone[20:28, 28:36]).max() <= 3


def test_a_texture_leaves_the_shape(image):
    for fit in ("box", "shape"):
        changed = image.layers["disc"].textured("bar", fit=fit)
        np.testing.assert_array_equal(covered(changed, "disc"), covered(image, "disc"))
        assert changed.layers["disc"].boundary is image.layers["disc"].boundary


def test_shared_textures_are_stored_once(image):
    copy = image.layers["disc"].duplicated("twin").baked()
    assert len(copy.to_bytes()) - len(image.to_bytes()) < 700
    assert [len(c.payload) for c in copy.chunks if c.type == "TEXR"][-1] < 20


def test_textures_of_files(image, small_pxi, tmp_path):
    path = tmp_path / "other.pxi"
    other = image.layers["bar"].renamed("plank")
    other.save(path)
    changed = image.layers["disc"].textured(str(path), "plank").baked()
    assert len(changed.networks) == 1  # the same as that of the picture
    np.testing.assert_array_equal(
        changed.render(layers=["disc"]),
        image.layers["disc"].textured("bar").render(layers=["disc"]),
    )


def test_textures_of_pictures(image, tmp_path):
    pytest.importorskip("OpenImageIO")
    path = tmp_path / "blue.png"
    raster.write(path, np.full((20, 20, 3), (10, 20, 200), np.uint8))
    changed = image.layers["disc"].textured(str(path))
    assert np.abs(changed.render()[24, 32].astype(int) - (10, 20, 200)).max() <= 2


def test_opacity_mixes_with_what_is_behind(image):
    full, none = (
        image.render(dtype="float32"),
        image.layers["disc"].removed().render(dtype="float32"),
    )
    half = image.layers["disc"].with_opacity(0.5).render(dtype="float32")
    np.testing.assert_allclose(half, (full + none) / 2, atol=1e-4)


def test_grey_is_grey_and_tints_are_shades(image):
    grey = image.layers["disc"].recoloured(saturation=0).render(layers=["disc"])
    seen = grey[..., 3] == 255
    assert np.ptp(grey[seen][:, :3].astype(int), axis=1).max() <= 1
    red = image.layers["disc"].recoloured(tint="#ff0000").render(layers=["disc"])
    assert red[seen][:, 1:3].max() == 0
    there = image.layers["disc"].recoloured(hue=120)
    back = there.layers["disc"].recoloured(hue=-120).render(layers=["disc"])
    plain = image.render(layers=["disc"])
    assert np.abs(back[seen].astype(int) - plain[seen]).max() <= 3


def test_hidden_layers_are_drawn_only_by_name(image):
    hidden = image.layers["disc"].hidden()
    np.testing.assert_array_equal(hidden.render(), image.layers["disc"].removed().render())
    np.testing.assert_array_equal(hidden.render(layers=["disc"]), image.render(layers=["disc"]))


def test_the_back_layer_can_go_and_come_back(image):
    gone = image.layers["back"].removed()
    assert not gone.opaque
    assert gone.render().shape == (48, 64, 4)
    for opened in (image.layers["back"].moved(9, 0), image.layers["back"].with_opacity(0.5)):
        assert not opened.opaque
        assert pxi.from_bytes(opened.to_bytes()).render().shape == (48, 64, 4)
    home = image.layers["back"].moved(9, 0).layers["back"].moved(-9, 0)
    assert home.baked().to_bytes() == image.to_bytes()
    bent = image.layers["back"].dragged({(5, 5): (9, 9), (60, 40): (0, 0)})
    assert bent.render()[0, 0, 3] < 255


def test_order(image):
    def names(v):
        return [layer.name for layer in v.layers]

    bar = image.layers["bar"]
    assert names(bar.reordered("front")) == ["back", "disc", "bar"]
    assert names(bar.reordered("forward")) == ["back", "disc", "bar"]
    assert names(bar.reordered("back")) == ["back", "bar", "disc"]
    assert names(bar.reordered(0)) == ["bar", "back", "disc"]
    assert names(image.layers["disc"].reordered("backward")) == ["back", "disc", "bar"]


def test_groups_move_together_and_parents_lead(image):
    grouped = image.edited({"op": "group", "layers": ["bar", "disc"], "name": "both"})
    moved = grouped.edited({"op": "move", "layer": "both", "by": [3, 4]})
    assert [v.pose.shift for v in moved.layers] == [(0, 0), (3072, 4096), (3072, 4096)]
    again = pxi.from_bytes(moved.to_bytes())
    assert dict(again.groups) == {"both": None}
    assert [v.parent for v in again.layers] == [None, "both", "both"]
    np.testing.assert_array_equal(again.render(), moved.render())
    led = image.layers["disc"].with_parent("bar").layers["bar"].moved(1, 0)
    assert [v.pose.shift[0] for v in led.layers] == [0, 1024, 1024]
    alone = led.layers["disc"].moved(1, 0)
    assert [v.pose.shift[0] for v in alone.layers] == [0, 1024, 2048]
    flat = moved.edited({"op": "ungroup", "name": "both"})
    assert not flat.groups
    assert {v.parent for v in flat.layers} == {None}
    assert [v.name for v in moved.edited({"op": "remove", "layer": "both"}).layers] == ["back"]
    renamed = moved.edited({"op": "rename", "layer": "both", "name": "pair"})
    assert [v.parent for v in renamed.layers] == [None, "pair", "pair"]


def test_a_group_turns_about_its_own_centre(image):
    grouped = image.edited({"op": "group", "layers": ["bar", "disc"], "name": "both"})
    turned = grouped.edited({"op": "rotate", "layer": "both", "degrees": 180})
    masks = [covered(v, "bar") | covered(v, "disc") for v in (image, turned)]
    ys, xs = zip(*[np.nonzero(m) for m in masks], strict=True)
    for values in (ys, xs):
        assert values[0].min() == pytest.approx(values[1].min(), abs=1)


def test_children_of_what_is_removed_move_up(image):
    led = image.edited(
        {"op": "group", "layers": ["bar"], "name": "g"},
        {"op": "parent", "layer": "disc", "to": "bar"},
        {"op": "remove", "layer": "bar"},
    )
    assert led.layers["disc"].parent == "g"


def test_a_mesh_is_derived_where_the_file_has_none(image):
    bare = changed(image, layers=type(image.layers)(changed(v, mesh=None) for v in image.layers))
    moved = bare.layers["disc"].moved(3, 3)
    assert moved.layers["disc"].mesh is None  # not needed
    bent = bare.layers["disc"].dragged({(32, 14): (6, -2), (32, 34): (0, 0)})
    again = pxi.from_bytes(bent.to_bytes())
    assert len(again.layers["disc"].mesh.refined.nodes) > 20
    twice = bare.layers["disc"].dragged({(32, 14): (6, -2), (32, 34): (0, 0)})
    assert twice.to_bytes() == bent.to_bytes()


def test_unknown_chunks_go_unless_they_are_safe_to_copy(image):
    extra = (Chunk("abCd", b"1"), Chunk("abCD", b"2"))
    edited = changed(image, extra=extra).layers["disc"].moved(1, 1)
    assert [c.type for c in edited.extra] == ["abCd"]
    assert [c.type for c in edited.undone().extra] == ["abCd", "abCD"]


def test_areas_follow_their_layers(image):
    areas = dict(zip((v.name for v in image.layers), image.info["areas"], strict=True))
    edited = image.layers["disc"].duplicated("twin").layers["twin"].reordered("back")
    want = [areas["back"], areas["disc"], areas["bar"], areas["disc"]]
    assert edited.info["areas"] == want


@pytest.mark.parametrize(("values", "said"), BAD)
def test_what_cannot_be_done_says_why(image, values, said):
    before = image.to_bytes()
    with pytest.raises(UsageError, match=f"edit 1: .*{said}"):
        image.edited(values)
    assert image.to_bytes() == before


def test_groups_cannot_hold_themselves(image):
    nested = image.edited(
        {"op": "group", "layers": ["disc"], "name": "inner"},
        {"op": "group", "layers": ["inner"], "name": "outer"},
    )
    for values in (
        {"op": "group", "layers": ["outer"], "name": "inner"},
        {"op": "group", "layers": ["outer"], "name": "outer"},
        {"op": "parent", "layer": "outer", "to": "disc"},
        {"op": "parent", "layer": "outer", "to": "inner"},
    ):
        with pytest.raises(UsageError, match="part of itself"):
            nested.edited(values)
    with pytest.raises(UsageError, match="is a group"):
        nested.edited({"op": "drag", "layer": "outer", "handles": [[1, 1, 1, 1]]})


def test_the_last_layer_stays(image):
    with pytest.raises(UsageError, match="last layer"):
        image.edited(*({"op": "remove", "layer": n} for n in ("disc", "bar", "back")))


def test_undo_needs_a_history(image):
    with pytest.raises(UsageError, match="has 0"):
        image.undone()
    edited = image.layers["disc"].moved(1, 1)
    for steps in (0, 2, -1):
        with pytest.raises(UsageError, match="has 1"):
            edited.undone(steps)


def test_extreme_but_legal_edits_render(image):
    huge = image.layers["disc"].scaled(100)
    assert (huge.render()[..., 0] > 150).mean() > 0.9  # the red disc is everywhere
    away = image.layers["disc"].moved(1e5, -1e5)
    np.testing.assert_array_equal(away.render(), image.layers["disc"].removed().render())
    tiny = image.layers["disc"].scaled(1e-4)
    assert np.abs(tiny.render().astype(int) - away.render()).max() <= 1
    folded = image.layers["disc"].dragged({(32, 12): (0, 30), (32, 36): (0, -30)})
    assert np.isfinite(folded.render(dtype="float32")).all()


def test_every_operation_is_tried_here():
    tried = {name.split()[0] for name in EDITS} | {
        v["op"] for v, _ in BAD if isinstance(v, dict) and "op" in v
    }
    assert set(OPERATIONS) - {"show", "outlines", "still"} <= tried


def test_a_drag_of_points_outside_takes_the_nearest_along_and_says_so(small_pxi, caplog):
    layer = pxi.open(small_pxi).layers["disc"]
    x0, y0, x1, y1 = bounds(layer.image.picture, [layer.data])
    layer.dragged({((x0 + x1) / 2, y0 + 0.4): (2, 1), ((x0 + x1) / 2, y1 - 0.4): (0, 0)})
    assert not caplog.records
    far = (x1 + 9, (y0 + y1) / 2)
    moved = layer.dragged({far: (4, 0), (x0 + 1, (y0 + y1) / 2): (0, 0), (0, 0): (1, 1)})
    (record,) = caplog.records
    said = record.getMessage()
    assert f"{far[0]:g},{far[1]:g} and 1 more outside of 'disc', by " in said
    right = bounds(moved.picture, [moved.layers["disc"].data])[2]
    assert right == pytest.approx(x1 + 4, abs=1)


def test_a_drag_of_one_point_moves_the_whole_layer(small_pxi, caplog):
    image = pxi.open(small_pxi)
    dragged = image.layers["disc"].dragged({(32, 20): (3, -2)})
    before, after = (bounds(v.picture, [v.layers["disc"].data]) for v in (image, dragged))
    np.testing.assert_allclose(np.subtract(after, before), [3, -2, 3, -2], atol=0.1)
    assert not caplog.records
