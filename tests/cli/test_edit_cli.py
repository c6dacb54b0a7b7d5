import json
import shutil

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io import raster
from tests.support import hidden
from tests.support.edits import FLAGS


@pytest.fixture
def work(small_pxi, tmp_path):
    shutil.copy(small_pxi, tmp_path / "in.pxi")
    return tmp_path


def edited(tool, work, *words):
    tool("edit", work / "in.pxi", work / "out.pxi", *words, "--force")
    return pxi.open(work / "out.pxi")


def by_name(operation):
    """The operation with names of the layers back, bar and disc for their positions."""

    def name(value):
        return ("back", "bar", "disc")[value] if isinstance(value, int) else value

    plain = {k: name(v) if k in ("layer", "source") else v for k, v in operation.items()}
    if operation["op"] == "parent":
        plain["to"] = name(plain["to"])
    if "layers" in plain:
        plain["layers"] = [name(v) for v in plain["layers"]]
    return plain


@pytest.mark.parametrize(("words", "operation"), FLAGS)
def test_flags_are_operations(tool, work, words, operation):
    got = edited(tool, work, *words)
    assert json.loads(got.history[-1].operation) == by_name(operation)
    want = pxi.open(work / "in.pxi").edited(operation)
    assert got.baked().to_bytes() == want.baked().to_bytes()
    assert got.undone().to_bytes() == (work / "in.pxi").read_bytes()


def test_edits_are_done_in_their_order(tool, work):
    one = edited(tool, work, "--move", "disc", "9,0", "--scale", "disc", "2@0,0")
    two = edited(tool, work, "--scale", "disc", "2@0,0", "--move", "disc", "9,0")
    assert one.layers["disc"].pose.shift == (18 << 10, 0)
    assert two.layers["disc"].pose.shift == (9 << 10, 0)


def test_texture_of_a_file(tool, work):
    other = work / "other.pxi"
    pxi.open(work / "in.pxi").layers["bar"].renamed("plank").save(other)
    got = edited(tool, work, "--texture", f"disc={other}:plank")
    want = pxi.open(work / "in.pxi").layers["disc"].textured("bar")
    np.testing.assert_array_equal(got.render(), want.render())


def test_undo_and_bake(tool, work):
    edited(tool, work, "--move", "disc", "1,2", "--hide", "bar")
    tool("edit", work / "out.pxi", work / "back.pxi", "--undo", "2")
    assert (work / "back.pxi").read_bytes() == (work / "in.pxi").read_bytes()
    tool("edit", work / "out.pxi", work / "baked.pxi", "--bake")
    assert not pxi.open(work / "baked.pxi").history
    went = edited(tool, work, "--move", "disc", "7,8", "--move", "disc", "-7,-8", "--bake")
    assert went.to_bytes() == (work / "in.pxi").read_bytes()


def test_in_place_with_force_and_never_without(tool, work):
    path = work / "in.pxi"
    before = path.read_bytes()
    tool("edit", path, path, "--hide", "disc", code=2)
    assert path.read_bytes() == before
    tool("edit", path, path, "--hide", "disc", "--force")
    assert pxi.open(path).layers["disc"].pose.hidden


def test_script(tool, work):
    script = work / "edits.json"
    edits = [{"op": "move", "layer": "disc", "by": [1, 2]}, {"op": "hide", "layer": "bar"}]
    script.write_text(json.dumps({"version": 1, "edits": edits}))
    got = edited(tool, work, "--script", script)
    assert [json.loads(s.operation) for s in got.history] == edits


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "JSON"),
        ("[]", "version"),
        ('{"version": 2, "edits": []}', "version"),
        ('{"version": 1}', "edits"),
        ('{"version": 1, "edits": [], "more": 1}', "nothing else"),
        ('{"version": 1, "edits": [3]}', "unknown"),
        ('{"version": 1, "edits": [{"op": "hide", "layer": "cat"}]}', "cat"),
        ("[" * 100000, "JSON"),
    ],
)
def test_bad_scripts_write_nothing(tool, work, text, said):
    script = work / "edits.json"
    script.write_text(text)
    ran = tool("edit", work / "in.pxi", work / "out.pxi", "--script", script, code=2)
    assert said in ran.err
    assert not (work / "out.pxi").exists()


