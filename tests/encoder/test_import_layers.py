"""OpenRaster files as input: what becomes of their layers, and files that are refused."""

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.import_layers import composite, encode_layers
from proxyimg_codec.encoder.layered.openraster import is_openraster, read_openraster
from proxyimg_codec.encoder.layered.source import LayeredPicture, SourceLayer
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.export import openraster as export
from proxyimg_codec.export.common import at_full_opacity
from proxyimg_codec.io import xml
from proxyimg_codec.io.color import to_srgb
from proxyimg_codec.io.png import encode_png
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.limits import DEFAULT_LIMITS, Limits
from proxyimg_codec.render.quality import psnr
from tests.support.pictures import icc, smooth

W, H = 64, 48
FAST = Settings(effort=1, jobs=1)
Y, X = np.mgrid[0:H, 0:W] + 0.5


def ball(x: float, y: float, radius: float, colour=(200, 60, 40)) -> np.ndarray:
    """An anti-aliased disc, uint8 [H, W, 4]; transparent pixels are black."""
    alpha = np.clip(radius + 0.5 - np.hypot(X - x, Y - y), 0, 1)
    pixels = np.dstack([*(np.full((H, W), c) for c in colour), np.rint(255 * alpha)])
    pixels[alpha == 0] = 0
    return pixels.astype(np.uint8)


def glow(x: float, y: float, radius: float) -> np.ndarray:
    """A bright spot that fades away softly, uint8 [H, W, 4]."""
    alpha = np.clip(255 * (1 - np.hypot(X - x, Y - y) / radius), 0, 255)
    return np.dstack([np.full((H, W), c) for c in (250, 240, 90)] + [alpha]).astype(np.uint8)


