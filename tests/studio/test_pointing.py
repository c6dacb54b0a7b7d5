"""Rasters in the studio: regions that are found, pointed at, painted, and encoded."""

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.io import raster
from proxyimg_codec.limits import Limits
from proxyimg_codec.studio.content import opened
from proxyimg_codec.studio.jobs import CancelledError, Job
from proxyimg_codec.studio.pointing import Pointing
from tests.support.pictures import disc, smooth

SIZE = (67, 45)


@pytest.fixture
def picture(tmp_path):
    """A PNG file of 67x45 pixels with an object in the middle."""
    raster.write(tmp_path / "photo.png", smooth(*SIZE))
    return tmp_path / "photo.png"


@pytest.fixture
def pointed(studio, picture):
    """A studio with two regions in front of the back."""
    made = studio()
    made.open(picture)
    content = made.session.content
    regions = [region("left", 8), region("right", 50)]
    pointing = Pointing.of(content.pointing.raster)._stacked(regions)
    made.session.content = replace(content, pointing=pointing)
    return made


def region(name, x):
    mask = np.zeros(SIZE[::-1], bool)
    mask[8:20, x : x + 10] = True
    return Region(name, mask)


def names(state):
    return [v["name"] for v in state["regions"]]


def area(state, name):
    return next(v["area"] for v in state["regions"] if v["name"] == name)


def test_a_raster_is_shown_at_once_and_its_layers_follow(studio, picture):
    made = studio()
    state = made.post("/api/open?name=photo.png", content=picture.read_bytes(), json=None)
    assert (state["stage"], state["size"], names(state)) == ("pointing", [*SIZE], ["back"])
    shown = np.array(Image.open(io.BytesIO(made.get("/api/source.png").content)))
    np.testing.assert_array_equal(shown, smooth(*SIZE))
    small = Image.open(io.BytesIO(made.get("/api/source.png?width=30").content))
    assert small.size == (30, 20)
    state = made.settled()
    assert state["found"]
    assert not state["can_undo"]
    assert sum(v["area"] for v in state["regions"]) == SIZE[0] * SIZE[1]


@pytest.mark.parametrize("suffix", ["jpg", "webp"])
def test_pictures_of_other_kinds_are_opened(tmp_path, suffix):
    raster.write(tmp_path / f"a.{suffix}", smooth(*SIZE))
    data = (tmp_path / f"a.{suffix}").read_bytes()
    content = opened(data, f"a.{suffix}", Limits(), 1, Job("open"))
    assert (content.stage, content.pointing.size) == ("pointing", SIZE)


def test_outlines_enclose_what_shows(pointed):
    state = pointed.post("/api/regions/order", {"name": "left", "to": 2})
    assert names(state) == ["back", "right", "left"]
    for found in state["regions"][1:]:
        (outline,) = found["outline"]
        points = np.reshape(outline, (-1, 2))
        x0, y0, x1, y1 = found["bounds"]
        assert (points.min(0).tolist(), points.max(0).tolist()) == ([x0, y0], [x1, y1])
        after = np.roll(points, -1, 0)
        enclosed = abs((points[:, 0] * after[:, 1] - after[:, 0] * points[:, 1]).sum() / 2)
        assert enclosed == pytest.approx(found["area"], rel=0.05)


def test_a_click_makes_an_object_and_more_clicks_extend_it(studio, picture):
    made = studio()
    made.open(picture)
    state = made.post("/api/regions/point", {"inside": [[33, 22]]})
    assert "object" in names(state)
    told = next(v for v in state["regions"] if v["name"] == "object")
    assert told["prompt"] == {"inside": [[33.0, 22.0]], "outside": [], "box": None}
    state = made.post("/api/regions/point", {"name": "object", "outside": [[2, 2]]})
    told = next(v for v in state["regions"] if v["name"] == "object")
    assert told["prompt"]["inside"] == [[33.0, 22.0]]
    assert told["prompt"]["outside"] == [[2.0, 2.0]]
    state = made.post("/api/regions/point", {"name": "new", "box": [20, 10, 28, 25]})
    assert "new" in names(state)
    wanted = pxi.find_layers(smooth(*SIZE), points={"object": [(33, 22)]})[-1].mask
    made.post("/api/regions/find?wait", {"max_layers": 2})
    state = made.post("/api/regions/point", {"name": "again", "inside": [[33, 22]]})
    assert area(state, "again") == wanted.sum()


