"""Every edit of a picture that moves."""

import json
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.make.builders import Numbers, texture
from conformance.make.valid.motion import moving as with_tracks
from conformance.make.valid.motion import track as random_track
from proxyimg_codec.animate.motion import Motion
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.mesher import derived
from proxyimg_codec.model import Layers
from tests.support import moving
from tests.support.edits import EDITS
from tests.support.images import changed

T = 0.4


@pytest.fixture(scope="module")
def image():
    """Layers back, bar and disc; the last two move."""
    return moving.picture()


def moves(image):
    """The layers that move, by name."""
    return {v.name: v.track for v in image.layers if v.track is not None}


ALL = {
    **EDITS,
    "group": lambda v: v.image.edited({"op": "group", "layers": ["disc", "bar"], "name": "all"}),
    "parent": lambda v: v.with_parent("bar"),
    "show": lambda v: v.shown(),
    "still": lambda v: v.stilled(),
}

AFTER = {
    "remove": {"bar": "bar"},
    "still": {"bar": "bar"},
    "duplicate": {"bar": "bar", "disc": "disc", "disc copy": "disc"},
    "rename": {"bar": "bar", "sun": "disc"},
}
"""Where other layers move than before: whose track each has."""


@pytest.mark.parametrize("name", ALL)
def test_an_edit_keeps_the_motion(image, name):
    edited = ALL[name](image.layers["disc"])
    wanted = AFTER.get(name, {"bar": "bar", "disc": "disc"})
    before = moves(image)
    assert {k: v is before[wanted[k]] for k, v in moves(edited).items()} == dict.fromkeys(
        wanted, True
    )
    assert edited.timeline is image.timeline
    again = pxi.from_bytes(edited.to_bytes())
    np.testing.assert_array_equal(again.render(t=T), edited.render(t=T))
    assert again.undone().to_bytes() == image.to_bytes()
    np.testing.assert_array_equal(again.undone().render(t=T), image.render(t=T))
    assert again.baked().timeline == image.timeline
    assert not again.baked().history


def test_without_a_layer_that_moves_there_is_no_timeline(image):
    for op in ("remove", "still"):
        one = image.edited({"op": op, "layer": "bar"})
        none = one.edited({"op": op, "layer": "disc"})
        assert one.timeline is not None
        assert none.timeline is None
        assert "mOTN" not in [c.type for c in none.chunks]
        with pytest.raises(UsageError, match="does not move"):
            none.render(t=T)
        back = pxi.from_bytes(none.to_bytes()).undone(2)
        assert back.to_bytes() == image.to_bytes()
        assert back.timeline == image.timeline


def test_a_still_layer_stays_where_it_was(image):
    still = image.layers["bar"].stilled().layers["disc"].stilled()
    np.testing.assert_array_equal(still.render(), image.render())
    once = image.layers["bar"].stilled()
    np.testing.assert_array_equal(once.render(t=T, layers=["bar"]), image.render(layers=["bar"]))
    np.testing.assert_array_equal(
        once.render(t=T, layers=["disc"]), image.render(t=T, layers=["disc"])
    )
    grouped = image.edited({"op": "group", "layers": ["bar", "disc"], "name": "all"})
    assert grouped.edited({"op": "still", "layer": "all"}).timeline is None
    assert still.layers["back"].stilled().baked().to_bytes() == still.baked().to_bytes()


def test_what_was_moved_moves_there(image):
    alone = image.render(t=T, layers=["disc"], engine="numpy")
    moved = image.layers["disc"].moved(7, -4)
    there = moved.render(t=T, layers=["disc"], engine="numpy")
    np.testing.assert_array_equal(there[:-4, 7:], alone[4:, :-7])


def test_a_copy_moves_too(image):
    copied = image.layers["disc"].duplicated("twin").layers["twin"].moved(5, 3)
    disc = copied.render(t=T, layers=["disc"], engine="numpy")
    twin = copied.render(t=T, layers=["twin"], engine="numpy")
    np.testing.assert_array_equal(twin[3:, 5:], disc[:-3, :-5])
    np.testing.assert_array_equal(disc, image.render(t=T, layers=["disc"], engine="numpy"))


def test_a_bent_layer_moves_from_where_it_was_bent(image):
    bent = image.layers["disc"].dragged({(32, 14): (6, -2), (32, 34): (0, 0)})
    at = bent.at(T).layers["disc"].pose
    sway = image.at(T).layers["disc"].pose.sway
    np.testing.assert_array_equal(at.sway, sway)
    np.testing.assert_array_equal(at.displacements, (bent.layers["disc"].pose.nodes << 6) + sway)
    assert (bent.render(t=T) != image.render(t=T)).any()