def ora(stack: str, size=(W, H), mimetype="image/openraster", **files: bytes) -> bytes:
    """An OpenRaster file of the outermost stack's content, and of files data/NAME.png."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("mimetype", mimetype)
        w, h = size
        archive.writestr("stack.xml", f'<image w="{w}" h="{h}"><stack>{stack}</stack></image>')
        for name, data in files.items():
            archive.writestr(f"data/{name}.png", data)
    return buffer.getvalue()


def layer(source="a", **attributes) -> str:
    text = "".join(f' {k.replace("_", "-")}="{v}"' for k, v in attributes.items())
    return f'<layer src="data/{source}.png"{text}/>'


PNG = encode_png(smooth(W, H))


def read(data: bytes, **limits) -> LayeredPicture:
    return read_openraster(data, "in.ora", Limits(**limits))


def refused(error: type[pxi.PxiError], data: bytes, *words: str, **limits) -> None:
    with pytest.raises(error) as caught:
        read(data, **limits)
    text = str(caught.value)
    assert text.startswith("in.ora: ")
    assert all(word in text for word in words), text


# Reading


def test_order_place_and_attributes():
    spot = encode_png(ball(5, 5, 4)[:10, :10])
    picture = read(
        ora(
            layer("spot", name="front", x=50, y=30, opacity="0.25", visibility="hidden")
            + layer("a", name="rear"),
            spot=spot, a=PNG,
        )
    )  # fmt: skip
    assert (picture.width, picture.height) == (W, H)
    rear, front = picture.layers
    assert (rear.name, rear.x, rear.y, rear.opacity, rear.hidden) == ("rear", 0, 0, 1, False)
    assert (rear.pixels == smooth(W, H)).all()
    assert (front.name, front.x, front.y) == ("front", 50, 30)
    assert (front.opacity, front.hidden) == (0.25, True)
    assert (front.pixels == ball(5, 5, 4)[:10, :10]).all()


def test_groups_are_flattened():
    inner = f'<stack name="in" opacity="0.5" x="1">{layer(name="b", x=2, opacity="0.5")}</stack>'
    outer = f'<stack name="out" visibility="hidden">{inner}{layer(name="a")}</stack>'
    got = read(ora(f"{outer}<stack>{layer(name='c')}</stack>{layer(name='d')}", a=PNG)).layers
    assert [(v.name, v.groups, v.hidden) for v in got] == [
        ("d", (), False), ("c", ("group",), False), ("a", ("out",), True),
        ("b", ("out", "in"), True),
    ]  # fmt: skip
    assert (got[3].x, got[3].opacity) == (3, 0.25)


def test_names_become_printable_and_unique():
    names = ("cat", "cat", "", "a&#9;b&#10;", "x" * 300)
    got = read(ora("".join(layer(name=n) for n in names), a=PNG)).layers[::-1]
    assert [v.name for v in got] == ["cat 2", "cat", "layer 3", "a b", "x" * 200]


def test_layers_are_clipped_to_the_canvas():
    picture = read(ora(layer(x=-10, y=40) + layer(x=60, y=-20), a=PNG))
    right, left = picture.layers
    assert (left.x, left.y, left.pixels.shape) == (0, 40, (8, 54, 3))
    assert (left.pixels == smooth(W, H)[:8, 10:]).all()
    assert (right.x, right.y, right.pixels.shape) == (60, 0, (28, 4, 3))
    assert (right.pixels == smooth(W, H)[20:, :4]).all()


def test_layers_without_a_pixel_are_left_out():
    clear = encode_png(np.zeros((4, 4, 4), np.uint8))
    stack = layer("clear", name="clear") + layer(name="away", x=W) + layer(name="a")
    picture = read(ora(stack, a=PNG, clear=clear))
    assert [v.name for v in picture.layers] == ["a"]
    assert picture.left_out == ("away", "clear")


def test_extensions_are_passed_over():
    other = '<k:tool xmlns:k="http://k.org/"/>'
    assert [v.name for v in read(ora(other + layer(name="a"), a=PNG)).layers] == ["a"]


def test_files_are_recognized_by_what_they_say():
    assert is_openraster(ora(layer(), a=PNG))
    assert not is_openraster(ora(layer(), mimetype="application/zip", a=PNG))
    assert not is_openraster(PNG)


# Refusals


def test_files_that_are_not_openraster():
    refused(pxi.InputError, b"", "not an OpenRaster file")
    refused(pxi.InputError, PNG, "not an OpenRaster file")
    whole = ora(layer(), a=PNG)
    refused(pxi.InputError, whole[: len(whole) // 2], "not an OpenRaster file")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("mimetype", "image/openraster")
    refused(pxi.InputError, buffer.getvalue(), "'stack.xml' is not in the file")


def with_stack(xml: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("stack.xml", xml)
    return buffer.getvalue()


BOMB = b"""<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;">]>
<image w="4" h="4"><stack name="&b;"/></image>"""


@pytest.mark.parametrize(
    ("xml", "word"),
    [
        (b"<image", "not valid XML"),
        (b"<image w='4' h='4'/>", "no stack"),
        (b"<svg><stack/></svg>", "no stack"),
        (BOMB, "DOCTYPE"),
        (BOMB.decode().replace("1.0", '1.0" encoding="utf-16').encode("utf-16"), "DOCTYPE"),
        (b'<?xml version="1.0" encoding="klingon"?><image/>', "not valid XML"),
        (b"<image>" + b"<stack>" * 100_000, "nested deeper"),
        (b"<image h='4'><stack/></image>", "the canvas: w is ''"),
        (b"<image w='4' h='4.5'><stack/></image>", "h is '4.5'"),
        (b"<image w='0' h='4'><stack/></image>", "empty"),
        (b"<image w='4' h='4'><stack/></image>", "no layer has a pixel"),
    ],
)
def test_stacks_that_make_no_sense(xml, word):
    refused(pxi.InputError, with_stack(xml), word)


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        (layer("b", name="cat"), ["layer 'cat'", "'data/b.png' is not in the file"]),
        ('<layer name="cat"/>', ["layer 'cat'", "no src"]),
        ('<layer name="cat" src="../../etc/passwd"/>', ["'../../etc/passwd' is not in the file"]),
        ('<layer name="cat" src="/etc/passwd"/>', ["'/etc/passwd' is not in the file"]),
        (layer(name="cat", x="1.5"), ["layer 'cat'", "x is '1.5'"]),
        (layer(name="cat", y="9" * 5000), ["layer 'cat'", "y is '999"]),
        (layer(name="cat", opacity="nan"), ["layer 'cat'", "opacity is 'nan'"]),
        (layer(name="cat", opacity="1.5"), ["layer 'cat'", "opacity is '1.5'"]),
    ],
)
def test_layers_that_make_no_sense(stack, words):
    refused(pxi.InputError, ora(stack, a=PNG), *words)


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        (layer(name="cat", composite_op="svg:dst-in"), ["layer 'cat'", "'svg:dst-in'"]),
        (f'<stack name="g" composite-op="x:y">{layer()}</stack>', ["layer 'g'", "'x:y'"]),
        ('<filter type="blur"/>', ["filter", "only layers"]),
        (layer("text", name="cat"), ["layer 'cat'", "not a PNG"]),
        (layer("cut", name="cat"), ["layer 'cat'", "not a PNG"]),
    ],
)
def test_what_is_not_supported(stack, words):
    refused(pxi.UnsupportedError, ora(stack, a=PNG, text=b"hello", cut=PNG[:20]), *words)


SHADE = layer("nowhere", name="shade", composite_op="svg:multiply", visibility="hidden")
NESTED = f'<stack name="g" composite-op="svg:screen">{layer()}{layer(name="x", y="1.5")}</stack>'


@pytest.mark.parametrize(
    ("stack", "left_out", "kept"),
    [
        (SHADE, ("shade",), ["cat"]),
        (SHADE + layer(name="shade"), ("shade 2",), ["cat", "shade"]),
        (SHADE.replace('"hidden"', '"visible" opacity="0"'), ("shade",), ["cat"]),
        (f'<stack visibility="hidden" name="off">{NESTED}</stack>', ("g",), ["cat"]),
        (f'<stack opacity="0.0">{SHADE.replace("hidden", "visible")}</stack>', ("shade",), ["cat"]),
        ('<filter name="blur" visibility="hidden"/>', ("blur",), ["cat"]),
        (layer(name="off", visibility="hidden"), (), ["cat", "off"]),
    ],
)
def test_what_is_not_supported_but_hidden_is_left_out(stack, left_out, kept):
    picture = read(ora(stack + layer(name="cat"), a=PNG))
    assert (picture.left_out, sorted(v.name for v in picture.layers)) == (left_out, kept)


def test_damaged_pixels():
    refused(pxi.InputError, ora(layer(name="cat"), a=PNG[:-40]), "layer 'cat'", "damaged")
    data = ora(layer(name="cat"), a=PNG)
    at = data.index(PNG) + 100
    refused(pxi.InputError, data[:at] + b"\0\0\0\0" + data[at + 4 :], "layer 'cat'", "damaged")


def test_encrypted_entries():
    data = bytearray(ora(layer(name="cat"), a=PNG))
    data[data.rindex(b"PK\1\2") + 8] |= 1
    refused(pxi.InputError, bytes(data), "layer 'cat'", "encrypted")


def test_limits():
    two = ora(layer() + layer(name="cat"), a=PNG)
    refused(pxi.LimitError, two, "side: 64", side=63)
    refused(pxi.LimitError, two, "output pixels", output_pixels=W * H - 1)
    refused(pxi.LimitError, two, "layer 'layer 2'", output_pixels=2 * W * H - 1)
    refused(pxi.LimitError, two, "layers: 2", layers=1)
    refused(pxi.LimitError, two, "data/a.png", file_bytes=len(PNG) - 1)
    huge = bytearray(PNG)
    huge[16:24] = b"\x7f\xff\xff\xff" * 2
    refused(pxi.LimitError, ora(layer(), a=bytes(huge)), "side: 2147483647")
    refused(pxi.LimitError, ora(layer(), size=(1 << 40, 4), a=PNG), "side")
    refused(pxi.LimitError, with_stack(b"<image>" + b" " * xml.BYTES_MAX), "stack.xml")


# Compositing and encoding


def source(name, pixels, **attributes) -> SourceLayer:
    return SourceLayer(name, pixels, 0, 0, **attributes)


def stack(*layers: SourceLayer) -> LayeredPicture:
    return LayeredPicture(W, H, layers)


def test_composite_is_source_over():
    half = np.full((2, 3, 4), (255, 0, 0, 128), np.uint8)
    grey = np.full((H, W, 1), 51, np.uint8)
    picture = stack(source("g", grey), SourceLayer("h", half, 4, 5, opacity=0.5))
    got = composite(picture)
    assert got[0, 0] == pytest.approx([0.2, 0.2, 0.2, 1])
    a = 128 / 255 / 2
    assert got[6, 6] == pytest.approx([0.2 * (1 - a) + a, 0.2 * (1 - a), 0.2 * (1 - a), 1])
    assert got[4, 4] == pytest.approx(got[0, 0])
    alone = composite(stack(SourceLayer("h", half, 4, 5), source("x", grey, hidden=True)))
    assert alone[6, 6] == pytest.approx([1, 0, 0, 128 / 255])
    assert not alone[0, 0].any()


SCENE = stack(
    source("back", smooth(W, H)),
    source("rear", ball(28, 24, 18)),
    source("front", ball(38, 24, 16, (250, 250, 250)), opacity=0.5, groups=("g", "light")),
    source("off", ball(50, 30, 8), hidden=True, groups=("g",)),
    source("light", glow(20, 20, 25), groups=("g", "light")),
)


@pytest.fixture(scope="module", params=["pyramid", "implicit"])
def scene(request) -> pxi.Image:
    image, kept = encoded(SCENE, replace(FAST, texture=request.param))
    assert kept.layers == SCENE.layers
    return pxi.from_bytes(image.to_bytes())


def encoded(picture, settings):
    """The image that a stack becomes, and what was kept of the stack."""
    image, kept = encode_layers(picture, settings)
    return pxi.Image(image), kept


def alone(image: pxi.Image, name: str, **view) -> np.ndarray:
    return pxi.Image(at_full_opacity(image.picture)).render(layers=[name], **view)


def test_the_picture_is_that_of_the_layers(scene):
    assert [v.name for v in scene.layers] == [v.name for v in SCENE.layers]
    assert psnr(composite(SCENE), scene) > 28


def test_every_layer_keeps_its_own_pixels_also_hidden_ones(scene):
    # The disc in smooth() is hidden behind the balls.
    assert psnr_8bit(smooth(W, H), alone(scene, "back")) > 27
    for v in SCENE.layers[1:4]:
        got = alone(scene, v.name)
        assert psnr_8bit(v.pixels, got) > 33
        assert np.abs(got[..., 3].astype(int) - v.pixels[..., 3]).mean() < 0.8


def test_soft_alpha_is_kept_and_opaque_layers_stay_opaque(scene):
    assert (scene.opaque, scene.channels) == (True, 4)
    if scene.networks:
        assert [n.shape.channels for n in scene.networks] == [3, 4]
        assert [v.texture.network for v in scene.layers] == [0, 0, 0, 0, 1]
    else:
        assert [v.texture.alpha is not None for v in scene.layers] == [False] * 4 + [True]
        assert len(scene.planes) == 6
    assert scene.layers["back"].boundary is None
    assert scene.render().shape == (H, W, 3)
    error = alone(scene, "light")[..., 3].astype(int) - SCENE.layers[-1].pixels[..., 3]
    assert np.abs(error).mean() < 2.5


def test_opacity_visibility_and_groups_become_poses(scene):
    assert [v.pose.opacity for v in scene.layers] == [65535, 65535, 32768, 65535, 65535]
    assert [v.name for v in scene.layers if v.pose.hidden] == ["off"]
    # A group with the name of a layer is numbered.
    assert [v.parent for v in scene.layers] == [None, None, "light 2", "g", "light 2"]
    assert dict(scene.groups) == {"g": None, "light 2": "g"}


def test_areas_are_those_that_can_be_seen(scene):
    if not scene.networks:  # files of pyramids record nothing about their layers
        assert scene.info is None
        return
    areas = scene.info["areas"]
    assert areas[3] == 0
    clear = 1 - SCENE.layers[4].pixels[..., 3] / 255
    front = (SCENE.layers[2].pixels[..., 3] / 255 * 0.5 * clear).sum()
    assert areas[2] == pytest.approx(front, abs=1)


@pytest.mark.parametrize("attributes", [{"hidden": True}, {"opacity": 0.5}])
def test_a_back_layer_that_does_not_cover_makes_no_opaque_picture(attributes):
    picture = stack(source("back", smooth(W, H), **attributes), source("a", ball(30, 24, 10)))
    image, _ = encoded(picture, FAST)
    assert not image.opaque
    got = pxi.from_bytes(image.to_bytes()).render()
    assert got[0, 0, 3] == round(255 * attributes.get("opacity", 0))


def test_whole_layers_in_front_have_no_boundary():
    front = np.full((H, W, 3), 90, np.uint8)
    image, _ = encoded(stack(source("a", smooth(W, H)), source("b", front)), FAST)
    assert [v.boundary for v in image.layers] == [None, None]
    assert np.abs(image.render().astype(int) - 90).max() <= 2


def test_outlines_do_not_depend_on_the_place():
    """A layer is fitted on a part of the canvas, but its boundary is the canvas's."""

    def boundary(x: int) -> np.ndarray:
        cut = SourceLayer("a", ball(20, 24, 9)[10:40, 5:40], 5 + x, 10)
        image, _ = encoded(stack(cut), FAST)  # one colour: nothing to fit but the outline
        assert image.layers["a"].boundary.unit == 3
        return image.layers["a"].boundary.paths[0]

    assert (boundary(20) - boundary(0) == (20 << 3, 0)).all()