def test_paint_adds_and_erases_exactly_these_pixels(pointed):
    before = {r.name: r.mask for r in pointed.session.content.pointing.regions}
    pointed.post("/api/regions/paint", {"name": "left", "strokes": [[[50, 14]]], "radius": 3})
    after = {r.name: r.mask for r in pointed.session.content.pointing.regions}
    brush = after["left"] & ~before["left"]
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    distance = np.hypot(columns - 50, rows - 14)
    np.testing.assert_array_equal(brush, distance <= 3)
    assert not (after["right"] & brush).any()  # what is painted is seen
    erase = {"name": "left", "strokes": [[[50, 14]]], "radius": 9, "erase": True}
    pointed.post("/api/regions/paint", erase)
    np.testing.assert_array_equal(
        next(r.mask for r in pointed.session.content.pointing.regions if r.name == "left"),
        before["left"],
    )
    pointed.refused("input", "POST", "/api/regions/paint", json={
        "name": "left", "strokes": [[[0, 14], [66, 14]]], "radius": 40, "erase": True})  # fmt: skip


def test_regions_are_renamed_merged_split_removed_and_all_is_undone(pointed):
    first = pointed.post("/api/regions/rename", {"name": "left", "to": "cat"})
    assert names(first) == ["back", "cat", "right"]
    state = pointed.post("/api/regions/merge", {"name": "cat", "other": "right"})
    assert (names(state), area(state, "cat")) == (["back", "cat"], 240)
    split = {"name": "cat", "inside": [[55, 14]], "outside": [[12, 14]], "to": "cat/tail"}
    state = pointed.post("/api/regions/split", split)
    assert names(state) == ["back", "cat", "cat/tail"]
    assert area(state, "cat") + area(state, "cat/tail") == 240
    state = pointed.post("/api/regions/remove", {"name": "cat/tail"})
    assert (names(state), area(state, "cat")) == (["back", "cat"], 240)
    for _ in range(3):
        state = pointed.post("/api/regions/undo")
    assert state["regions"] == first["regions"]
    assert state["can_redo"]
    for _ in range(3):
        state = pointed.post("/api/regions/redo")
    assert names(state) == ["back", "cat"]
    pointed.refused("usage", "POST", "/api/regions/redo", json={})


@pytest.mark.parametrize(
    ("action", "values", "kind", "said"),
    [
        ("point", {"inside": [[1, 999]]}, "input", "outside the picture"),
        ("point", {"inside": [[1, 2, 3]]}, "usage", "2 numbers"),
        ("point", {"inside": "x"}, "usage", "list of points"),
        ("point", {"name": "back", "inside": [[1, 2]]}, "usage", "what no object holds"),
        ("point", {"name": "a/", "inside": [[1, 2]]}, "usage", "parts between"),
        ("point", {"name": "..", "inside": [[1, 2]]}, "usage", "parts between"),
        ("point", {"name": "a/../b", "inside": [[1, 2]]}, "usage", "parts between"),
        ("point", {}, "input", "nothing is said"),
        ("point", {"box": [1, 2, 3]}, "usage", "4 numbers"),
        ("paint", {"name": "left", "strokes": []}, "usage", "0 points"),
        ("paint", {"name": "left", "strokes": [[[1, 1]]], "radius": 0}, "usage", "radius"),
        ("paint", {"name": "left", "strokes": [[[1, 1]]], "radius": "x"}, "usage", "radius"),
        ("paint", {"name": "cat", "strokes": [[[1, 1]]]}, "usage", "no region 'cat'"),
        ("rename", {"name": "left", "to": "right"}, "usage", "already"),
        ("rename", {"name": "left", "to": ""}, "usage", "name"),
        ("remove", {"name": "back"}, "usage", "the back"),
        ("merge", {"name": "left", "other": "back"}, "usage", "the back"),
        ("merge", {"name": "left", "other": "left"}, "usage", "twice"),
        ("order", {"name": "left", "to": 0}, "usage", "1..2"),
        ("order", {"name": "left"}, "missing", "order"),
        ("split", {"name": "left", "inside": [[12, 14]]}, "usage", "all of"),
        ("find", {"max_layers": 0}, "usage", "max_layers"),
        ("find", {"max_layers": "4"}, "usage", "max_layers"),
        ("reopen", {}, "", ""),
        ("explode", {}, "missing", "explode"),
    ],
)
def test_requests_about_regions_that_make_no_sense(pointed, action, values, kind, said):
    before = pointed.settled()
    if kind:
        assert said in pointed.refused(kind, "POST", f"/api/regions/{action}", json=values)
    assert pointed.settled()["regions"] == before["regions"]


