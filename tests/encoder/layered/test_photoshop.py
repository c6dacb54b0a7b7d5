"""Photoshop files as layers: what becomes of them, and what is refused."""

import contextlib
import copy
import io
import struct

import numpy as np
import pytest
from PIL import Image as Pillow

import proxyimg_codec as pxi
from proxyimg_codec.encoder.import_layers import composite
from proxyimg_codec.encoder.layered import photoshop
from proxyimg_codec.encoder.layered.photoshop import is_photoshop, read_photoshop
from proxyimg_codec.limits import Limits
from tests.encoder.test_import_layers import H, W, ball
from tests.support.pictures import icc, smooth

psd_tools = pytest.importorskip("psd_tools")
from psd_tools.constants import BlendMode, Resource, Tag  # noqa: E402

BACK = smooth(W, H)
BALL, TOP = ball(30.3, 24, 15), ball(44, 20, 9, (20, 220, 250))


class Document:
    """A Photoshop file that is being made, layer by layer, back to front."""

    def __init__(self, mode="RGB", depth=8):
        self.psd = psd_tools.PSDImage.new(mode, (W, H), depth=depth)

    def layer(self, name, pixels, into=None, *, opacity=255, mode="NORMAL", at=(0, 0), clip=False):
        made = (self.psd if into is None else into).create_pixel_layer_from_array(
            pixels, name=name, left=at[0], top=at[1], opacity=opacity, blend_mode=BlendMode[mode]
        )
        if clip:
            made.clipping = True
        return made

    def group(self, name, into=None, *, opacity=255, mode="PASS_THROUGH"):
        return (self.psd if into is None else into).create_group(
            name=name, opacity=opacity, blend_mode=BlendMode[mode]
        )

    def adjustment(self, name, tag):
        """An adjustment layer whose settings are those that no bytes mean."""
        made = self.layer(name, np.zeros((1, 1, 4), np.uint8))
        made.tagged_blocks.set_data(tag)
        return made

    def data(self) -> bytes:
        file = io.BytesIO()
        self.psd.save(file)
        return file.getvalue()

    def read(self, **options):
        return read_photoshop(self.data(), "in.psd", **options)


def looks_as_psd_tools_says(document: Document, picture, most=1.9) -> None:
    """Up to rounding, once in each layer, and to the next level below by psd-tools."""
    drawn = psd_tools.PSDImage.open(io.BytesIO(document.data())).composite(force=True)
    want = np.asarray(drawn.convert("RGBA")).astype(float) / 255
    got = composite(picture)
    for pixels in (want, got):
        pixels[..., :3] *= pixels[..., 3:]
    assert np.abs(got - want).max() <= most / 255


def test_layers_are_kept():
    d = Document()
    d.layer("back", BACK)
    outer = d.group("out", opacity=204)
    inner = d.group("in", outer)
    d.layer("ball", BALL[5:43, 12:50], inner, at=(12, 5), opacity=128)
    d.layer("off", TOP, inner).visible = False
    d.layer("edge", TOP[10:30, 30:60], at=(50, -5))
    d.layer("clear", np.zeros((5, 5, 4), np.uint8))
    picture = d.read()
    assert (picture.width, picture.height) == (W, H)
    back, low, off, edge = picture.layers
    assert [v.name for v in picture.layers] == ["back", "ball", "off", "edge"]
    np.testing.assert_array_equal(back.pixels, BACK)
    np.testing.assert_array_equal(low.pixels[..., 3], BALL[5:43, 12:50, 3])
    seen = low.pixels[..., 3] > 0
    np.testing.assert_array_equal(low.pixels[seen], BALL[5:43, 12:50][seen])
    assert (low.x, low.y, low.groups) == (12, 5, ("out", "in"))
    assert low.opacity == pytest.approx(128 / 255 * 0.8)
    assert [v.hidden for v in picture.layers] == [False, False, True, False]
    np.testing.assert_array_equal(off.pixels[..., 3], TOP[..., 3])
    assert (edge.x, edge.y, edge.pixels.shape[:2]) == (50, 0, (15, 14))
    assert (picture.left_out, picture.notes) == (("clear",), ())