def test_layers_too_faint_to_be_found_are_left_out():
    dust = np.zeros((H, W, 4), np.uint8)
    dust[20, 20] = (255, 255, 255, 20)
    image, kept = encoded(stack(source("a", smooth(W, H)), source("dust", dust)), FAST)
    assert [v.name for v in image.layers] == ["a"]
    assert kept.left_out == ("dust",)
    assert [v.name for v in kept.layers] == ["a"]
    with pytest.raises(pxi.InputError, match="faint"):
        encoded(stack(source("dust", dust)), FAST)


@pytest.mark.parametrize("texture", ["pyramid", "implicit"])
def test_rims_are_clean(texture):
    """What a transparent pixel's colour is may not be seen in the rim, at any size."""
    pixels = ball(30, 24, 15)
    pixels[pixels[..., 3] < 100, :3] = 0
    image, _ = encoded(stack(source("a", pixels)), replace(FAST, texture=texture))
    for scale in (1, 3):
        drawn = image.render(scale=scale).astype(int)
        error = np.abs(drawn[drawn[..., 3] > 0][:, :3] - (200, 60, 40))
        assert error.max() <= (1 if texture == "pyramid" else 0)


@pytest.mark.parametrize("texture", ["pyramid", "implicit"])
def test_crisp_edges_of_soft_layers(texture):
    """Where outline and alpha both end, the rim is not taken off twice."""
    pixels = ball(30.3, 24, 15)
    pixels[..., 3] = pixels[..., 3] * np.clip((48 - X) / 30, 0, 1)
    image, _ = encoded(stack(source("a", pixels)), replace(FAST, effort=3, texture=texture))
    assert image.channels == 4
    error = image.render()[..., 3].astype(int) - pixels[..., 3]
    rim = (pixels[..., 3] > 0) & (np.abs(np.hypot(X - 30.3, Y - 24) - 15) < 0.5) & (X < 20)
    assert error[rim].mean() > -5
    assert np.abs(error[rim]).mean() < 20


