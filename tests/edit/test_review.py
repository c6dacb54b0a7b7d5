"""What a critical stranger tried: extreme numbers, chains of textures, hostile histories."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.cli.edit import listing
from proxyimg_codec.container.undo import Step
from proxyimg_codec.edit.operations import HANDLES_MAX
from proxyimg_codec.errors import InputError, UsageError
from tests.support.images import changed


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


HUGE = (1.7e308, 10**400, math.inf)


@pytest.mark.parametrize("huge", HUGE, ids=("float", "int", "inf"))
@pytest.mark.parametrize(
    "values",
    [
        {"op": "move", "by": [None, 0]},
        {"op": "rotate", "degrees": None},
        {"op": "scale", "by": [1, None]},
        {"op": "scale", "by": [1, 1], "pivot": [None, None]},
        {"op": "affine", "matrix": [1, 0, 0, 1, None, 0]},
        {"op": "point", "path": 0, "point": 0, "by": [None, None]},
        {"op": "drag", "handles": [[None, None, None, None]]},
        {"op": "opacity", "value": None},
        {"op": "recolour", "saturation": None, "brightness": None},
        {"op": "recolour", "matrix": [None] * 12},
    ],
    ids=lambda v: "-".join(v),
)
def test_numbers_beyond_reason_are_refused_in_few_words(image, values, huge):
    def filled(value):
        if isinstance(value, list):
            return [filled(v) for v in value]
        return huge if value is None else value

    operation = {"layer": "disc", **{k: filled(v) for k, v in values.items()}}
    with pytest.raises(UsageError, match="it must be") as error:
        image.edited(operation)
    assert len(str(error.value)) < 250


def test_large_numbers_overflow_nowhere(image):
    """The largest that are allowed are refused for what they would do, or harmless."""
    for values in (
        {"op": "drag", "handles": [[1e12, 1e12, -1e12, 1e12], [0, 0, 1e12, 0]]},
        {"op": "affine", "matrix": [1e12, 1e12, -1e12, 1e12, 1e12, 1e12], "pivot": [1e12, 1e12]},
        {"op": "recolour", "hue": 1e12, "saturation": 1e12, "brightness": 1e12},
        {"op": "point", "path": 0, "point": 0, "by": [-1e12, 1e12]},
    ):
        with pytest.raises(UsageError, match=r"range|256 times"):
            image.edited({"layer": "disc", **values})


def test_drags_have_a_bounded_number_of_handles(image):
    handles = [[32, 24, 0, 0]] * (HANDLES_MAX + 1)
    with pytest.raises(UsageError, match=f"1 to {HANDLES_MAX}"):
        image.edited({"op": "drag", "layer": "disc", "handles": handles})


def test_numbers_of_numpy_are_numbers(image):
    disc = image.layers["disc"]
    by = np.array([3, -2])
    assert disc.moved(*by).to_bytes() == disc.moved(3, -2).to_bytes()
    assert disc.rotated(np.float32(0.5)).to_bytes() == disc.rotated(0.5).to_bytes()
    assert disc.reordered(np.int8(1)).to_bytes() == disc.reordered(1).to_bytes()
    matrix = np.array([[1, 0, 0, 1, 5, 5]], np.int16)[0]
    assert disc.transformed(matrix).to_bytes() == disc.transformed([1, 0, 0, 1, 5, 5]).to_bytes()


@pytest.mark.parametrize("source", ["a\0b", "\ud800", "", "x" * 5000, "/"])
def test_names_of_no_file(image, source):
    with pytest.raises((UsageError, InputError), match="edit 1: "):
        image.layers["disc"].textured(source)
    with pytest.raises(UsageError, match="source is"):
        image.edited({"op": "outlines", "source": "a\0b"})


def test_a_file_whose_name_is_not_unicode(image, small_pxi, tmp_path):
    path = str(tmp_path / "\udcff.pxi")
    try:
        with open(path, "wb") as file:
            file.write(small_pxi.read_bytes())
    except OSError:
        pytest.skip("this file system has names in Unicode alone")
    again = pxi.from_bytes(image.layers["disc"].textured(path, "bar").to_bytes())
    assert json.loads(again.history[0].operation)["source"] == path
    assert again.undone().to_bytes() == small_pxi.read_bytes()


def test_a_box_after_a_shape_is_as_if_the_shape_had_never_been(image):
    once = image.layers["disc"].textured("bar")
    twice = image.layers["disc"].textured("bar", fit="shape").layers["disc"].textured("bar")
    assert twice.baked().to_bytes() == once.baked().to_bytes()
    there = image.layers["disc"].textured("back", fit="shape").layers["disc"].textured("disc")
    assert there.layers["disc"].box == image.layers["disc"].box


@pytest.mark.parametrize("fit", ["box", "shape"])
def test_a_texture_is_what_its_source_shows(image, fit):
    """Taken from a layer that shows something else, fitted by shape, it looks like that layer."""
    fitted = image.layers["bar"].textured("back", fit="shape")
    both = fitted.layers["disc"].textured("bar", fit=fit)
    # The middle of a shape shows the middle of the other: back -> bar -> disc.
    seen = [
        image.render(dtype="float32", layers=["back"])[24, 32, :3],
        fitted.render(dtype="float32", layers=["bar"])[43, 32, :3],
        both.render(dtype="float32", layers=["disc"])[24, 32, :3],
    ]
    assert np.abs(seen[1] - seen[0]).max() < 0.03
    assert np.abs(seen[2] - seen[1]).max() < 0.05
    # And its own texture again changes nothing.
    same = fitted.layers["bar"].textured("bar", fit=fit)
    assert np.abs(same.render().astype(int) - fitted.render()).max() <= (0 if fit == "box" else 2)


def test_textures_at_nodes_fit_no_other_outline(image):
    node = image.layers["bar"]
    layers = [changed(v, sampling=3) if v == node else v for v in image.layers]
    sampled = changed(image, layers=type(image.layers)(layers))
    assert sampled.layers["disc"].textured("bar").layers["disc"].sampling == 3
    with pytest.raises(UsageError, match="box to box"):
        sampled.layers["disc"].textured("bar", fit="shape")


def test_a_network_is_brought_along_once(image, tmp_path):
    path = str(tmp_path / "other.pxi")
    network = image.networks[0]
    other = replace(network, weights=tuple(w[::-1].copy() for w in network.weights))
    changed(image, networks=(other,)).save(path)
    first = image.layers["disc"].textured(path, "bar")
    assert len(first.networks) == 2
    second = first.layers["bar"].textured(path, "bar")
    assert len(second.networks) == 2
    types = [c.type for c in second.baked().chunks]
    assert types.count("NETW") == 2
    shared = [c for c in second.chunks if c.type == "TEXR" and len(c.payload) < 20]
    assert len(shared) == 1
    assert len(second.layers["disc"].removed().networks) == 2
    assert len(second.layers["disc"].removed().layers["bar"].removed().networks) == 1
    image.save(path)
    assert len(image.layers["disc"].textured(path, "bar").networks) == 1


def test_layers_of_files_by_position(image, small_pxi):
    by_name = image.layers["disc"].textured(str(small_pxi), "bar")
    by_position = image.layers["disc"].textured(str(small_pxi), 1)
    assert by_position.baked().to_bytes() == by_name.baked().to_bytes()


def test_the_list_tells_what_is_covered_not_where_control_points_are(image):
    x0, y0, x1, y1 = listing(image.picture)["layers"][2]["bounds"]
    alone = image.render(layers=["disc"])[..., 3]
    rows, columns = np.flatnonzero(alone.any(1)), np.flatnonzero(alone.any(0))
    assert abs(x0 - columns[0]) <= 1
    assert abs(y0 - rows[0]) <= 1
    assert abs(x1 - columns[-1] - 1) <= 1
    assert abs(y1 - rows[-1] - 1) <= 1


@pytest.mark.parametrize("operation", ["no JSON", "[" * 100000, "\x1b[2J\x9b", '{"a": "\u202e"}'])
def test_histories_of_other_programs_are_listed_and_control_no_terminal(
    image, tool, tmp_path, operation
):
    moved = image.layers["disc"].moved(1, 1)
    path = tmp_path / "odd.pxi"
    changed(moved, history=(Step(operation, moved.history[0].chunks),)).save(path)
    for ran in (tool("edit", path, "--list"), tool("info", path)):
        line = next(v for v in ran.out.decode().split("\n") if v.startswith("edit 1: "))
        assert line.isprintable()
    facts = json.loads(tool("edit", path, "--list", "--json").out)
    assert len(facts["history"]) == 1
    assert pxi.open(path).undone().to_bytes() == image.to_bytes()


def test_words_of_the_command_line(tool, small_pxi, tmp_path):
    out = tmp_path / "out.pxi"
    tool("edit", small_pxi, out, "--move", "disc", "-.5,-3")
    assert pxi.open(out).layers["disc"].pose.shift == (-512, -3072)
    ran = tool("edit", small_pxi, tmp_path / "b.pxi", "--hide", "disc", "--hide", "cat", code=2)
    assert "edit 2: there is no layer 'cat'" in ran.err
    tool("edit", small_pxi, out, "--rename", "bar=a:b é", "--force")
    assert "a:b é" in tool("edit", out, "--list").out.decode().splitlines()[-1]
    for layer in ("a:b é", "1"):
        ran = tool("edit", small_pxi, "-", "--texture", f"disc={out}:{layer}", "--bake")
        want = pxi.open(small_pxi).layers["disc"].textured("bar").baked()
        np.testing.assert_array_equal(pxi.from_bytes(ran.out).render(), want.render())


def test_the_output_may_stand_after_the_edits(tool, small_pxi, tmp_path):
    out = tmp_path / "out.pxi"
    tool("edit", small_pxi, "--hide", "disc", out)
    tool("edit", "--hide", "bar", small_pxi, "-f", out)
    assert [v.pose.hidden for v in pxi.open(out).layers] == [False, True, False]
    tool("edit", small_pxi, out, out, "--hide", "bar", code=2)
    tool("edit", small_pxi, "--group", "both=bar,disc", tmp_path / "grouped.pxi")
    usage = " ".join(tool("edit", "--help").out.decode().split())
    assert "--group NAME=A,B,... put" in usage
    assert "--drag NAME [X,Y:DX,DY ...] bend" in usage
