"""OpenRaster files: their parts, and that ordinary compositing of their layers is the picture."""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.export import openraster
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.io.raster import parse
from proxyimg_codec.model import Layers
from tests.support.images import changed, posed
from tests.support.pictures import smooth

pytest.importorskip("OpenImageIO")


@pytest.fixture(scope="module")
def image(small_pxi):
    return pxi.open(small_pxi)


def unzip(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def layers_of(data: bytes) -> list[tuple[dict[str, str], np.ndarray]]:
    """Attributes and pixels of each layer, front to back."""
    parts = unzip(data)
    root = ElementTree.fromstring(parts["stack.xml"])
    assert [child.tag for child in root] == ["stack"]
    return [(dict(e.attrib), parse(parts[e.get("src")], "a.png").pixels) for e in root[0]]


def composited(data: bytes, width: int, height: int) -> np.ndarray:
    """Source-over of all visible layers, float64 [H, W, 4] premultiplied in 0..1."""
    out = np.zeros((height, width, 4))
    for attributes, pixels in reversed(layers_of(data)):
        if attributes["visibility"] == "hidden":
            continue
        values = pixels / np.iinfo(pixels.dtype).max
        if values.shape[2] == 3:
            values = np.dstack([values, np.ones(values.shape[:2])])
        values[..., :3] *= values[..., 3:]
        values *= float(attributes["opacity"])
        x, y = int(attributes["x"]), int(attributes["y"])
        part = out[y : y + values.shape[0], x : x + values.shape[1]]
        part[:] = values + part * (1 - values[..., 3:])
    return out


def premultiplied(pixels: np.ndarray) -> np.ndarray:
    values = pixels.astype(float)
    if values.shape[2] == 3:
        values = np.dstack([values, np.full(values.shape[:2], 255.0)])
    values[..., :3] *= values[..., 3:] / 255
    return values / 255


def test_parts_as_the_specification_wants_them(image):
    data = openraster.build(image)
    assert data[30:].startswith(b"mimetypeimage/openraster")
    parts = unzip(data)
    assert next(iter(parts)) == "mimetype"
    root = ElementTree.fromstring(parts["stack.xml"])
    assert (root.tag, root.get("w"), root.get("h")) == ("image", "64", "48")
    sources = [e.get("src") for e in root.iter("layer")]
    assert sources == ["data/layer2.png", "data/layer1.png", "data/layer0.png"]
    rest = {"mimetype", "stack.xml", "mergedimage.png", "Thumbnails/thumbnail.png"}
    assert set(parts) == {*sources, *rest}
    assert (parse(parts["mergedimage.png"], "a.png").pixels == image.render()).all()
    assert parts["Thumbnails/thumbnail.png"] == parts["mergedimage.png"]


def test_layers_stand_front_to_back_with_names_and_cropped(image):
    layers = layers_of(openraster.build(image))
    assert [a["name"] for a, _ in layers] == ["disc", "bar", "back"]
    for attributes, pixels in layers[:2]:
        alpha = pixels[..., 3] > 0
        assert all(edge.any() for edge in (alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]))
        x, y = int(attributes["x"]), int(attributes["y"])
        full = np.zeros((48, 64, 4), np.uint8)
        full[y : y + pixels.shape[0], x : x + pixels.shape[1]] = pixels
        assert (full == image.render(layers=[attributes["name"]])).all()


def test_what_is_hidden_is_there(image):
    attributes, pixels = layers_of(openraster.build(image))[-1]
    assert (attributes["x"], attributes["y"]) == ("0", "0")
    assert (pixels == image.render(layers=["back"])).all()


def test_source_over_gives_the_picture(image):
    for picture in (image, posed(image, bar={"opacity": 20000}, disc={"hidden": True})):
        got = composited(openraster.build(picture), 64, 48)
        assert np.abs(got - premultiplied(picture.render())).max() < 1.5 / 255
        deep = composited(openraster.build(picture, dtype=np.uint16), 64, 48)
        exact = picture.render(dtype=np.float32)
        assert np.abs(deep[..., :3] - exact[..., :3]).max() < 2e-4


def test_source_over_gives_a_picture_with_soft_alpha():
    y, x = np.mgrid[0:48, 0:48]
    alpha = np.clip(255 - 9 * np.hypot(x - 24, y - 24), 0, 255).astype(np.uint8)
    image = pxi.encode(np.dstack([smooth(48, 48), alpha]), effort=1, jobs=1)
    got = composited(openraster.build(image), 48, 48)
    assert np.abs(got - premultiplied(image.render())).max() < 1.5 / 255


