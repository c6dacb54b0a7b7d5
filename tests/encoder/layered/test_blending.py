"""Layers with blending modes in OpenRaster files: flattened so that they look right, or refused."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.import_layers import composite
from proxyimg_codec.encoder.layered import blending
from proxyimg_codec.encoder.layered.openraster import read_openraster
from proxyimg_codec.io.png import encode_png
from tests.encoder.test_import_layers import H, W, ball, layer, ora
from tests.support.pictures import smooth

pytest.importorskip("psd_tools")

BACK = smooth(W, H)
BALL, TOP = ball(30.3, 24, 15), ball(44, 20, 9, (20, 220, 250))
FILES = {"a": encode_png(BACK), "b": encode_png(BALL), "t": encode_png(TOP)}
SHADE = layer("b", name="shade", composite_op="svg:multiply")


def read(stack: str, **options):
    return read_openraster(ora(stack, **FILES), "in.ora", **options)


def over(below, rgba, colour=None, opacity=1.0):
    """Colours [H, W, 3] in 0..1 with a layer over them, in other colours if there are such."""
    alpha = rgba[..., 3:] / 255 * opacity
    return below + alpha * ((rgba[..., :3] / 255 if colour is None else colour) - below)


B, M = BACK / 255, BALL[..., :3] / 255
MIXED = {
    "multiply": B * M,
    "screen": B + M - B * M,
    "overlay": np.where(B <= 0.5, 2 * B * M, 1 - 2 * (1 - B) * (1 - M)),
    "hard-light": np.where(M <= 0.5, 2 * B * M, 1 - 2 * (1 - B) * (1 - M)),
    "darken": np.minimum(B, M),
    "lighten": np.maximum(B, M),
    "difference": np.abs(B - M),
    "plus": np.minimum(B + M, 1),
}


@pytest.mark.parametrize("mode", MIXED)
def test_modes(mode):
    stack = layer("b", name="x", composite_op=f"svg:{mode}", opacity="0.75") + layer(name="back")
    picture = read(stack)
    assert [v.name for v in picture.layers] == ["back"]
    want = over(B, BALL, MIXED[mode], 0.75)
    np.testing.assert_allclose(picture.layers[0].pixels[..., :3] / 255, want, atol=0.6 / 255)
    assert picture.notes == (f"layer 'x' (blending mode {mode}) is flattened with the 1 behind it",)


def test_all_modes_are_known():
    for mode in blending.MODES:
        found = read(layer("b", composite_op=f"svg:{mode}") + layer()).layers[0].pixels[..., :3]
        plain = over(B, BALL)
        assert np.abs(found / 255 - plain).max() > 0.1, mode


def test_only_what_lies_behind_is_flattened():
    stack = layer("t", name="top") + SHADE + layer("t", name="off", visibility="hidden")
    picture = read(stack + layer("b", name="mid", opacity="0.5") + layer(name="back"))
    assert [(v.name, v.hidden) for v in picture.layers] == [
        ("back", False), ("off", True), ("top", False),
    ]  # fmt: skip
    under = over(B, BALL, opacity=0.5)
    want = over(over(under, BALL, under * M), TOP)
    np.testing.assert_allclose(composite(picture)[..., :3], want, atol=1.1 / 255)
    # Layers in front keep all their own pixels.
    np.testing.assert_array_equal(picture.layers[2].pixels, TOP)


def test_below_nothing_a_mode_does_nothing():
    found = read(SHADE).layers[0]
    seen = found.pixels[..., 3] > 0
    np.testing.assert_array_equal(found.pixels[..., 3], BALL[..., 3])
    np.testing.assert_array_equal(found.pixels[seen], BALL[seen])


def group(inside: str, **attributes) -> str:
    written = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return f"<stack{written}>{inside}</stack>"


@pytest.mark.parametrize(
    ("attributes", "opacity"),
    [({"isolation": "isolate"}, 1.0), ({"opacity": "0.5"}, 0.5)],
)
def test_isolated_groups_blend_within_themselves(attributes, opacity):
    inside = SHADE + layer("t", name="disc")
    picture = read(layer("t", name="top") + group(inside, name="g", **attributes) + layer(name="a"))
    assert [(v.name, v.groups, v.opacity) for v in picture.layers] == [
        ("a", (), 1), ("disc", ("g",), opacity), ("top", (), 1),
    ]  # fmt: skip
    np.testing.assert_array_equal(picture.layers[0].pixels, BACK)
    a, b = TOP[..., 3:] / 255, BALL[..., 3:] / 255
    t = TOP[..., :3] / 255
    alpha = a + b - a * b
    colours = (1 - b) * a * t + b * ((1 - a) * M + a * t * M)
    found = picture.layers[1].pixels / 255
    np.testing.assert_allclose(found[..., 3:], alpha, atol=0.6 / 255)
    np.testing.assert_allclose(found[..., :3] * found[..., 3:], colours, atol=1.2 / 255)


def test_through_other_groups_they_blend_with_all_behind():
    inside = layer("t", name="front") + SHADE + layer("t", name="low")
    picture = read(group(group(inside, name="in"), name="g") + layer(name="back"))
    assert [(v.name, v.groups) for v in picture.layers] == [("back", ()), ("front", ("g", "in"))]
    below = over(B, TOP)
    want = over(over(below, BALL, below * M), TOP)
    np.testing.assert_allclose(composite(picture)[..., :3], want, atol=1.1 / 255)


def test_flattened_layers_of_a_group_stay_in_it():
    picture = read(group(SHADE + layer("t", name="low"), name="g"))
    assert [(v.name, v.groups) for v in picture.layers] == [("low", ("g",))]


def test_groups_that_blend_do_it_as_a_whole():
    attributes = {"name": "g", "composite-op": "svg:multiply"}
    picture = read(group(layer("b") + layer("b"), **attributes) + layer(name="back"))
    alpha = BALL[..., 3:] / 255
    want = B + (1 - (1 - alpha) ** 2) * (B * M - B)
    np.testing.assert_allclose(picture.layers[0].pixels[..., :3] / 255, want, atol=1 / 255)


def test_layers_of_sixteen_bits_stay_so():
    deep = encode_png(BACK.astype(np.uint16) * 257 + np.uint16(100) * (BACK < 255))
    data = ora(SHADE + layer("d"), d=deep, **FILES)
    assert read_openraster(data, "in.ora").layers[0].pixels.dtype == np.uint16


def test_refusing():
    with pytest.raises(pxi.UnsupportedError, match=r"'shade'.*multiply.*--blend flatten"):
        read(group(SHADE, name="g") + layer(), blend="refuse")
    hidden = read(group(SHADE, visibility="hidden") + layer(name="a"), blend="refuse")
    assert [v.name for v in hidden.layers] == ["a"]


def test_the_flag(tool, tmp_path):
    (tmp_path / "a.ora").write_bytes(ora(SHADE + layer("t") + layer(name="back"), **FILES))
    refused = tool("encode", tmp_path / "a.ora", "--blend", "refuse", code=5)
    assert "'shade'" in refused.err
    assert not (tmp_path / "a.pxi").exists()
    ran = tool("encode", tmp_path / "a.ora", "-e", "1", "-j", "1", "-q", "90")
    assert "warning" in ran.err
    assert "layer 'shade' (blending mode multiply) is flattened with the 2 behind it" in ran.err
    drawn = pxi.open(tmp_path / "a.pxi").render()
    below = over(B, TOP)
    want = over(below, BALL, below * M)
    assert np.sqrt(((drawn / 255 - want) ** 2).mean()) < 0.02


def test_modes_without_their_package(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "psd_tools.composite.blend", None)
    with pytest.raises(pxi.UnsupportedError, match=r"proxyimg-codec\[psd\]"):
        read(SHADE + layer())
    assert len(read(layer("b") + layer()).layers) == 2
