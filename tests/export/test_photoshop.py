"""Photoshop files: what others read in them is the picture, layer by layer."""

import io

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.layered.photoshop import read_photoshop
from proxyimg_codec.export import photoshop
from tests.support.images import changed, posed
from tests.support.pictures import icc

psd_tools = pytest.importorskip("psd_tools")
pytest.importorskip("OpenImageIO")


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


def written(image, **options):
    return psd_tools.PSDImage.open(io.BytesIO(photoshop.build(image, **options)))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_layers_are_read_as_they_are_drawn(image, dtype):
    posed_image = posed(image, bar={"opacity": 32768}, disc={"hidden": True})
    file = written(posed_image, dtype=dtype)
    assert (file.size, file.depth) == ((64, 48), 8 * np.dtype(dtype).itemsize)
    assert [layer.name for layer in file] == ["back", "bar", "disc"]
    assert [(layer.opacity, layer.visible) for layer in file] == [
        (255, True), (128, True), (255, False)]  # fmt: skip
    for layer in file:
        x, y, right, bottom = layer.bbox
        wanted = image.render(layers=[layer.name], dtype=dtype)[y:bottom, x:right]
        got = np.rint(layer.numpy() * np.iinfo(dtype).max)
        np.testing.assert_array_equal(got[..., : wanted.shape[2]], wanted)
        outside = image.render(layers=[layer.name]).copy()
        outside[y:bottom, x:right] = 0
        assert layer.name == "back" or not outside[..., 3].any()


def test_the_flat_picture_in_it_is_the_rendered_one(image):
    faint = posed(image, bar={"opacity": 32768})
    flat = np.asarray(written(faint).topil())
    assert np.abs(flat.astype(int) - faint.render()).max() <= 1
    clear = np.asarray(written(image, background=False).topil())
    assert (clear[0, 0] == 255).all()


def test_it_comes_back_with_its_colours(image):
    blocks = {"icc": icc()}
    data = photoshop.build(changed(image, blocks=blocks))
    again = read_photoshop(data, "again.psd")
    assert again.blocks == blocks
    assert [v.name for v in again.layers] == ["back", "bar", "disc"]
    cicp = changed(image, blocks={"cicp": bytes([9, 16, 0, 1])})  # BT.2020, PQ
    converted = written(cicp, layers=["back"])[0].numpy()[..., :3]
    assert np.abs(converted - image.render(layers=["back"]) / 255).max() > 0.1
    assert not read_photoshop(photoshop.build(cicp), "again.psd").blocks


def test_names_of_any_kind(image):
    odd = image.layers["back"].renamed("Vögel 🦜").layers["disc"].renamed("x" * 200)
    assert [layer.name for layer in written(odd)] == ["Vögel 🦜", "bar", "x" * 200]


def test_without_psd_tools(image, monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(photoshop, "import_module", missing)
    with pytest.raises(pxi.UnsupportedError, match=r"proxyimg-codec\[psd\]"):
        photoshop.build(image)


def test_the_tool_writes_it(small_pxi, tmp_path, tool):
    tool("decode", small_pxi, tmp_path / "a.psd", "--no-background", "--quiet")
    file = psd_tools.PSDImage.open(tmp_path / "a.psd")
    assert [layer.name for layer in file] == ["bar", "disc"]
    said = tool("decode", small_pxi, tmp_path / "b.psd", "--width", "9", code=2).err
    assert ".psd file has the size of the canvas" in said
