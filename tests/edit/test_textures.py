"""Textures of other layers and of picture files, encoded by the pyramid coder."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.errors import UsageError
from proxyimg_codec.io import raster
from proxyimg_codec.texture.pyramid import PyramidTexture
from tests.support.images import changed

ROWS, COLUMNS = 75, 101
GREY, RED, BLUE = (118, 122, 120), (200, 40, 30), (20, 60, 190)


def disc(x, y, radius):
    """bool [75, 101], True within a disc."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS] + 0.5
    return np.hypot(columns - x, rows - y) < radius


@pytest.fixture(scope="module")
def discs():
    """A grey picture with a red and a blue disc."""
    pixels = np.full((ROWS, COLUMNS, 3), GREY, np.uint8)
    masks = {"red": disc(27, 37, 20), "blue": disc(74, 37, 20)}
    pixels[masks["red"]], pixels[masks["blue"]] = RED, BLUE
    return pxi.encode(pixels, masks=masks, effort=1, quality=70)


def written(path, pixels):
    raster.write(path, pixels)
    return str(path)


def test_the_outline_of_the_source_does_not_come_along(discs):
    """A disc's texture on the whole canvas is red everywhere, though its raster is not."""
    changed = discs.layers["back"].textured("red")
    shown = pxi.from_bytes(changed.to_bytes()).render(layers=["back"]).astype(int)
    assert np.abs(shown - RED).max() <= 12
    whole = discs.layers["back"].texture.planes.raster * 255
    assert np.abs(whole - RED).max() > 80


def test_a_picture_that_is_clear_outside_leaves_no_outline_either(discs, tmp_path):
    inside = disc(50, 37, 30)
    pixels = np.zeros((ROWS, COLUMNS, 4), np.uint8)
    pixels[inside] = (*BLUE, 255)
    changed = discs.layers["back"].textured(written(tmp_path / "ball.png", pixels))
    shown = changed.render(layers=["back"]).astype(int)
    assert shown.shape[2] == 3
    assert np.abs(shown - BLUE).max() <= 12


def test_a_picture_file_is_a_pyramid_of_little_effort(discs, tmp_path):
    rng = np.random.default_rng(3)
    coarse = rng.uniform(0, 255, (10, 13, 3)).repeat(8, 0).repeat(8, 1)[:ROWS, :COLUMNS]
    path = written(tmp_path / "noise.png", coarse.astype(np.uint8))
    layer = discs.layers["red"]
    sources = {e: layer.textured(path, effort=e).layers["red"].texture.planes for e in (None, 1)}
    for effort, planes in sources.items():
        want = pxi.encode(raster.read(path).pixels, max_layers=1, effort=effort or 2)
        assert planes.packed == want.layers[0].texture.planes.packed
    assert sources[None].packed != sources[1].packed
    with pytest.raises(UsageError, match=r"effort.*1\.\.9"):
        layer.textured(path, effort=10)


def test_into_a_file_of_implicit_textures(small_pxi, tmp_path):
    pixels = np.full((50, 41, 3), GREY, np.uint8)
    pixels[:, 20:] = RED
    image = pxi.open(small_pxi)
    textured = image.layers["disc"].textured(written(tmp_path / "two.png", pixels))
    again = pxi.from_bytes(textured.baked().to_bytes())
    assert isinstance(again.layers["disc"].texture, PyramidTexture)
    np.testing.assert_array_equal(again.render(), textured.render())
    alone = changed(again.layers["disc"], boundary=None)
    x, y, width, height = again.layers["disc"].box
    colours = alone.texture.sample(
        np.array([x + 0.1 * width, x + 0.9 * width]), np.full(2, y + 0.5 * height), alone.box
    )
    np.testing.assert_allclose(colours * 255, [GREY, RED], atol=12)


def test_the_flag_for_effort(tool, discs, tmp_path):
    discs.save(tmp_path / "in.pxi")
    noise = np.random.default_rng(1).integers(0, 255, (40, 40, 3), np.uint8)
    path = written(tmp_path / "noise.png", noise)
    files = tmp_path / "in.pxi", tmp_path / "out.pxi"
    tool("edit", *files, "--texture", f"red={path}", "-e", "1")
    want = discs.layers["red"].textured(path, effort=1)
    assert pxi.open(files[1]).baked().to_bytes() == want.baked().to_bytes()
    out = tool("edit", *files, "--texture", f"red={path}", "-e", "0", "--force", code=2)
    assert "--effort 0" in out.err