def test_sixteen_bits():
    deep = smooth(W, H).astype(np.uint16) * 257
    image, _ = encoded(stack(source("a", deep)), FAST)
    assert image.depth == 16
    assert psnr_8bit(smooth(W, H), image.render()) > 28


def test_same_input_same_bytes(scene):
    texture = "implicit" if scene.networks else "pyramid"
    again, _ = encoded(SCENE, replace(FAST, jobs=2, texture=texture))
    assert again.to_bytes() == scene.to_bytes()


def test_there_and_back(small_pxi):
    image = pxi.open(small_pxi)
    picture = read_openraster(export.build(image), "a.ora")
    again, _ = encoded(picture, FAST)
    assert [v.name for v in again.layers] == [v.name for v in image.layers]
    assert psnr_8bit(image.render(), again.render()) > 30
    for layer in image.layers:
        a, b = (i.render(layers=[layer.name]) for i in (image, again))
        assert psnr_8bit(a, b) > 30


# Settings


def rough(w: int, h: int) -> np.ndarray:
    """Structure at all scales, uint8 [h, w, 3]."""
    noise = np.random.default_rng(3).normal(0, 9, (h, w, 3))
    return np.clip(smooth(w, h) + noise, 0, 255).astype(np.uint8)


ROUGH = stack(
    source("back", rough(W, H)), source("spot", np.dstack([rough(W, H), ball(33, 21, 17)[..., 3]]))
)