def test_list(tool, work):
    edited(
        tool, work, "--move", "disc", "4,0", "--group", "both=bar,disc", "--opacity", "disc", ".5"
    )
    lines = tool("edit", work / "out.pxi", "--list").out.decode().splitlines()
    assert lines[0].startswith("0 'back': 64x48 at 0,0")
    assert "moved" in lines[2]
    assert "opacity 0.5" in lines[2]
    assert "in 'both'" in lines[2]
    assert lines[3] == "group 'both'"
    assert '"op": "move"' in lines[4]
    facts = json.loads(tool("edit", work / "out.pxi", "--list", "--json").out)
    assert [v["name"] for v in facts["layers"]] == ["back", "bar", "disc"]
    assert facts["groups"] == {"both": None}
    assert len(facts["history"]) == 3


def test_report(tool, work):
    ran = tool("edit", work / "in.pxi", work / "out.pxi", "--hide", "disc")
    assert "1 edits to undo" in ran.err
    assert tool("edit", work / "in.pxi", work / "b.pxi", "--hide", "disc", "--quiet").err == ""
    facts = json.loads(tool("edit", work / "in.pxi", work / "c.pxi", "--hide", "bar", "--json").out)
    assert facts["bytes"] == (work / "c.pxi").stat().st_size
    assert facts["layers"] == ["back", "bar", "disc"]


def test_standard_streams(tool, work):
    data = (work / "in.pxi").read_bytes()
    out = tool("edit", "-", "-", "--move", "disc", "1,1", stdin=data).out
    assert pxi.from_bytes(out).layers["disc"].pose.shift == (1024, 1024)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--move", "cat", "1,1"], "no layer 'cat'"),
        (["--move", "disc", "1"], "--move disc 1: cannot be understood"),
        (["--move", "disc", "a,b"], "cannot be understood"),
        (["--scale", "disc", "0"], "singular"),
        (["--drag", "disc", "1,1"], "cannot be understood"),
        (["--texture", "disc"], "cannot be understood"),
        (["--texture", "disc=none.png"], "none.png"),
        (["--undo", "1"], "has 0"),
        (["--group", "a=disc", "--group", "b=a", "--group", "a=b"], "part of itself"),
        (["--frobnicate"], "unrecognized"),
        (["--move", "disc"], "expected 2 arguments"),
    ],
)
def test_bad_edits_write_nothing(tool, work, words, said):
    before = (work / "in.pxi").read_bytes()
    ran = tool("edit", work / "in.pxi", work / "out.pxi", *words, code=2)
    assert said in ran.err
    assert not (work / "out.pxi").exists()
    assert (work / "in.pxi").read_bytes() == before


def test_an_output_is_needed_and_not_replaced(tool, work):
    assert "OUT" in tool("edit", work / "in.pxi", "--hide", "disc", code=2).err
    (work / "out.pxi").write_bytes(b"old")
    tool("edit", work / "in.pxi", work / "out.pxi", "--hide", "disc", code=3)
    assert (work / "out.pxi").read_bytes() == b"old"
    tool("edit", work / "in.pxi", "-", "--list", code=2)
    tool("edit", work / "none.pxi", work / "b.pxi", "--hide", "disc", code=3)
    (work / "bad.pxi").write_bytes(b"no picture")
    tool("edit", work / "bad.pxi", work / "b.pxi", "--hide", "disc", code=4)


def test_outlines_come_back_from_svg(tool, work):
    pytest.importorskip("svgelements")
    tool("decode", work / "in.pxi", work / "shapes.svg")
    same = edited(tool, work, "--outlines", work / "shapes.svg", "--bake")
    assert same.to_bytes() == (work / "in.pxi").read_bytes()
    moved = edited(tool, work, "--move", "disc", "3,1")
    tool("decode", work / "out.pxi", work / "moved.svg")
    back = edited(tool, work, "--outlines", work / "moved.svg")
    want = moved.layers["disc"].outline.paths[0] / 1024
    got = back.layers["disc"].outline
    assert np.abs(got.paths[0] / (1 << got.unit) - want).max() <= 1 / 64


def test_decoding_shows_the_edit(tool, work):
    pytest.importorskip("OpenImageIO")
    edited(tool, work, "--remove", "disc")
    tool("decode", work / "out.pxi", work / "out.png")
    pixels = raster.read(work / "out.png").pixels
    assert pixels[24, 32, 0] < 180  # the disc is red


