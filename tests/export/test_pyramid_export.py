"""Exports and descriptions of pictures of pyramid textures."""

import io
import json
import re
import zipfile

import numpy as np
import pytest

from proxyimg_codec.export import openraster, svg
from proxyimg_codec.io.raster import parse
from tests.support.pyramids import cut_picture, implicit, picture, planes


def layers_of(data):
    """Pixels of each layer by its place from the back, and of the thumbnail."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {n: parse(archive.read(n), n).pixels for n in archive.namelist() if ".png" in n}


def test_openraster_has_each_layer(pyramid):
    pytest.importorskip("OpenImageIO")
    parts = layers_of(openraster.build(pyramid))
    np.testing.assert_array_equal(parts["data/layer0.png"], pyramid.render(layers=["back"]))
    disc = pyramid.render(layers=["disc"])
    rows, columns = (np.flatnonzero(disc[..., 3].any(k)) for k in (1, 0))
    crop = disc[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    np.testing.assert_array_equal(parts["data/layer2.png"], crop)
    np.testing.assert_array_equal(parts["mergedimage.png"], pyramid.render())
    np.testing.assert_array_equal(parts["Thumbnails/thumbnail.png"], pyramid.render())


def test_svg_has_the_mean_colours(pyramid):
    fills = re.findall('fill="#(..)(..)(..)"', svg.build(pyramid).decode())
    assert len(fills) == 3
    disc = pyramid.render(layers=["disc"], dtype=np.float32)
    mean = (disc[..., :3] * disc[..., 3:]).sum((0, 1)) / disc[..., 3].sum()
    got = [int(v, 16) for v in fills[2]]
    assert np.abs(np.array(got) - 255 * mean).max() < 1


def test_info_tells_planes_and_views(tool, made_up_planes, tmp_path):
    picture(planes("colour"), planes("soft", components=1)).save(tmp_path / "a.pxi")
    facts = json.loads(tool("info", tmp_path / "a.pxi", "--json").out)
    assert facts["networks"] == []
    assert [p["components"] for p in facts["planes"]] == [3, 1]
    assert facts["planes"][0] | {"bytes": 0} == {
        "model": 0, "size": [64, 48], "components": 3, "levels": 1, "q": 1.0, "bytes": 0,
    }  # fmt: skip
    assert [p["bytes"] for p in facts["planes"]] == [len("colour"), len("soft")]
    back, bar, disc = facts["layers"]
    assert (disc["coder"], disc["planes"], disc["alpha"]) == ("pyramid", 0, 1)
    assert disc["part"] == [16, 9, 31, 30]
    assert disc["grid"] is disc["network"] is disc["bits"] is None
    assert back["texture_bytes"] > bar["texture_bytes"] == 0
    text = tool("info", tmp_path / "a.pxi").out.decode()
    assert "pyramid 31x30 samples at 16,9 of planes 0 with alpha of planes 1" in text
    assert "planes 0: 64x48 RGB samples, 1 levels, step 1, model 0, 6 bytes" in text
    assert "planes 1: 64x48 grey samples" in text


def test_info_tells_cuts(tool, made_up_planes, tmp_path):
    cut_picture().save(tmp_path / "a.pxi")
    facts = json.loads(tool("info", tmp_path / "a.pxi", "--json").out)
    assert [v["cuts"] for v in facts["layers"]] == [[1, 2], [1, 2], [2]]
    back, bar, disc = tool("info", tmp_path / "a.pxi").out.decode().splitlines()[2:5]
    assert back.endswith("of planes 0 cut by layers 1, 2, 0 bytes")
    assert " of planes 0 cut by layers 1, 2, " in bar
    assert " of planes 0 cut by layer 2, " in disc
    picture().save(tmp_path / "b.pxi")
    facts = json.loads(tool("info", tmp_path / "b.pxi", "--json").out)
    assert [v["cuts"] for v in facts["layers"]] == [[], [], []]
    assert "cut by" not in tool("info", tmp_path / "b.pxi").out.decode()


def test_steps_are_told_as_numbers(tool, pyramid, tmp_path):
    source = pyramid.layers[0].texture.planes
    source.packed["step"] = 5 * 64 + 32
    pyramid.save(tmp_path / "a.pxi")
    facts = json.loads(tool("info", tmp_path / "a.pxi", "--json").out)
    assert facts["planes"][0]["q"] == pytest.approx(45.255)


def test_implicit_layers_have_no_planes(tool, tmp_path):
    implicit().save(tmp_path / "a.pxi")
    facts = json.loads(tool("info", tmp_path / "a.pxi", "--json").out)
    assert facts["planes"] == []
    assert {(v["planes"], v["alpha"], v["part"]) for v in facts["layers"]} == {(None,) * 3}


def test_decoding_and_editing_from_the_command_line(tool, pyramid, tmp_path):
    pyramid.save(tmp_path / "a.pxi")
    tool("decode", tmp_path / "a.pxi", tmp_path / "a.npy", "--bit-depth", 32, "--quiet")
    np.testing.assert_allclose(np.load(tmp_path / "a.npy"), planes("colour").raster, atol=1e-6)
    tool("edit", tmp_path / "a.pxi", tmp_path / "b.pxi", "--move", "disc", "5,-3")
    tool("decode", tmp_path / "b.pxi", tmp_path / "b.npy", "--layer", "disc", "--quiet")
    moved = pyramid.layers["disc"].moved(5, -3).render(layers=["disc"])
    np.testing.assert_array_equal(np.load(tmp_path / "b.npy"), moved)