@pytest.mark.parametrize("texture", ["auto", "pyramid", "implicit"])
def test_effort_and_texture_act(texture):
    few, many = (encoded(ROUGH, replace(FAST, texture=texture, effort=e))[0] for e in (1, 3))
    assert few.to_bytes() != many.to_bytes()
    assert not np.array_equal(few.render(), many.render())
    assert bool(few.networks) == (texture == "implicit")
    rate = [8 * len(v.to_bytes()) / W / H for v in (few, many)]
    gain = psnr(composite(ROUGH), many) - psnr(composite(ROUGH), few)
    assert gain + 6 * (rate[0] - rate[1]) > 0  # better at the same size, at 6 dB a bit


@pytest.mark.parametrize("given", [{"feature_bits": 5}, {"net_bits": 6}, {"sampling": "node"}])
def test_auto_is_implicit_if_a_setting_needs_it(given):
    image, _ = encoded(stack(source("a", smooth(17, 13))), replace(FAST, **given))
    assert image.networks


def test_auto_is_implicit_if_readers_would_refuse_so_many_samples(monkeypatch):
    few = replace(DEFAULT_LIMITS, samples=2 * W * H)
    monkeypatch.setattr("proxyimg_codec.encoder.import_layers.DEFAULT_LIMITS", few)
    monkeypatch.setattr("proxyimg_codec.encoder.pyramid.stack.DEFAULT_LIMITS", few)
    three = stack(*(source(name, smooth(W, H)) for name in "abc"))
    assert encoded(stack(source("a", smooth(W, H))), FAST)[0].networks == ()
    assert encoded(three, FAST)[0].networks
    with pytest.raises(pxi.LimitError, match="samples"):
        encoded(three, replace(FAST, texture="pyramid"))