@pytest.mark.parametrize(
    ("mode", "channels", "depth"),
    [("RGB", 3, 8), ("RGB", 3, 16), ("L", 1, 8), ("L", 1, 16)],
)
def test_colours_and_depths(mode, channels, depth):
    dtype = np.uint8 if depth == 8 else np.uint16
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, np.iinfo(dtype).max, (H, W, channels + 1), dtype, endpoint=True)
    pixels[..., -1] |= 1
    d = Document(mode, depth)
    d.layer("opaque", pixels[..., :-1])
    d.layer("a", pixels)
    got = d.read().layers
    assert [v.pixels.dtype for v in got] == [dtype, dtype]
    np.testing.assert_array_equal(got[0].pixels, pixels[..., :-1])
    np.testing.assert_array_equal(got[1].pixels, pixels)


def test_profiles_and_metadata_are_carried():
    d = Document()
    d.layer("a", BACK)
    d.layer("b", BALL)
    for kind, data in (("ICC_PROFILE", icc()), ("XMP_METADATA", b"<x:xmpmeta/>")):
        d.psd.image_resources[Resource[kind]] = psd_tools.psd.image_resources.ImageResource(
            key=Resource[kind], data=data
        )
    assert d.read().blocks == {"icc": icc(), "xmp": b"<x:xmpmeta/>"}


def test_masks_become_alpha():
    mask = np.rint(np.linspace(0, 255, W)[None] * np.ones((H, 1))).astype(np.uint8)
    d = Document()
    d.layer("back", BACK)
    d.layer("a", BALL).create_mask(Pillow.fromarray(mask))
    group = d.group("g")
    d.layer("b", TOP, group)
    # The end of a new group shares its channels, so that a mask would become one of the end, too.
    group._bounding_channels = copy.copy(group._channels)
    group._bounding_channels._items = list(group._channels)
    group.create_mask(Pillow.fromarray(mask[:, ::-1].copy()), top=0, left=0)
    d.layer("c", TOP).create_mask(Pillow.fromarray(mask)).disabled = True
    picture = d.read()
    for layer, source, share in zip(
        picture.layers[1:], (BALL, TOP, TOP), (mask, mask[:, ::-1], np.full_like(mask, 255)),
        strict=True,
    ):  # fmt: skip
        want = source[..., 3] / 255.0 * share
        got = np.zeros((H, W))
        h, w = layer.pixels.shape[:2]
        got[layer.y : layer.y + h, layer.x : layer.x + w] = layer.pixels[..., 3]
        assert np.abs(got - want).max() <= 0.51, layer.name
    looks_as_psd_tools_says(d, picture)


def test_clipped_layers_stay_layers():
    d = Document()
    d.layer("back", BACK)
    d.layer("base", BALL)
    d.layer("spot", TOP, clip=True, opacity=200)
    d.layer("off", TOP, clip=True).visible = False
    d.layer("front", TOP[:20], at=(0, 20))
    picture = d.read()
    assert [v.name for v in picture.layers] == ["back", "base", "spot", "off", "front"]
    spot = picture.layers[2]
    assert spot.opacity == pytest.approx(200 / 255)
    np.testing.assert_allclose(spot.pixels[..., 3], TOP[..., 3] / 255.0 * BALL[..., 3], atol=0.51)
    # Only in the base's translucent rim, where its share counts twice, it looks different.
    rim = (BALL[..., 3] > 0) & (BALL[..., 3] < 255)
    drawn = psd_tools.PSDImage.open(io.BytesIO(d.data())).composite(force=True).convert("RGB")
    error = np.abs(composite(picture)[..., :3] - np.asarray(drawn) / 255.0).max(2) * 255
    assert error[~rim].max() <= 1.1
    assert error.max() < 70


@pytest.mark.parametrize(
    ("base", "clip"),
    [({"opacity": 128}, {}), ({}, {"mode": "MULTIPLY"}), ({"mode": "MULTIPLY"}, {})],
    ids=["translucent base", "blending clip", "blending base"],
)
def test_clipped_layers_that_cannot_stay_become_one_with_their_base(base, clip):
    d = Document()
    d.layer("back", BACK)
    d.layer("base", BALL, **base)
    d.layer("spot", TOP, clip=True, **clip)
    picture = d.read()
    assert [v.name for v in picture.layers] == ["back", "base"][: 1 if "mode" in base else 2]
    assert any("become one" in n or "flattened" in n for n in picture.notes)
    looks_as_psd_tools_says(d, picture)