def test_positions_are_those_of_the_input(tool, work):
    words = "--remove", "1", "--rename", "2=sun", "--move", "2", "3,-4", "--duplicate", "0"
    got = edited(tool, work, *words, "--hide", "-1")
    assert [(v.name, v.pose.shift, v.pose.hidden) for v in got.layers] == [
        ("back", (0, 0), False), ("back copy", (0, 0), False), ("sun", (3072, -4096), True)
    ]  # fmt: skip
    script = work / "edits.json"
    edits = [{"op": "order", "layer": 2, "to": 1}, {"op": "hide", "layer": 2}]
    script.write_text(json.dumps({"version": 1, "edits": edits}))
    got = edited(tool, work, "--remove", "bar", "--script", script, "--opacity", "2", "0.5")
    assert [v.pose.hidden for v in got.layers] == [False, True]
    assert got.layers["disc"].pose.opacity < 40000
    ran = tool("edit", work / "in.pxi", work / "b.pxi", "--remove", "1", "--hide", "1", code=2)
    assert "edit 2: layer 1, which was 'bar', is gone" in ran.err


def test_undo_among_edits_takes_positions_back(tool, work):
    got = edited(tool, work, "--remove", "1", "--rename", "2=a", "--undo", "2", "--hide", "1")
    assert [(v.name, v.pose.hidden) for v in got.layers] == [
        ("back", False), ("bar", True), ("disc", False)
    ]  # fmt: skip


def test_a_drag_says_what_it_does_where_one_might_not_expect_it(tool, work):
    path = work / "in.pxi"
    two = ("30,20:1,1", "34,30:0,0")
    for handles, said in (
        (two, ()),
        (two[:1], ("one point moves all of 'disc'",)),
        (("-9,0:1,1", two[1]), ("warning: drag: -9,0 outside of 'disc'",)),
        (("99,99:1,1",), ("99,99 outside", "one point moves all")),
    ):
        ran = tool("edit", path, work / "out.pxi", "-f", "--drag", "2", *handles)
        lines = ran.err.splitlines()
        assert len(lines) == 1 + len(said)
        for phrase, line in zip(said, lines, strict=False):
            assert line.startswith("pxi-edit: ")
            assert phrase in line
        quiet = tool("edit", path, work / "out.pxi", "-f", "--drag", "disc", *handles, "--quiet")
        assert quiet.err == ""


def test_what_a_drawn_picture_cannot_hold_is_said_by_the_tool_that_was_called(tool, tmp_path):
    pixels = np.full((9, 13, 3), 90, np.uint8)
    image = pxi.encode(pixels, effort=1, blocks={"xmp": b"<x:xmpmeta xmlns:x='adobe:ns:meta/'/>"})
    image.save(tmp_path / "a.pxi")
    ran = tool("edit", tmp_path / "a.pxi", tmp_path / "a.ppm", "--opacity", "0", "1")
    assert "pxi-edit: warning: " in ran.err
    assert "pxi-decode" not in ran.err


def test_purge_and_who_says_what_stays(tool, tmp_path):
    files = tmp_path / "in.pxi", tmp_path / "out.pxi", tmp_path / "purged.pxi"
    image = hidden.encoded("blue")
    image.save(files[0])
    stays = "pxi-edit: pixels that no layer shows any more stay in the file; --purge takes them out"
    assert stays in tool("edit", *files[:2], "--remove", "disc").err
    assert stays not in tool("edit", *files[:2], "--remove", "disc", "--force", "--quiet").err
    assert stays not in tool("edit", *files[:2], "--move", "disc", "3,4", "--force").err
    tool("edit", *files[:2], "--remove", "disc", "--force")
    said = tool("edit", *files[1:], "--purge", "-e", "1").err
    assert "samples that no layer shows, and the history of 1 edits" in said
    assert stays not in said
    assert files[2].read_bytes() == image.layers["disc"].removed().purged(1).to_bytes()
    assert "purged 0 samples" in tool("edit", *files[:2], "--purge", "--force").err
    assert files[1].read_bytes() == files[0].read_bytes()
    assert "OUT is missing" in tool("edit", files[0], "--purge", "--list", code=2).err