def test_what_is_encoded_is_what_pxi_encode_makes_of_the_masks(pointed, picture, tmp_path, tool):
    pointed.post("/api/regions/rename", {"name": "left", "to": "cat"})
    answer = pointed.post("/api/encode?wait", {"effort": 1, "quality": 40})
    assert answer["stage"] == "editing"
    assert answer["command"] == (
        "pxi-encode photo.png photo.pxi --masks photo-masks --effort 1 --quality 40"
    )
    made = pointed.post("/api/export?wait", {"kind": "masks"})["result"]
    archive = zipfile.ZipFile(io.BytesIO(pointed.get(made["url"]).content))
    archive.extractall(tmp_path / "photo-masks")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        tool("encode", *answer["command"].split()[1:], "-j", "1")
    wanted = (tmp_path / "photo.pxi").read_bytes()
    assert pointed.session.content.document.to_bytes() == wanted
    assert answer["result"]["bytes"] == len(wanted)

    state = pointed.edit({"op": "move", "layer": "cat", "by": [4, 3]})
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        tool("edit", *state["command"].splitlines()[1].split()[1:])
    assert (tmp_path / "edited.pxi").read_bytes() == pointed.session.content.document.to_bytes()

    state = pointed.post("/api/regions/reopen")
    assert (state["stage"], names(state)) == ("pointing", ["back", "cat", "right"])


@pytest.mark.parametrize(
    "settings",
    [{"quality": 400}, {"quality": "x"}, {"speed": 3}, {"background": "lama"}, {"effort": 0},
     {"background": "/etc/passwd"}, {"background": ["a"]}],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(pointed, settings):
    pointed.refused("usage", "POST", "/api/encode?wait", json=settings)
    assert pointed.settled()["stage"] == "pointing"


def test_a_transparent_picture_has_no_back(studio, tmp_path):
    inside = disc(64, 48)
    raster.write(tmp_path / "clear.png", np.dstack([smooth(64, 48), 255 * inside.astype("u1")]))
    made = studio()
    state = made.open(tmp_path / "clear.png")
    assert not any(v["back"] for v in state["regions"])
    assert sum(v["area"] for v in state["regions"]) == inside.sum()
    (only,) = names(state)
    split = {"name": only, "inside": [[32, 20]], "outside": [[32, 34]], "to": "top"}
    state = made.post("/api/regions/split", split)
    assert names(state) == [only, "top"]
    behind = {"name": "top", "to": 0}
    assert "hidden by" in made.refused("input", "POST", "/api/regions/order", json=behind)
    state = made.post("/api/regions/remove", {"name": only})
    assert names(state) == ["rest", "top"]
    state = made.post("/api/regions/order", behind)
    assert names(state) == ["top", "rest"]
    state = made.post("/api/regions/remove", {"name": "top"})
    assert sum(v["area"] for v in state["regions"]) == inside.sum()
    answer = made.post("/api/encode?wait", {"effort": 1})
    assert not answer["opaque"]


def test_hints_with_strokes_are_those_of_a_scribble(studio, picture):
    made = studio()
    made.open(picture)
    strokes = [[[28, 22], [38, 22]]]
    made.post("/api/regions/point", {"name": "a", "strokes": strokes, "radius": 2})
    told = made.session.content.pointing.hints["a"]
    assert told.strokes.sum() > 20
    made.post("/api/regions/point", {"name": "a", "strokes": [[[33, 26]]], "radius": 2})
    assert made.session.content.pointing.hints["a"].strokes.sum() > told.strokes.sum()


def test_a_name_that_is_free_is_found(picture):
    pointing = Pointing.of(raster.read(picture))
    assert [pointing._free("back"), pointing._free("cat")] == ["back 2", "cat"]


def test_encoding_tells_how_far_it_is_and_ends_when_it_is_cancelled(pointed):
    told = []
    content = pointed.session.content
    job = Job("encode", lambda job: told.append((job.stage, job.done, job.total)))
    content.encoded({"effort": 1}, 1, job)
    assert [t for t in told if t[1] == 0][:2] == [("layers", 0, 1), ("hidden", 0, 3)]
    assert told[-1][0] == "texture"
    assert told[-1][1] == told[-1][2]
    for stage in ("layers", "hidden", "texture"):
        job = Job("encode", lambda job, stage=stage: job.stage == stage and job.cancel())
        with pytest.raises(CancelledError, match="encode: cancelled"):
            content.encoded({"effort": 1}, 1, job)