@pytest.mark.parametrize("inner", ["NORMAL", "MULTIPLY"])
def test_layers_that_are_clipped_to_a_group(inner):
    d = Document()
    d.layer("back", BACK)
    d.layer("inside", BALL, d.group("g"), mode=inner)
    d.layer("spot", TOP, clip=True)
    picture = d.read()
    assert [v.name for v in picture.layers] == (["back", "g"] if inner == "NORMAL" else ["back"])
    looks_as_psd_tools_says(d, picture)


@pytest.mark.parametrize("mode", ["MULTIPLY", "SOFT_LIGHT", "LINEAR_BURN", "LUMINOSITY"])
def test_modes_are_flattened(mode):
    d = Document()
    d.layer("back", BACK)
    d.layer("mid", TOP, opacity=180)
    d.layer("shade", BALL, mode=mode, opacity=220)
    d.layer("front", TOP[:20], at=(0, 20))
    picture = d.read()
    assert [v.name for v in picture.layers] == ["back", "front"]
    told = mode.lower().replace("_", " ")
    assert picture.notes == (
        f"layer 'shade' (blending mode {told}) is flattened with the 2 behind it",
    )
    looks_as_psd_tools_says(d, picture)


@pytest.mark.parametrize("mode", ["PASS_THROUGH", "NORMAL"])
def test_modes_in_groups(mode):
    d = Document()
    d.layer("back", BACK)
    group = d.group("g", opacity=150, mode=mode)
    d.layer("low", TOP, group)
    d.layer("shade", BALL, group, mode="MULTIPLY")
    d.layer("front", TOP[:20], at=(0, 20))
    picture = d.read()
    isolated = mode == "NORMAL"
    assert [v.name for v in picture.layers] == ["back", *["low"] * isolated, "front"]
    assert [v.opacity for v in picture.layers[1:-1]] == [150 / 255] * isolated
    looks_as_psd_tools_says(d, picture)


def test_hidden_modes_are_left_out():
    d = Document()
    d.layer("back", BACK)
    d.layer("shade", BALL, mode="MULTIPLY").visible = False
    picture = d.read(blend="refuse")
    assert (picture.left_out, picture.notes) == (("shade",), ())
    looks_as_psd_tools_says(d, picture)


def test_adjustments_are_flattened_or_named():
    d = Document()
    d.layer("back", BACK)
    d.adjustment("negative", Tag.INVERT)
    d.layer("front", BALL)
    picture = d.read()
    assert [v.name for v in picture.layers] == ["back", "front"]
    assert "'negative' (adjustment invert) is flattened with the 1 behind" in picture.notes[0]
    np.testing.assert_array_equal(picture.layers[0].pixels[..., :3], 255 - BACK)
    with pytest.raises(pxi.UnsupportedError, match=r"'negative'.*adjustment invert"):
        d.read(blend="refuse")


def test_adjustments_that_cannot_be_drawn_are_named():
    d = Document()
    d.layer("back", BACK)
    d.adjustment("map", Tag.COLOR_LOOKUP)
    d.layer("front", BALL)
    picture = d.read()
    assert [v.name for v in picture.layers] == ["back", "front"]
    assert "adjustment layer 'map' (colorlookup) is left out" in picture.notes[0]
    np.testing.assert_array_equal(picture.layers[0].pixels, BACK)
    with pytest.raises(pxi.UnsupportedError, match="'map'"):
        d.read(blend="refuse")


def test_what_cannot_be_drawn_is_told_by_the_flat_picture():
    d = two()
    # Of a file that was opened and not changed, the flat picture stays as it is.
    d.psd = psd_tools.PSDImage.open(io.BytesIO(d.data()))
    for level, told in ((0, False), (20, True)):
        flat = np.asarray(d.psd.composite(force=True).convert("RGB")).astype(int) + level
        planes = np.clip(flat, 0, 255).astype(np.uint8).transpose(2, 0, 1)
        d.psd._record.image_data.set_data([p.tobytes() for p in planes], d.psd._record.header)
        notes = d.read().notes
        assert any("look different" in note for note in notes) is told


