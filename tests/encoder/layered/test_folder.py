"""Folders of pictures as layers."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.layered.folder import read_folder
from proxyimg_codec.io import raster
from proxyimg_codec.io.png import encode_png
from proxyimg_codec.limits import Limits
from tests.encoder.test_import_layers import H, W, ball
from tests.support.pictures import icc, smooth


@pytest.fixture
def folder(tmp_path):
    """A back, ten layers of which two are in groups, and what is no layer."""
    place = tmp_path / "parts"
    (place / "3 eyes" / "iris").mkdir(parents=True)
    (place / "empty").mkdir()
    (place / ".hidden.png").write_bytes(b"no picture")
    (place / "notes.txt").write_text("no picture")
    write(place / "background.png", smooth(W, H))
    write(place / "2 nose.png", ball(20, 20, 9))
    write(place / "10 hat.webp", ball(40, 20, 9))
    write(place / "3 eyes" / "b.png", ball(30, 24, 5))
    write(place / "3 eyes" / "iris" / "a.tif", ball(34, 24, 3).astype(np.uint16) * 257)
    return place


def write(path, pixels):
    raster.write(path, pixels)


def test_names_order_and_groups(folder):
    picture = read_folder(folder)
    assert (picture.width, picture.height) == (W, H)
    assert [(v.name, v.groups) for v in picture.layers] == [
        ("background", ()), ("nose", ()), ("b", ("eyes",)), ("a", ("eyes", "iris")), ("hat", ()),
    ]  # fmt: skip
    np.testing.assert_array_equal(picture.layers[0].pixels, smooth(W, H))
    np.testing.assert_array_equal(picture.layers[1].pixels, ball(20, 20, 9))
    assert picture.layers[3].pixels.dtype == np.uint16


def test_colours_are_carried_or_converted(folder):
    (folder / "background.png").write_bytes(encode_png(smooth(W, H), {"icc": icc()}))
    with pytest.raises(pxi.UnsupportedError, match=r"nose.png: its colour profile"):
        read_folder(folder)
    (folder / "2 nose.png").write_bytes(encode_png(ball(20, 20, 9), {"icc": icc()}))
    (folder / "10 hat.webp").unlink()
    for file in (folder / "3 eyes").rglob("*.*"):
        file.unlink()
    assert read_folder(folder).blocks == {"icc": icc()}


def test_clear_pictures_are_left_out_and_named(folder):
    write(folder / "20 air.png", np.zeros((H, W, 4), np.uint8))
    assert read_folder(folder).left_out == ("air",)


def test_pictures_in_floating_point(folder):
    np.save(folder / "30 x.npy", ball(9, 9, 4).astype(np.float32) / 255)
    found = read_folder(folder).layers[-1].pixels
    np.testing.assert_array_equal(found, ball(9, 9, 4).astype(np.uint16) * 257)
    np.save(folder / "30 x.npy", np.full((H, W, 3), 1.5, np.float32))
    with pytest.raises(pxi.InputError, match=r"30 x.npy: .*0\.\.1"):
        read_folder(folder)


def test_refusals(folder, tmp_path):
    write(folder / "30 x.png", smooth(W + 1, H))
    with pytest.raises(pxi.InputError, match=r"30 x.png: is 65x48, but .* 64x48"):
        read_folder(folder)
    (folder / "30 x.png").write_bytes(b"no picture")
    with pytest.raises(pxi.InputError, match=r"30 x\.png"):
        read_folder(folder)
    with pytest.raises(pxi.InputError, match="holds no picture"):
        read_folder(folder / "empty")
    with pytest.raises(pxi.InputError, match="cannot be read"):
        read_folder(tmp_path / "none")
    (folder / "30 x.png").unlink()
    for name, limit in (("layers", 4), ("output_pixels", W * H - 1), ("output_pixels", 3 * W * H)):
        with pytest.raises(pxi.LimitError, match=name.replace("_", " ")):
            read_folder(folder, Limits(**{name: limit}))


def test_the_flag(tool, folder, tmp_path):
    ran = tool("encode", "--stack", f"{folder}/", "-e", "1", "-j", "1")
    assert "5 layers (background, nose, b, a, hat)" in ran.err
    image = pxi.open(tmp_path / "parts.pxi")
    assert dict(image.groups) == {"eyes": None, "iris": "eyes"}
    assert image.depth == 16
    (tmp_path / "parts.pxi").unlink()
    assert "--stack" in tool("encode", folder, code=3).err
    assert "folder" in tool("encode", "--stack", folder / "10 hat.webp", code=2).err
    assert "--masks" in tool("encode", "--stack", folder, "--masks", folder, code=2).err


def test_layers_are_not_overwritten(tool, folder, tmp_path):
    place = folder / "2 nose.png"
    link = tmp_path / "x.pxi"
    link.symlink_to(place)
    before = place.read_bytes()
    assert "same file" in tool("encode", "--stack", folder, link, "--force", code=2).err
    assert place.read_bytes() == before
