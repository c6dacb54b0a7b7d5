"""Names of inputs and outputs: what is refused, what is recognized, and several inputs."""

import json
import os
import shutil
import threading

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.cli.common import printable
from proxyimg_codec.cli.places import default_target, same_file
from proxyimg_codec.io.raster import read, write
from tests.support.pictures import smooth

encoder = pytest.mark.encoder
TINY = ("-e", "1", "-j", "1", "--layers", "1")
ODD = ["-5", "-x", "--force", "a\nb", "c\x1b[2J", "\udcff\udce9", "é 猫", " s ", "%s"]
"""Names that shells, terminals, argparse or formats could take for something else."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, where the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def picture(small_pxi, here):
    """picture(name) makes a .pxi file of that name."""
    return lambda name: shutil.copy(small_pxi, os.path.join(here, name))


def png(name, width=19, height=13):
    write(name, smooth(width, height))
    with open(name, "rb") as file:
        return file.read()


def content(name):
    with open(name, "rb") as file:
        return file.read()


# Suffixes


@encoder
@pytest.mark.parametrize("name", ["b.png", "b", "b.pxi.png", "b.jpg", "b.ora", "missing.webp"])
def test_a_pxi_file_is_written_under_no_other_suffix(tool, here, name):
    png("a.png")
    old = png("b.png")
    shutil.copy("b.png", name) if name not in ("b.png", "missing.webp") else None
    before = sorted(os.listdir())
    for force in ((), ("-f",)):
        err = tool("encode", *force, *TINY, "a.png", name, code=2).err
        assert name in err
        assert "--force-suffix" in err
        assert "-o" in err
    assert sorted(os.listdir()) == before
    assert content("b.png") == old


@encoder
def test_insisting_writes_under_any_suffix_but_over_no_input(tool, here):
    png("a.png"), png("b.png")
    os.mkdir("masks")
    png("masks/1.png")
    tool("encode", *TINY, "a.png", "b.png", "--force-suffix", code=3)
    tool("encode", *TINY, "a.png", "b.png", "--force-suffix", "-f")
    assert pxi.open("b.png").width == 19
    tool("encode", *TINY, "a.png", "c.PXI")
    for masks in ("masks", "masks/1.png"):
        flags = ("--masks", masks, "--force-suffix", "-f", "-e", "1")
        err = tool("encode", "a.png", "masks/1.png", *flags, code=2).err
        assert "same file" in err


def test_pxi_decode_draws_and_does_not_write_pxi(tool, picture):
    picture("a.pxi"), picture("b.pxi")
    before = content("b.pxi")
    assert "pxi-edit" in tool("decode", "-f", "a.pxi", "b.pxi", code=2).err
    assert content("b.pxi") == before


@encoder
@pytest.mark.skipif(not os.path.exists("/dev/stdout"), reason="there is no /dev/stdout")
def test_standard_streams_by_name(launch, here):
    data = png("a.png")
    names = launch("encode", "a.png", "/dev/stdout", *TINY, "--quiet").out
    assert names == launch("encode", "/dev/stdin", *TINY, "--quiet", input=data).out
    assert names == launch("encode", "-", "-", *TINY, "--quiet", input=data).out
    drawn = launch("decode", "-", "/dev/fd/1", "--quiet", input=names).out
    assert drawn == launch("decode", "/dev/stdin", "--quiet", input=names).out
    assert drawn[:4] == b"\x89PNG"


@encoder
def test_nothing_but_the_picture_goes_to_standard_output_if_standard_error_is_closed(launch, here):
    png("a.png")
    closed = {"first": "exec 2>&-"}
    data = launch("encode", "a.png", "-", *TINY).out
    assert launch("encode", "a.png", "-", *TINY, **closed).out == data
    with open("a.pxi", "wb") as file:
        file.write(data)
    assert launch("decode", "a.pxi", "-", **closed).out == launch("decode", "a.pxi", "-").out
    assert launch("edit", "a.pxi", "b.pxi", "--bake", **closed).out == b""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("words", [("edit", "a.pxi", "pipe"), ("decode", "a.pxi", "pipe")])
def test_pipes_of_any_name(tool, picture, words):
    picture("a.pxi")
    os.mkfifo("pipe")
    got = []
    reader = threading.Thread(target=lambda: got.append(content("pipe")))
    reader.start()
    tool(words[0], *words[1:], "--quiet", *(["--bake"] if words[0] == "edit" else []))
    reader.join(20)
    assert got[0][:4] == (b"\x89PXI" if words[0] == "edit" else b"\x89PNG")


# Editing


@pytest.mark.parametrize("name", ["out.png", "out.PPM", "out.npy"])
def test_pxi_edit_draws_to_picture_files(tool, picture, name):
    picture("in.pxi")
    ran = tool("edit", "in.pxi", name, "--hide", "disc", "--json")
    assert json.loads(ran.out)["bytes"] == os.path.getsize(name)
    want = pxi.open("in.pxi").layers["disc"].hidden()
    np.testing.assert_array_equal(read(name).pixels, want.render())
    tool("edit", "in.pxi", "same.pxi", "--hide", "disc")
    tool("decode", "same.pxi", f"same{name[3:]}")
    assert content(name) == content(f"same{name[3:]}")
    assert "exists" in tool("edit", "in.pxi", name, "--hide", "bar", code=3).err


def test_pxi_edit_draws_layers_and_outlines(tool, picture):
    picture("in.pxi")
    tool("edit", "in.pxi", "out.svg", "--remove", "disc")
    assert b'"bar"' in content("out.svg")
    assert b"disc" not in content("out.svg")
    tool("edit", "in.pxi", "out.ora", "--remove", "disc")
    assert content("out.ora")[:2] == b"PK"


@pytest.mark.parametrize(("name", "code"), [("out", 2), ("out.txt", 5), ("in.png", 2)])
def test_pxi_edit_writes_no_pxi_data_under_other_names(tool, picture, name, code):
    picture("in.pxi")
    picture("in.png")
    before = sorted(os.listdir()), content("in.png")
    source = "in.png" if name == "in.png" else "in.pxi"
    tool("edit", source, name, "--hide", "disc", "-f", code=code)
    assert (sorted(os.listdir()), content("in.png")) == before
    tool("edit", source, name, "--hide", "disc", "-f", "--force-suffix")
    assert pxi.open(name).layers["disc"].pose.hidden


# The same file


LINKS = {
    "itself": lambda name: f"./{name}",
    "symbolic": lambda name: os.symlink(name, "link.pxi") or "link.pxi",
    "hard": lambda name: os.link(name, "link.pxi") or "link.pxi",
    "folder": lambda name: os.symlink(".", "also") or f"also/{name}",
}


@pytest.mark.parametrize("kind", LINKS)
def test_a_file_is_known_under_every_name(tool, picture, kind):
    picture("in.pxi")
    before, name = content("in.pxi"), LINKS[kind]("in.pxi")
    assert same_file("in.pxi", name)
    hide = ("--hide", "disc")
    for words in (
        ("decode", "in.pxi", name, "-f"),
        ("decode", "in.pxi", "--export-onnx", name, "-f"),
        ("animate", "in.pxi", name, "-f", "--preset", "sway"),
        ("edit", "in.pxi", name, *hide),
        ("edit", "in.pxi", name, "-f", "--texture", f"disc={name}:bar"),
    ):
        assert "same file" in tool(*words, code=2).err or words[0] == "decode"
        assert content("in.pxi") == before
    tool("edit", "in.pxi", name, *hide, "-f")
    assert pxi.open(name).layers["disc"].pose.hidden
    assert os.path.islink(name) == (kind == "symbolic")


def test_standard_input_may_be_the_output(launch, picture, small_pxi):
    picture("in.pxi")
    with open("in.pxi", "rb") as file:
        ran = launch("animate", "-", "in.pxi", "--preset", "sway", "-f", stdin=file, code=2)
    assert "same file" in ran.err
    with open("in.pxi", "rb") as file:
        launch("edit", "-", "in.pxi", "--hide", "disc", "-f", stdin=file)
    assert pxi.open("in.pxi").layers["disc"].pose.hidden


def test_files_that_edits_read_are_not_overwritten(tool, picture):
    picture("in.pxi"), picture("other.pxi")
    with open("edits.pxi", "w") as file:
        json.dump({"version": 1, "edits": [{"op": "texture", "layer": "disc", "source": "other.pxi",
                                            "from_layer": "bar"}]}, file)  # fmt: skip
    before = content("other.pxi"), content("edits.pxi")
    for out, flags in (
        ("other.pxi", ("--texture", "disc=other.pxi:bar")),
        ("other.pxi", ("--script", "edits.pxi")),
        ("edits.pxi", ("--script", "edits.pxi")),
    ):
        assert "same file" in tool("edit", "in.pxi", out, *flags, "-f", code=2).err
    assert (content("other.pxi"), content("edits.pxi")) == before


def test_a_sprite_sheet_replaces_no_motion(tool, moving_pxi, here):
    motion = '{"version": 1, "duration": 0.2, "fps": 5, "layers": {"*": {}}}'
    with open("walk.json", "w") as file:
        file.write(motion)
    words = "animate", moving_pxi, "walk.png", "--sheet", "--motion", "walk.json"
    assert "walk.json: input and output" in tool(*words, "-f", code=2).err
    tool(*words, code=2)
    shutil.copy("walk.json", "run.json")
    assert "run.json: exists" in tool("animate", moving_pxi, "run.png", "--sheet", code=3).err
    assert content("run.json").decode() == motion


def test_a_missing_input_is_not_a_missing_output(here):
    assert same_file("none", "./none")
    assert not same_file("none", "nothing")
    assert not same_file("/dev/null", "/dev/null")


# Odd names


@pytest.mark.parametrize("name", ODD)
def test_odd_names(tool, picture, name):
    source, target = f"{name}.pxi", f"{name}2.pxi"
    picture(source)
    assert b"64x48" in tool("info", "--", source).out
    assert json.loads(tool("info", "--json", "--", source).out)["width"] == 64
    said = tool("validate", "--", source).out
    assert all(c.isprintable() for line in said.decode().splitlines() for c in line)
    facts = json.loads(tool("validate", "--json", "--", source).out)
    assert facts["files"][0]["file"] == source
    ran = tool("edit", "--move", "disc", "-3,-4", "--json", "--", source, target)
    assert json.loads(ran.out)["output"] == target
    assert pxi.open(target).layers["disc"].pose.shift == (-3072, -4096)
    err = tool("decode", "--", source).err
    assert printable(f"{name}.png") in err
    assert err.strip().isprintable()
    assert read(f"{name}.png").pixels.shape == (48, 64, 3)
    err = tool("animate", "--preset", "sway", "--duration", "0.2", "-f", "--", source, target).err
    assert err.strip().isprintable()
    assert pxi.open(target).timeline is not None


@encoder
@pytest.mark.parametrize("name", ODD)
def test_odd_names_of_pictures(tool, here, name):
    png(f"{name}.png")
    ran = tool("encode", *TINY, "--json", "--", f"{name}.png")
    assert json.loads(ran.out)["output"] == f"{name}.pxi"
    assert pxi.open(f"{name}.pxi").width == 19
    err = tool("encode", *TINY, "--", f"{name}.png", code=3).err
    assert printable(name) in err
    tool("encode", *TINY, "-f", "-o", "out/", "--", f"{name}.png")
    assert os.listdir("out") == [f"{name}.pxi"]


@encoder
@pytest.mark.parametrize("suffix", [".\udcff", ".png\n", ".é", ".pn\x1b"])
def test_odd_suffixes(tool, here, suffix):
    png("a.png"), shutil.copy("a.png", f"b{suffix}")
    tool("encode", *TINY, f"b{suffix}")
    assert pxi.open(f"b{suffix}.pxi").width == 19
    assert printable(suffix) in tool("decode", f"b{suffix}.pxi", f"c{suffix}", code=5).err
    assert printable(suffix) in tool("edit", "--bake", f"b{suffix}.pxi", f"c{suffix}", code=5).err
    tool("encode", *TINY, f"b{suffix}", f"c{suffix}", code=2)


def test_pxi_edit_names_no_flag_that_it_lacks(tool, picture):
    picture("a.pxi")
    err = tool("edit", "a.pxi", "b.pxi", "c.pxi", "--hide", "1", code=2).err
    assert "3 files are too many for IN OUT" in err
    assert "-o" not in err


def test_a_negative_name_needs_no_dashes_in_pxi_edit(tool, picture):
    picture("-5.pxi")
    tool("edit", "-5.pxi", "--move", "-1", "-.5,-3", "-6.pxi")
    assert pxi.open("-6.pxi").layers["disc"].pose.shift == (-512, -3072)


@pytest.mark.parametrize("name", ["decode", "edit", "animate", "info"])
def test_a_missing_file_of_an_odd_name_is_one_line(tool, here, name):
    out = {"edit": ["out.pxi"], "animate": ["out.gif"]}.get(name, [])
    flags = ["--bake"] if name == "edit" else []
    err = tool(name, *flags, "--", "a\n\x1b[2J\udcff", *out, code=3).err
    assert err.strip().isprintable()
    assert r"a\n\x1b[2J\udcff" in err


@pytest.mark.parametrize(
    "name",
    ["encode", "decode", "edit", "animate", "info", "validate", "bench", "layers", "models"],
)
def test_refused_words_control_no_terminal(tool, here, name):
    words = {"bench": ["rd"], "models": ["list"]}.get(name, [])
    err = tool(name, *words, "a", "b", "--\x1b[2J\udcff\n", code=2).err
    assert "\\x1b[2J" in err
    assert all(line.isprintable() for line in err.splitlines())


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("photo.jpg", "photo.pxi"),
        ("photo.JPEG", "photo.pxi"),
        ("name.v1.2", "name.v1.2.pxi"),
        ("name.v1.2.tiff", "name.v1.2.pxi"),
        ("a.b/c", "a.b/c.pxi"),
        ("a.png/c.d", "a.png/c.d.pxi"),
        ("2026-11-30 10.15", "2026-11-30 10.15.pxi"),
        (".png", ".png.pxi"),
        ("x.", "x..pxi"),
        ("-", "-"),
    ],
)
def test_the_default_output_replaces_only_suffixes_of_pictures(name, wanted):
    assert default_target(name, ".pxi") == wanted


def test_the_default_output_of_pxi_decode(tool, picture):
    picture("name.v1.2"), picture("a.pxi")
    tool("decode", "name.v1.2")
    tool("decode", "a.pxi")
    assert sorted(os.listdir()) == ["a.png", "a.pxi", "name.v1.2", "name.v1.2.png"]


# Several inputs


@encoder
def test_several_pictures_into_a_folder(tool, here):
    png("a.png"), png("b.c.png", 11)
    np.save("d.npy", smooth(9, 8))
    ran = tool("encode", *TINY, "a.png", "b.c.png", "-o", "out/", "d.npy", "--json")
    reports = [json.loads(line) for line in ran.out.splitlines()]
    assert [r["output"] for r in reports] == ["out/a.pxi", "out/b.c.pxi", "out/d.pxi"]
    assert [pxi.open(r["output"]).width for r in reports] == [19, 11, 9]
    tool("encode", *TINY, "a.png", "alone.pxi")
    assert content("alone.pxi") == content("out/a.pxi")
    tool("encode", *TINY, "b.c.png", "-o", "one.pxi")
    assert content("one.pxi") == content("out/b.c.pxi")


def test_several_files_are_drawn_into_a_folder(tool, picture):
    picture("a.pxi"), picture("b.v2")
    os.mkdir("out")
    err = tool("decode", "a.pxi", "b.v2", "-o", "out", "--width", "31", "-j", "1").err
    names = [line.split(":")[0] for line in err.splitlines()]
    assert names == ["out/a.png", "out/b.v2.png", "out"]
    assert {read(f"out/{name}").pixels.shape[1] for name in ("a.png", "b.v2.png")} == {31}


@encoder
def test_one_failure_does_not_stop_the_others_and_tells(tool, here):
    for name in ("a.png", "c.png", "d.png"):
        png(name)
    with open("b.png", "w") as file:
        file.write("no picture")
    os.mkdir("out")
    with open("out/c.pxi", "w") as file:
        file.write("old")
    names = ["a.png", "b.png", "missing.png", "c.png", "d.png"]
    ran = tool("encode", *TINY, *names, "-o", "out/", "--quiet", code=3, lines=3)
    for line, said in zip(ran.err.splitlines(), ("b.png", "missing.png", "out/c.pxi"), strict=True):
        assert line.startswith("pxi-encode: ")
        assert said in line
    assert sorted(os.listdir("out")) == [".pxi-batch", "a.pxi", "c.pxi", "d.pxi"]
    assert content("out/c.pxi") == b"old"


def test_the_first_failure_decides(tool, picture):
    picture("a.pxi"), picture("c.pxi")
    data = content("a.pxi")
    with open("b.pxi", "wb") as file:
        file.write(data[:-40])
    words = "decode", "a.pxi", "b.pxi", "c.pxi", "none.pxi", "-o", "out/", "--quiet"
    tool(*words, "-j", "1", code=4, lines=2)
    assert sorted(os.listdir("out")) == [".pxi-batch", "a.png", "c.png"]


@encoder
def test_an_error_that_names_no_file_gets_its_name(tool, here):
    png("a.png"), png("b.png")
    flags = ("--target-psnr", "99", "-e", "1", "--layers", "1", "-j", "1", "--quiet")
    ran = tool("encode", "a.png", "b.png", "-o", "out/", *flags, code=2, lines=2)
    assert [line.split(": ")[1] for line in ran.err.splitlines()] == ["a.png", "b.png"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("x/a.png", "y/a.png", "-o", "out/"), "x/a.png and y/a.png would both become out/a.pxi"),
        (("a.png", "a.jpg", "-o", "out/"), "a.png and a.jpg would both"),
        (("a.png", "./a.png", "-o", "out/"), "would both"),
        (("a.png", "b.png", "-o", "out.pxi"), "write -o out.pxi/"),
        (("a.png", "b.png", "c.pxi"), "-o FOLDER/"),
        (("a.png", "b.png", "c.png"), "-o FOLDER/"),
        (("-", "b.png", "-o", "out/"), "standard input"),
        (("a.png", "b.png", "-o", "out/", "--masks", "m"), "--masks"),
        (("a.png", ""), "empty"),
        (("", "c.pxi"), "empty"),
        (("a.png", "-o", ""), "empty"),
        (("a.png", "", "-o", "out/"), "empty"),
        (("a.png", "c.pxi", "--masks", ""), "empty"),
        (("a.png", "b.png", "-o", "out/", "-q", "101"), "quality"),
        (("-o", "out/"), "IN is missing"),
        ((), "IN is missing"),
    ],
)
@encoder
def test_refused_before_anything_is_written(tool, here, words, said):
    for folder in ("x", "y"):
        os.mkdir(folder)
        png(f"{folder}/a.png")
    png("a.png"), png("b.png"), png("c.png")
    shutil.copy("a.png", "a.jpg")
    before = sorted(os.listdir())
    assert said in tool("encode", "-f", "-e", "1", *words, code=2).err
    assert sorted(os.listdir()) == before


def test_outputs_in_the_folder_of_the_inputs_replace_none_of_them(tool, picture):
    for name in ("a.pxi", "b.png", "c.pxi"):
        picture(name)
    before = content("b.png")
    err = tool(
        "decode", "c.pxi", "b.png", "a.pxi", "-o", ".", "-f", "--quiet", "-j", "1", code=2
    ).err
    assert "b.png: input and output are the same file" in err
    assert content("b.png") == before
    assert {"a.png", "c.png"} < set(os.listdir())
    picture("c.png")
    assert "would both become" in tool("decode", "c.pxi", "c.png", "-o", ".", "-f", code=2).err