@pytest.mark.parametrize(("kind", "value"), [("psnr", 33.0), ("size", 2500.0), ("bpp", 5.5)])
def test_targets_are_met(kind, value):
    image, _ = encoded(ROUGH, replace(FAST, **{f"target_{kind}": value}))
    size = len(image.to_bytes())
    got = {"psnr": psnr(composite(ROUGH), image), "size": size, "bpp": 8 * size / W / H}[kind]
    assert got == pytest.approx(value, rel=0.03)


def test_tuning_acts():
    plain, tuned = (encoded(ROUGH, replace(FAST, tune=t))[0] for t in ("mse", "ms-ssim"))
    assert plain.to_bytes() != tuned.to_bytes()


EDGES = stack(
    source("back", rough(45, 37)), SourceLayer("spot", ball(33, 21, 11)[5:36, 18:49], 3, 2)
)
# Effort, targets and tuning have tests of their own.
FLAGS = {
    "pyramid": {"quality": 70.0, "boundary": "chamfer", "mesh": "delaunay"},
    "implicit": {"quality": 70.0, "mesh": "none", "feature_bits": 6, "net_bits": 5, "seed": 7},
}


@pytest.fixture(scope="module")
def usual():
    """Files of the same layers with both coders and no other setting."""
    small = replace(EDGES, width=45, height=37)
    made = {t: encoded(small, replace(FAST, texture=t))[0] for t in FLAGS}
    return small, {t: image.to_bytes() for t, image in made.items()}


