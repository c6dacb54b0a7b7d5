"""pxi-layers, the flags of prompts in pxi-encode, and sheets."""

import json

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.io.png import encode_png
from proxyimg_codec.io.raster import read, write
from tests.support.maps import TREE, house

pytestmark = pytest.mark.usefixtures("plain_maps")
TINY = ("-e", "1", "-j", "1", "-q", "20")
HOUSE_AND_TREE = ("--point", "house=22,80", "--point", "house=40,52", "--point", "tree=100,50")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with the picture `photo.png`, where the test runs."""
    monkeypatch.chdir(tmp_path)
    write("photo.png", house())
    return tmp_path


def masks(folder="masks"):
    return load_masks(folder, 131, 97)


def layer_names(file):
    return [layer.name for layer in pxi.open(file).layers]


def test_masks_round_trip_to_the_same_layers_in_the_same_order(tool, here):
    ran = tool("layers", "photo.png", "-o", "masks/", *HOUSE_AND_TREE)
    assert "3 layers (back " in ran.err
    assert ran.out == b""
    tool("encode", "photo.png", "a.pxi", *TINY, "--masks", "masks")
    tool("encode", "photo.png", "b.pxi", *TINY, *HOUSE_AND_TREE)
    assert layer_names("a.pxi") == layer_names("b.pxi") == [r.name for r in masks()]
    assert (here / "a.pxi").read_bytes() == (here / "b.pxi").read_bytes()
    assert masks()[0].name == "back"
    assert {"house", "tree"} == {r.name for r in masks()[1:]}


def test_without_prompts_the_segmenter_is_asked(tool, here):
    tool("layers", "photo.png", "masks", "--segmenter", "regions", "--max-layers", "3", "--quiet")
    tool("encode", "photo.png", "a.pxi", *TINY, "--masks", "masks")
    tool("encode", "photo.png", "b.pxi", *TINY, "--segmenter", "regions", "--max-layers", "3")
    assert layer_names("a.pxi") == layer_names("b.pxi")
    assert (here / "a.pxi").read_bytes() == (here / "b.pxi").read_bytes()


def test_json_pipes_and_repetition(tool, here):
    words = ("layers", "-", "masks", "--box", "tree=80,15,42,80", "--not", "tree=5,5", "--json")
    ran = tool(*words, stdin=encode_png(house()))
    report = json.loads(ran.out)
    assert [v["name"] for v in report["layers"]] == ["back", "tree"]
    assert report["layers"][1]["share"] == pytest.approx(TREE.mean(), rel=0.05)
    before = (here / "masks" / "1 tree.png").read_bytes()
    assert "--force" in tool(*words, code=3, stdin=encode_png(house())).err
    tool(*words, "--force", stdin=encode_png(house()))
    assert (here / "masks" / "1 tree.png").read_bytes() == before


def test_one_layer_is_said(tool, here):
    write("plain.png", np.full((20, 30, 3), 90, np.uint8))
    ran = tool("layers", "plain.png", "masks", "--segmenter", "regions")
    assert "no object was found: one layer" in ran.err
    assert [f.name for f in (here / "masks").iterdir()] == ["0 back.png"]


def test_scribbles_and_refined_masks(tool, here):
    strokes = np.zeros((97, 131, 3), np.uint8)
    strokes[40:60, 98:102] = (0, 200, 0)
    write("strokes.png", strokes)
    tool("layers", "photo.png", "masks", "--scribble", "strokes.png")
    found = masks()
    assert [r.name for r in found] == ["back", "object 1"]
    rough = np.roll(found[1].mask, (3, -3), (0, 1))
    (here / "rough").mkdir()
    write("rough/1 tree.png", np.repeat(rough[..., None] * np.uint8(255), 3, 2))
    tool("layers", "photo.png", "better", "--masks", "rough", "--refine", "tree")
    better = masks("better")[1].mask
    assert (better & TREE).sum() / (better | TREE).sum() > 0.93
    kept = tool("layers", "photo.png", "kept", "--masks", "rough")
    assert (masks("kept")[1].mask == rough).all()
    assert "2 layers" in kept.err


def test_sheets_of_regions_and_of_files(tool, here):
    tool("layers", "photo.png", "--sheet", "a.png", *HOUSE_AND_TREE)
    assert not (here / "masks").exists()
    sheet = read("a.png").pixels
    assert sheet.shape[0] > 2 * 97
    tool("encode", "photo.png", "a.pxi", *TINY, *HOUSE_AND_TREE)
    tool("decode", "a.pxi", "--sheet", "b.png", "--quiet")
    assert not (here / "a.pxi.png").exists()
    assert read("b.png").pixels.shape == sheet.shape
    assert "--force" in tool("decode", "a.pxi", "--sheet", "b.png", code=3).err
    tool("decode", "a.pxi", "c.png", "--sheet", "d.png")
    assert read("c.png").pixels.shape[:2] == (97, 131)
    tool("decode", "a.pxi", "e.png", "--sheet", "e.png", code=2)


@pytest.mark.parametrize("name", ["layers", "encode"])
@pytest.mark.parametrize(
    ("flags", "code", "said"),
    [
        (["--point", "cat"], 2, "NAME=X,Y"),
        (["--point", "=3,4"], 2, "a name has"),
        (["--point", "cat=3"], 2, "NAME=X,Y"),
        (["--point", "cat=3,nan"], 2, "NAME=X,Y"),
        (["--box", "cat=1,2,3"], 2, "WIDTH,HEIGHT"),
        (["--box", "cat=1,2,3,4", "--box", "cat=1,2,3,4"], 2, "has a box already"),
        (["--point", "cat=131,5"], 3, "131,5"),
        (["--point", "cat=5,5", "--not", "cat=5,5"], 3, "inside and outside"),
        (["--point", "cat=5,5", "--point", "dog=5,5"], 3, "inside both"),
        (["--not", "cat=5,5"], 3, "nothing is said to be inside"),
        (["--box", "cat=500,5,9,9"], 3, "no pixel"),
        (["--refine", "cat"], 2, "--masks"),
        (["--prompter", "maps"], 2, "nothing is pointed at"),
        (["--point", "cat=5,5", "--prompter", "magic"], 2, "maps"),
        (["--point", "cat=5,5", "--max-layers", "3"], 2, "contradict"),
        (["--point", "cat=5,5", "--segmenter", "regions"], 2, "contradict"),
        (["--scribble", "none.png"], 3, "none.png"),
        (["--scribble", ""], 2, "empty"),
    ],
)
def test_bad_prompts_are_one_line(tool, here, name, flags, code, said):
    assert said in tool(name, "photo.png", "out.pxi", *flags, code=code).err
    assert not (here / "out.pxi").exists()


def test_outputs_replace_no_inputs(tool, here):
    tool("layers", "photo.png", "masks", *HOUSE_AND_TREE, "--quiet")
    force = ("--force", "--point", "a=5,5")
    tool("layers", "photo.png", "masks", *force, "--masks", "masks", code=2)
    tool("layers", "photo.png", "photo.png", *force, code=2)
    tool("layers", "photo.png", "--sheet", "photo.png", *force, code=2)
    assert "photo.png: was not written" in tool("layers", "photo.png", ".", *force, code=3).err
    assert (read("photo.png").pixels == house()).all()
    tool("layers", "photo.png", code=2)
    tool("layers", "photo.png", "-", code=2)
    tool("layers", "photo.png", "a", "b", code=2)
    write("b.png", house())
    said = tool("encode", "photo.png", "b.png", "-o", "x/", *force, code=2).err
    assert "--point: belongs to one picture" in said