def test_opacity_and_visibility_are_attributes(image):
    plain = layers_of(openraster.build(image))
    changed_image = posed(image, bar={"opacity": 32768}, disc={"hidden": True})
    other = layers_of(openraster.build(changed_image))
    seen = {a["name"]: (a["opacity"], a["visibility"]) for a, _ in other}
    assert seen["back"] == ("1", "visible")
    assert seen["disc"] == ("1", "hidden")
    assert round(float(seen["bar"][0]) * 65535) == 32768
    assert all((a == b).all() for (_, a), (_, b) in zip(plain, other, strict=True))


def test_nothing_visible_is_an_empty_picture(image):
    hidden = posed(image, **{n: {"hidden": True} for n in ("bar", "disc")})
    parts = unzip(openraster.build(hidden, layers=["bar", "disc"]))
    assert not parse(parts["mergedimage.png"], "a.png").pixels.any()
    assert parse(parts["mergedimage.png"], "a.png").pixels.shape == (48, 64, 4)


@pytest.mark.parametrize(("shift", "size"), [(0, None), (-20, None), (500, (1, 1))])
def test_layers_that_leave_the_canvas_are_clipped(image, shift, size):
    bar = image.layers["bar"]
    paths = tuple(p + np.array([shift << bar.boundary.unit, 0]) for p in bar.boundary.paths)
    moved = changed(bar, boundary=Boundary(bar.boundary.unit, paths))
    away = changed(image, layers=Layers([image.layers["back"], moved]))
    data = openraster.build(away)
    attributes, pixels = layers_of(data)[0]
    assert 0 <= int(attributes["x"]) < 64
    assert size is None or pixels.shape[1::-1] == size
    assert np.abs(composited(data, 64, 48) - premultiplied(away.render())).max() < 1.5 / 255


def test_thumbnails_are_reduced_but_not_enlarged(image, monkeypatch):
    monkeypatch.setattr(openraster, "THUMBNAIL_SIDE", 16)
    pixels = parse(unzip(openraster.build(image))["Thumbnails/thumbnail.png"], "a.png").pixels
    assert pixels.shape == (12, 16, 3)
    assert (pixels == image.render(width=16, height=12)).all()


def test_some_layers_only(image):
    layers = layers_of(openraster.build(image, layers=["bar", 2], background=False))
    assert [a["name"] for a, _ in layers] == ["disc", "bar"]
    assert len(layers_of(openraster.build(image, background=False))) == 2
    with pytest.raises(pxi.UsageError, match="cat"):
        openraster.build(image, layers=["cat"])


def test_names_are_safe_in_xml(image):
    layers = [changed(v, name=n) for v, n in zip(image.layers, NAMES, strict=True)]
    data = openraster.build(changed(image, layers=Layers(layers)))
    got = [a["name"] for a, _ in layers_of(data)][::-1]
    assert got == ['<a href="x">&amp;', "Bär\n猫", "\ufffd bell"]


NAMES = ('<a href="x">&amp;', "Bär\n猫", "\x07 bell")


def test_colour_profiles_go_with_every_picture(image):
    profile = bytes(range(256)) * 2
    parts = unzip(openraster.build(changed(image, blocks={"icc": profile, "xmp": b"<x/>"})))
    assert all(b"iCCP" in v for k, v in parts.items() if k.endswith(".png"))
    assert not any(b"<x/>" in v for v in parts.values())
    parts = unzip(openraster.build(changed(image, blocks={"cicp": bytes([12, 13, 0, 1])})))
    assert all(b"cICP\x0c\x0d\0\1" in v for k, v in parts.items() if k.endswith(".png"))


def test_the_same_bytes_every_time(image):
    data = openraster.build(image)
    assert data == openraster.build(image)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_floating_point_is_refused(image):
    with pytest.raises(pxi.UsageError, match="floating point"):
        openraster.build(image, dtype=np.float32)


def test_progress_counts_layers(image):
    seen = []
    openraster.build(image, progress=seen.append)
    assert seen == [1, 1, 1]


# The command


def test_the_suffix_writes_layers(tool, small_pxi, image, tmp_path):
    out = tmp_path / "a.ora"
    assert str(out) in tool("decode", small_pxi, out).err
    assert out.read_bytes() == openraster.build(image)
    assert "--force" in tool("decode", small_pxi, out, code=3).err
    flags = ("--force", "--quiet", "--layer", "bar", "--layer", 0, "--no-background")
    assert tool("decode", small_pxi, out, *flags, "--bit-depth", "16").err == ""
    assert out.read_bytes() == openraster.build(image, layers=["bar"], dtype=np.uint16)


@pytest.mark.parametrize(
    "flags",
    [("--scale", "2"), ("--width", "9"), ("--height", "9"), ("--region", "0,0,9,9"),
     ("--bit-depth", "32"), ("--layer", "cat"), ("--layer", "0", "--no-background")],
    ids=" ".join,
)  # fmt: skip
def test_flags_that_make_no_sense(tool, small_pxi, tmp_path, flags):
    tool("decode", small_pxi, tmp_path / "a.ora", *flags, code=2)
    assert not list(tmp_path.iterdir())