@pytest.mark.parametrize(("texture", "name"), [(t, n) for t in FLAGS for n in FLAGS[t]])
def test_other_settings_act(usual, texture, name):
    small, before = usual
    image, _ = encoded(small, replace(FAST, texture=texture, **{name: FLAGS[texture][name]}))
    after = pxi.from_bytes(image.to_bytes())
    assert image.to_bytes() != before[texture]
    assert psnr(composite(small), after) > 20


def hairs(w: int, h: int) -> np.ndarray:
    """A disc with rays that are thinner than a pixel, uint8 [h, w, 4]."""
    y, x = np.mgrid[0:h, 0:w] + 0.5 - np.array([h, w])[:, None, None] / 2
    angle, far = np.arctan2(y, x), np.hypot(x, y)
    width = 0.7 * np.clip((h / 2 - 2 - far) / 2, 0, 1)
    across = far * np.abs(np.sin(9 * angle)) / 9
    alpha = np.maximum(np.clip(h / 4 - far, 0, 1), np.clip(width + 0.5 - across, 0, 1) * 0.8)
    return np.dstack([rough(w, h), np.rint(255 * alpha).astype(np.uint8)])


def test_thin_details_that_an_outline_misses_are_kept_by_alpha():
    pixels = hairs(91, 83)
    picture = LayeredPicture(97, 89, (SourceLayer("sun", pixels, 4, 3),))
    image, _ = encoded(picture, replace(FAST, quality=75))
    found = image.render()[3:86, 4:95, 3].astype(int)
    error = np.abs(found - pixels[..., 3])
    assert (error > 64).mean() < 0.002
    assert image.layers["sun"].texture.alpha is not None
    # A disc needs no alpha: its outline says it all.
    disc, _ = encoded(stack(source("a", ball(30, 24, 15))), FAST)
    assert disc.layers["a"].texture.alpha is None


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (7, 1), (9, 65)])
@pytest.mark.parametrize("soft", [False, True])
def test_layers_of_any_size(size, soft):
    w, h = size
    small = rough(w, h) if not soft else np.dstack([rough(w, h), np.full((h, w), 140, np.uint8)])
    picture = LayeredPicture(70, 67, (
        SourceLayer("back", rough(70, 67), 0, 0), SourceLayer("a", small, 61 - w // 2, 2),
    ))  # fmt: skip
    image, kept = encoded(picture, replace(FAST, quality=80))
    assert psnr(composite(picture), pxi.from_bytes(image.to_bytes())) > 27
    assert soft or not kept.left_out


# The command


def test_layers_become_layers(tool, tmp_path):
    clear = encode_png(np.zeros((4, 4, 4), np.uint8))
    stacked = layer("clear", name="clear") + layer("b", name="ball", x=3) + layer(name="sky")
    data = ora(stacked, a=PNG, b=encode_png(ball(30, 24, 12)), clear=clear)
    (tmp_path / "a.ora").write_bytes(data)
    ran = tool("encode", tmp_path / "a.ora", "-e", "1", "-j", "1")
    assert "layer 'clear' has nothing to be seen" in ran.err
    assert "2 layers (sky, ball)" in ran.err
    written = (tmp_path / "a.pxi").read_bytes()
    expected, _ = encoded(read(data), FAST)
    assert written == expected.to_bytes()
    # By content, too.
    tool("encode", "-", tmp_path / "b.pxi", "-e", "1", "-j", "1", stdin=data)
    assert (tmp_path / "b.pxi").read_bytes() == written


def test_the_report_compares_with_the_composite(tool, tmp_path):
    (tmp_path / "a.ora").write_bytes(ora(layer("b") + layer(), a=PNG, b=encode_png(ball(9, 9, 5))))
    report = json.loads(tool("encode", tmp_path / "a.ora", "-e", "1", "-j", "1", "--json").out)
    image = pxi.open(tmp_path / "a.pxi")
    assert report["layers"] == ["layer 1", "layer 2"]
    expected = psnr(composite(read((tmp_path / "a.ora").read_bytes())), image)
    assert report["psnr"] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    "flags",
    [("--masks", "m"), ("--max-layers", "3"), ("--layers", "1"), ("--segmenter", "regions"),
     ("--background", "complete")],
    ids=" ".join,
)  # fmt: skip
def test_flags_of_the_decomposition_are_refused(tool, tmp_path, flags):
    (tmp_path / "a.ora").write_bytes(ora(layer(), a=PNG))
    assert flags[0] in tool("encode", tmp_path / "a.ora", *flags, code=2).err
    assert not (tmp_path / "a.pxi").exists()


