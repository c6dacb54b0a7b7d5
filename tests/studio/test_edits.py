"""Edits in the studio: the same bytes as with pxi-edit, undone, redone, and in words."""

import json
import shlex

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.cli.edit import arguments
from proxyimg_codec.cli.edit_flags import guarded
from proxyimg_codec.edit.operations import OPERATIONS
from proxyimg_codec.io import raster
from proxyimg_codec.limits import Limits
from proxyimg_codec.studio import words
from proxyimg_codec.studio.content import opened
from proxyimg_codec.studio.describe import described
from proxyimg_codec.studio.edits import FORBIDDEN, regular
from proxyimg_codec.studio.jobs import Job
from tests.support.edits import BAD, EDITS, FLAGS

MOVES = {"op": "move", "layer": "disc", "by": [3, -2]}
PAGE_EDITS = [
    MOVES,
    {"op": "rotate", "layer": "disc", "degrees": 10, "pivot": [20, 20]},
    {"op": "drag", "layer": "bar", "handles": [[20, 30, 2, 1], [40, 30, 0, 0]]},
    {"op": "opacity", "layer": "bar", "value": 1},
    {"op": "recolour", "layer": "disc", "hue": 40, "tint": "#102030"},
    {"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [1, 2], "follow": False},
    {"op": "order", "layer": "bar", "to": "front"},
    {"op": "texture", "fit": "shape", "source": "bar", "layer": "disc"},
    {"op": "rename", "layer": "disc", "name": "sun"},
    {
        "op": "animate",
        "motion": {
            "version": 1,
            "preset": "sway",
            "layers": {"sun": {}},
            "duration": 0.5,
            "fps": 6,
            "loop": False,
        },
    },
    {"op": "remove", "layer": "bar"},
]
"""Edits as JavaScript writes them: whole numbers, and keys in any order."""


def parsed(flags):
    """Edits that pxi-edit makes of words."""
    args = arguments().parse_args(guarded(["IN", "OUT", *flags]))
    return [edit.values() for edit in args.edits]


@pytest.fixture(scope="module")
def edited(small_pxi, tmp_path_factory):
    """State after the edits of the page, and the bytes of the file."""
    content = opened(small_pxi.read_bytes(), "small.pxi", Limits(), 1, Job("open"))
    content = content.with_edits(PAGE_EDITS, tmp_path_factory.mktemp("none"), ())
    return described(content, {}, ""), content.edited.to_bytes()


def test_the_flags_in_the_history_make_the_same_file(edited, small_pxi, tmp_path, tool):
    state, data = edited
    flags = [word for step in state["history"] for word in shlex.split(step["flags"])]
    tool("edit", small_pxi, tmp_path / "by-flags.pxi", *flags)
    assert (tmp_path / "by-flags.pxi").read_bytes() == data
    assert pxi.from_bytes(data).layers[-1].name == "sun"

    words_of_all = shlex.split(state["command"])
    assert words_of_all[:3] == ["pxi-edit", "small.pxi", "edited.pxi"]
    assert words_of_all[3:] == flags


def test_the_python_in_the_history_makes_the_same_file(edited, small_pxi, monkeypatch):
    state, data = edited
    monkeypatch.chdir(small_pxi.parent)
    exec(state["python"], {})
    assert (small_pxi.parent / "edited.pxi").read_bytes() == data


def test_edits_one_by_one_give_the_same_file(edited, studio, small_pxi):
    made = studio()
    made.open(small_pxi)
    for edit in PAGE_EDITS:
        made.edit(edit)
    saved = made.post("/api/export?wait", {"kind": "pxi"})["result"]
    assert made.get(saved["url"]).content == edited[1]


def test_files_in_edits_are_named_without_places(studio, small_pxi, photo, tmp_path, tool):
    raster.write(tmp_path / "hat.png", photo)
    made = studio()
    made.open(small_pxi)
    made.post("/api/files?name=hat.png", content=(tmp_path / "hat.png").read_bytes(), json=None)
    state = made.edit({"op": "texture", "layer": "disc", "source": "hat.png", "effort": 1})
    assert state["files"] == ["hat.png"]
    assert state["history"][0]["op"]["source"] == "hat.png"
    assert state["history"][0]["flags"] is None  # the effort of one edit has no flag
    assert "--script small.json" in state["command"]
    script = made.post("/api/export?wait", {"kind": "script"})["result"]
    (tmp_path / "small.json").write_bytes(made.get(script["url"]).content)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        tool("edit", small_pxi, "out.pxi", "--script", "small.json")
    wanted = made.session.content.document.to_bytes()
    assert (tmp_path / "out.pxi").read_bytes() == wanted


def test_undo_redo_and_jumps(studio, small_pxi):
    made = studio()
    made.open(small_pxi)
    files = [made.session.content.document.to_bytes()]
    for edit in PAGE_EDITS[:4]:
        made.edit(edit)
        files.append(made.session.content.document.to_bytes())
    for to in (4, 2, 0, 3, 1, 4):
        state = made.post("/api/jump", {"to": to})
        assert (state["at"], len(state["history"])) == (to, 4)
        assert made.session.content.document.to_bytes() == files[to]
    assert made.post("/api/undo", {"steps": 3})["at"] == 1
    assert made.post("/api/redo")["at"] == 2
    made.refused("usage", "POST", "/api/redo", json={"steps": 3})
    made.refused("usage", "POST", "/api/undo", json={"steps": 3})
    made.refused("usage", "POST", "/api/jump", json={"to": 5})
    state = made.edit(PAGE_EDITS[6])  # what was undone is gone
    assert [step["op"]["op"] for step in state["history"]] == ["move", "rotate", "order"]
    made.refused("usage", "POST", "/api/redo", json={})


def test_undo_beyond_the_opening_is_said_in_the_command(studio, small_pxi, tmp_path, tool):
    tool("edit", small_pxi, tmp_path / "old.pxi", "--move", "disc", "1,2", "--hide", "bar")
    made = studio()
    state = made.open(tmp_path / "old.pxi")
    assert (state["at"], state["command"]) == (2, "")
    made.post("/api/undo")
    state = made.edit({"op": "show", "layer": "bar"})
    assert state["command"].endswith("--undo 1 --show bar")
    tool("edit", tmp_path / "old.pxi", tmp_path / "b.pxi", "--undo", "1", "--show", "bar")
    assert (tmp_path / "b.pxi").read_bytes() == made.session.content.document.to_bytes()


def test_all_edits_of_a_request_are_done_or_none(studio, small_pxi):
    made = studio()
    before = made.open(small_pxi)
    said = made.refused(
        "usage", "POST", "/api/edit", json={"edits": [MOVES, {"op": "hide", "layer": "cat"}]}
    )
    assert "edit 2" in said
    after = made.settled()
    assert after["at"] == 0
    assert after["version"] == before["version"]


def test_a_request_for_another_state_is_stale(studio, small_pxi):
    made = studio()
    version = made.open(small_pxi)["version"]
    body = {"edits": [MOVES], "version": version}
    made.post("/api/edit", body)
    made.refused("stale", "POST", "/api/edit", json=body)
    assert made.settled()["at"] == 1


@pytest.mark.parametrize("flags", [flags for flags, _ in FLAGS if "-1" not in str(flags)])
def test_flags_in_words_are_read_as_the_same_edit(flags, small_pxi):
    image = pxi.open(small_pxi)
    (edit,) = parsed(flags)
    done = json.loads(image.edited(regular(edit)).history[-1].operation)
    said = words.flags(done)
    assert said is not None
    assert json.dumps(regular(parsed(said)[0])) == json.dumps(regular(done))


@pytest.mark.parametrize("edit", [*PAGE_EDITS, *({"op": "cut", "layer": "a", **more} for more in (
    {"mask": "m.png"}, {"points": [[1, 2], [3, 4.5]], "outside": [[0, 1]]})),
    {"op": "complete", "layer": "a"}, {"op": "complete", "layer": "a", "method": "smooth"},
    {"op": "insert", "under": "a", "at": [1, 2], "source": "hat.png"},
    {"op": "insert", "source": "b.pxi", "over": "a", "from_layer": "disc"}])  # fmt: skip
def test_regular_edits_are_what_flags_give(edit):
    assert json.dumps(parsed(words.flags(regular(edit)))[0]) == json.dumps(regular(edit))


@pytest.mark.parametrize("name", ["-5", "12", "a=b", "a@b", "a:b", "a,b"])
def test_names_that_flags_cannot_say_are_left_to_scripts(name):
    edits = [
        {"op": "texture", "layer": "disc", "source": name},
        {"op": "insert", "source": name},
        {"op": "group", "layers": ["disc", name], "name": "both"},
        {"op": "hide", "layer": name},
    ]
    for edit in edits:
        said = words.flags(edit)
        assert said is None or json.dumps(parsed(said)[0]) == json.dumps(edit)


def test_every_operation_has_words():
    allowed = set(OPERATIONS) - set(FORBIDDEN)
    assert allowed <= set(words.LABELS)
    assert allowed <= set(words._FLAGS)
    assert words.label({"op": "move", "layer": "cat"}) == "Move cat"
    for strange in (None, 3, {}, {"op": "fly"}, {"op": "move"}, {"op": "drag", "layer": "a"}):
        assert words.flags(strange) is None
        assert words.label(strange)
        assert words.python(strange).startswith(".edited(")


@pytest.mark.parametrize("name", EDITS)
def test_python_in_words_does_the_same(name, small_pxi):
    image = pxi.open(small_pxi)
    wanted = EDITS[name](image.layers["disc"])
    edit = json.loads(wanted.history[-1].operation)
    assert eval("image" + words.python(edit), {"image": image}) == wanted


@pytest.mark.parametrize("operation", [v for v, _ in BAD if isinstance(v, dict)])
def test_bad_edits_are_refused(studio_of_small, operation):
    if any(np.isnan(v) for v in np.ravel(list(operation.get("by", [])) or [0])):
        return  # JSON has no such number
    made = studio_of_small
    made.refused("usage", "POST", "/api/edit", json={"edits": [operation]})
    assert made.settled()["at"] == 0


@pytest.fixture
def studio_of_small(studio, small_pxi):
    made = studio()
    made.open(small_pxi)
    return made