def test_flat_files_are_no_layers():
    d = Document()
    d.layer("only", BACK)
    assert d.read() is None
    assert is_photoshop(d.data())
    assert not is_photoshop(b"8BP")


# Refusals


def refused(error, data, *words, **options):
    with pytest.raises(error) as caught:
        read_photoshop(data, "in.psd", **options)
    assert str(caught.value).startswith("in.psd")
    assert all(word in str(caught.value) for word in words), caught.value


def two() -> Document:
    d = Document()
    d.layer("back", BACK)
    d.layer("cat", BALL)
    return d


@pytest.mark.parametrize(
    ("mode", "depth", "words"),
    [(4, 16, "CMYK colours in 16 bits"), (4, 8, "CMYK"), (9, 8, "LAB"), (3, 32, "32 bits"),
     (0, 1, "BITMAP"), (77, 8, "mode 77")],
)  # fmt: skip
def test_other_colours(mode, depth, words):
    data = bytearray(two().data())
    data[22:26] = struct.pack(">HH", depth, mode)
    refused(pxi.UnsupportedError, bytes(data), words, "--frame 0")


def test_damaged_files():
    data = two().data()
    for cut in (10, 26, 40, 200, len(data) // 3):
        refused(pxi.InputError, data[:cut])


def test_damage_anywhere_is_an_error_or_nothing():
    data = two().data()
    rng = np.random.default_rng(5)
    for _ in range(40):
        hurt = bytearray(data)
        hurt[int(rng.integers(26, len(data)))] ^= 1 << int(rng.integers(8))
        with contextlib.suppress(pxi.PxiError):
            read_photoshop(bytes(hurt), "in.psd")


def test_limits():
    data = two().data()
    refused(pxi.LimitError, data, "side: 64", limits=Limits(side=63))
    refused(pxi.LimitError, data, "output pixels", limits=Limits(output_pixels=W * H - 1))
    refused(pxi.LimitError, data, "'cat'", limits=Limits(output_pixels=W * H + 5))
    refused(pxi.LimitError, data, "layers", limits=Limits(layers=1))


def test_without_psd_tools(monkeypatch, tool, tmp_path):
    monkeypatch.setattr(photoshop, "has_reader", lambda: False)
    refused(pxi.UnsupportedError, two().data(), "proxyimg-codec[psd]")
    (tmp_path / "a.psd").write_bytes(two().data())
    ran = tool("encode", tmp_path / "a.psd", "-e", "1", "-j", "1")
    assert "proxyimg-codec[psd]" in ran.err


# The command


def test_the_command(tool, tmp_path):
    d = two()
    d.layer("shade", TOP, mode="SCREEN")
    (tmp_path / "a.psd").write_bytes(d.data())
    ran = tool("encode", tmp_path / "a.psd", "-e", "1", "-j", "1")
    assert "warning" in ran.err
    assert "'shade' (blending mode screen) is flattened with the 2 behind it" in ran.err
    assert "'shade'" in tool("encode", tmp_path / "a.psd", "--blend", "refuse", "-f", code=5).err
    (tmp_path / "a.psd").write_bytes(two().data())
    tool("encode", tmp_path / "a.psd", "-f", "-e", "1", "-j", "1", "--blend", "refuse")
    assert [v.name for v in pxi.open(tmp_path / "a.pxi").layers] == ["back", "cat"]


@pytest.mark.parametrize("flags", [("--frame", "0"), ("--layers", "1")], ids=" ".join)
def test_flags_for_flat_pictures_take_it_flat(tool, tmp_path, flags):
    (tmp_path / "a.psd").write_bytes(two().data())
    tool("encode", tmp_path / "a.psd", "-e", "1", "-j", "1", "--layers", "1", *flags)
    assert len(pxi.open(tmp_path / "a.pxi").layers) == 1