@pytest.mark.parametrize(
    ("data", "code"),
    [(b"", 3), (PNG, 3), (ora(layer(composite_op="svg:xor"), a=PNG), 5),
     (ora(layer(), size=(1 << 30, 1), a=PNG), 6)],
    ids=["empty", "png", "blend", "huge"],
)  # fmt: skip
def test_bad_files(tool, tmp_path, data, code):
    (tmp_path / "a.ora").write_bytes(data)
    assert str(tmp_path / "a.ora") in tool("encode", tmp_path / "a.ora", code=code).err
    assert not (tmp_path / "a.pxi").exists()


def test_layers_of_other_colours_are_converted_or_refused():
    pq, p3 = ({"cicp": bytes([*two, 0, 1])} for two in ((9, 16), (12, 13)))
    plain, other = encode_png(smooth(W, H)), encode_png(smooth(W, H), p3)
    assert read(ora(layer("a") + layer("b"), a=other, b=other)).blocks == p3
    mixed = read(ora(layer("a") + layer("b"), a=other, b=plain))
    assert mixed.blocks == {}
    back, front = mixed.layers
    np.testing.assert_array_equal(back.pixels, smooth(W, H))
    wanted = to_srgb(smooth(W, H), p3)
    np.testing.assert_allclose(front.pixels[..., :3], wanted)
    for first in (plain, encode_png(smooth(W, H), pq)):
        data = ora(layer("a") + layer("b"), a=first, b=other)
        refused(pxi.UnsupportedError, data, "profile", "layer")


def test_metadata_is_carried_unless_stripped(tool, tmp_path):
    picture = read(ora(layer(), a=encode_png(smooth(W, H), {"icc": icc()})))
    assert picture.blocks == {"icc": icc()}
    (tmp_path / "a.ora").write_bytes(ora(layer(), a=encode_png(smooth(W, H), {"icc": icc()})))
    for flags, blocks in (((), {"icc": icc()}), (("--strip",), {})):
        tool("encode", tmp_path / "a.ora", "-f", "-e", "1", "-j", "1", *flags)
        assert pxi.open(tmp_path / "a.pxi").blocks == blocks