def test_a_changed_outline_moves(image):
    edited = image.layers["disc"].with_point(0, 0, 3, -2)
    start, rest = (v.layers["disc"].boundary.paths[0][0] * 64 for v in (edited, image))
    one, other = (v.at(T).layers["disc"].outline.paths[0][0] for v in (edited, image))
    assert (start - rest).tolist() == [3 << 10, -2 << 10]
    assert (one != start).any()
    # Points that lie near each other move alike.
    assert np.abs((one - start) - (other - rest)).max() < 1 << 10


def test_the_order_of_layers_is_that_of_their_tracks(image):
    swapped = image.layers["disc"].reordered(1)
    again = pxi.from_bytes(swapped.to_bytes())
    assert [v.name for v in again.layers] == ["back", "disc", "bar"]
    for name in ("bar", "disc"):
        got, want = again.layers[name].track, image.layers[name].track
        np.testing.assert_array_equal(got.shapes, want.shapes)
        np.testing.assert_array_equal(got.curves, want.curves)
        assert got.body == want.body


def test_a_layer_that_moves_is_no_background(image):
    # A whole canvas that moves, behind everything once the back is removed.
    sheet = changed(image.layers["back"], name="sheet", texture=texture(Numbers("sheet")))
    sheet = replace(sheet, mesh=derived(sheet.boundary, image.picture.size, 0.3))
    layers = Layers([image.layers["back"], sheet])
    track = random_track(Numbers("track"), sheet.mesh, moving.LOOP)
    still = changed(image, layers=layers).picture
    two = pxi.Image(with_tracks(still, moving.LOOP, {"sheet": track}))
    for one in (two.layers["back"].removed(), two.layers["sheet"].reordered(0)):
        assert not one.opaque
        again = pxi.from_bytes(one.to_bytes())
        assert again.render(t=T).shape == (48, 64, 4)
        assert again.layers["sheet"].stilled().opaque


def test_what_was_not_touched_is_the_same_bytes(image):
    edited = image.layers["disc"].recoloured(hue=90)
    new = {(c.type, c.payload) for c in edited.chunks} - {(c.type, c.payload) for c in image.chunks}
    assert {t for t, _ in new} == {"POSE"}


def test_the_tool_shows_and_forgets_motion(tool, tmp_path, image):
    image.save(tmp_path / "in.pxi")
    assert tool("edit", tmp_path / "in.pxi", "--list").out.count(b", moves") == 2
    tool("edit", tmp_path / "in.pxi", tmp_path / "out.pxi", "--still", "disc")
    edited = pxi.open(tmp_path / "out.pxi")
    assert edited.baked().to_bytes() == image.layers["disc"].stilled().baked().to_bytes()
    listed = tool("edit", tmp_path / "out.pxi", "--list", "--json").out
    facts = json.loads(listed)
    assert [v["moves"] for v in facts["layers"]] == [False, True, False]
    assert facts["history"] == [{"op": "still", "layer": "disc"}]
    tool("edit", tmp_path / "out.pxi", tmp_path / "back.pxi", "--undo", "1")
    assert (tmp_path / "back.pxi").read_bytes() == (tmp_path / "in.pxi").read_bytes()
    tool("edit", tmp_path / "in.pxi", tmp_path / "no.pxi", "--still", "cat", code=2)


SWAY = {"version": 1, "preset": "sway", "duration": 0.5, "fps": 8}


def test_a_motion_is_an_edit(small_pxi):
    image = pxi.open(small_pxi)
    edited = image.edited({"op": "animate", "motion": SWAY})
    boxes = {v.name: v.boundary.bounds() for v in image.layers if v.boundary is not None}
    assert edited.baked() == image.animated(Motion.from_json(json.dumps(SWAY), boxes))
    assert edited.undone() == image
    again = pxi.from_bytes(edited.to_bytes())
    assert again == edited
    assert again.timeline.seconds == 0.5
    moving = edited.edited({"op": "animate", "motion": {**SWAY, "layers": {"bar": {}}}})
    assert moves(moving).keys() == {"bar"}
    assert moving.undone() == edited


def test_pxi_edit_takes_presets_motion_files_and_json(small_pxi, tmp_path, tool):
    words = json.dumps(SWAY)
    (tmp_path / "sway.json").write_text(words)
    wanted = pxi.open(small_pxi).edited({"op": "animate", "motion": SWAY}).to_bytes()
    for given in (words, tmp_path / "sway.json"):
        tool("edit", small_pxi, tmp_path / "out.pxi", "-f", "--animate", given)
        assert (tmp_path / "out.pxi").read_bytes() == wanted
    (tmp_path / "sway.json").write_text("{")
    ran = tool("edit", small_pxi, tmp_path / "b.pxi", "--animate", tmp_path / "sway.json", code=2)
    assert "sway.json: is not valid JSON" in ran.err
    tool("edit", small_pxi, tmp_path / "b.pxi", "--animate", "nothing.json", code=3)
