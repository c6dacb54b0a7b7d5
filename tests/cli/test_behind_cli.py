"""pxi-encode --behind, and --background with a model."""

import os

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io.color import to_srgb
from proxyimg_codec.io.png import encode_png
from proxyimg_codec.io.raster import write
from tests.support import onnx_models

HEIGHT, WIDTH = 45, 61
OBJECT = np.zeros((HEIGHT, WIDTH), bool)
OBJECT[9:38, 12:47] = True
INSIDE = np.s_[14:33, 17:42]
GROUND, BEHIND, RED = (np.uint8(v) for v in ([60, 120, 90], [200, 90, 60], [230, 30, 20]))
DISPLAY_P3, PQ = bytes([12, 13, 0, 1]), bytes([9, 16, 0, 1])
FLAGS = ("-f", "-e", "1", "-j", "1", "-q", "80", "--masks", "masks")


def flat(colour) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), colour, np.uint8)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The present folder: photo.png, its mask, and without.png."""
    monkeypatch.chdir(tmp_path)
    os.mkdir("masks")
    write("masks/box.png", np.repeat(np.uint8(255) * OBJECT[..., None], 3, 2))
    write("photo.png", np.where(OBJECT[..., None], RED, flat(GROUND)))
    write("without.png", flat(BEHIND))
    return tmp_path


@pytest.fixture
def behind(tool, place):
    """behind(*flags) encodes the photo, and gives what is behind the object, and the messages."""

    def call(*flags):
        ran = tool("encode", "photo.png", "out.pxi", *FLAGS, *flags)
        shown = pxi.open("out.pxi").layers["box"].removed().render()
        return shown[INSIDE].reshape(-1, 3).mean(0), ran.err

    return call


def test_it_is_shown_when_the_object_is_gone(behind):
    colour, said = behind("--behind", "without.png")
    assert np.abs(colour - BEHIND).max() < 4
    assert "warning" not in said


def test_a_model_makes_it(behind, place):
    onnx_models.write(place / "lama.onnx", onnx_models.inpainting("64, 64", 255, 61))
    colour, said = behind("--background", "lama.onnx")
    assert np.abs(colour - GROUND).max() < 6
    assert "warning" not in said


def test_a_model_is_found_by_name(behind, place, monkeypatch, tool):
    monkeypatch.setenv("XDG_CACHE_HOME", str(place / "cache"))
    monkeypatch.setenv("PXI_MODELS", str(place / "mine"))
    ran = tool("encode", "photo.png", *FLAGS, "--background", "lama", code=3)
    assert "the model lama (lama_fp32.onnx) is not here" in ran.err
    onnx_models.write(place / "mine" / "lama_fp32.onnx", onnx_models.inpainting("64, 64", 255, 61))
    for name in ("lama", "inpainting"):
        colour, _ = behind("--background", name)
        assert np.abs(colour - GROUND).max() < 6


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_other_bit_depths_are_converted(behind, dtype):
    white = 65535 if dtype == np.uint16 else 1
    np.save("deep.npy", (flat(BEHIND) / 255 * white).astype(dtype))
    colour, _ = behind("--behind", "deep.npy")
    assert np.abs(colour - BEHIND).max() < 4


def test_colours_become_those_of_the_picture(behind):
    """The same file behind a picture in sRGB, and behind one in Display P3."""
    wide = encode_png(flat(BEHIND), {"cicp": DISPLAY_P3})
    with open("wide.png", "wb") as file:
        file.write(wide)
    wanted = 255 * to_srgb(flat(BEHIND), {"cicp": DISPLAY_P3})[0, 0]
    assert np.abs(wanted - BEHIND).max() > 8
    colour, said = behind("--behind", "wide.png")
    assert np.abs(colour - wanted).max() < 4
    assert "warning: photo.png: wide.png: converted to the colours of the picture" in said
    photo = np.where(OBJECT[..., None], RED, flat(GROUND))
    write("photo.png", photo, {"cicp": DISPLAY_P3})
    colour, said = behind("--behind", "wide.png")
    assert np.abs(colour - BEHIND).max() < 4
    assert "warning" not in said
    srgb = flat(np.rint(wanted).astype(np.uint8))
    write("srgb.png", srgb)
    colour, said = behind("--behind", "srgb.png")
    assert np.abs(colour - BEHIND).max() < 4
    assert "converted" in said
    colour, _ = behind("--behind", "wide.png", "--strip")
    assert np.abs(colour - wanted).max() < 4


def test_colours_that_cannot_be_converted_are_told(tool, place):
    write("photo.png", np.where(OBJECT[..., None], RED, flat(GROUND)), {"cicp": PQ})
    ran = tool("encode", "photo.png", *FLAGS, "--behind", "without.png", code=5)
    assert "without.png: colours cannot be converted to high dynamic range" in ran.err


def test_it_is_said_if_nothing_is_hidden(tool, place):
    flags = ("-e", "1", "-j", "1", "--layers", "1", "--behind", "without.png")
    ran = tool("encode", "photo.png", *flags)
    assert "pxi-encode: warning: nothing hides a part of the back layer" in ran.err
    assert tool("encode", "photo.png", "-f", *flags, "--quiet").err == ""


def test_masks_that_cover_all(tool, place):
    """The first one is the back layer, behind which there is nothing."""
    write("masks/a.png", np.repeat(np.uint8(255) * ~OBJECT[..., None], 3, 2))
    tool("encode", "photo.png", "out.pxi", *FLAGS, "--behind", "without.png")
    image = pxi.open("out.pxi")
    assert [layer.name for layer in image.layers] == ["a", "box"]
    shown = image.layers["box"].removed().render()[INSIDE].reshape(-1, 3).mean(0)
    assert np.abs(shown - BEHIND).max() < 4


@pytest.mark.parametrize(
    ("name", "pixels", "why"),
    [
        ("b.png", flat(BEHIND)[1:], "behind is 61x44, the picture 61x45"),
        ("b.png", np.dstack([flat(BEHIND), np.uint8(200) * OBJECT]), "not opaque"),
        ("b.npy", flat(BEHIND).astype(np.float32), "do not lie in 0..1"),
    ],
)
def test_pictures_that_cannot_lie_behind(tool, place, name, pixels, why):
    if name.endswith(".npy"):
        np.save(name, pixels)
    else:
        write(name, pixels)
    assert why in tool("encode", "photo.png", *FLAGS, "--behind", name, code=3).err
    assert not os.path.exists("photo.pxi")


def test_files_that_are_no_pictures(tool, place):
    (place / "b.png").write_bytes(b"hello")
    assert "b.png" in tool("encode", "photo.png", *FLAGS, "--behind", "b.png", code=3).err
    assert "c.png" in tool("encode", "photo.png", *FLAGS, "--behind", "c.png", code=3).err


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (("--behind", "without.png", "--background", "smooth"), "--behind and --background"),
        (("--behind", "without.png", "--texture", "implicit"), "needs texture pyramid"),
        (
            ("--background", "lama", "--texture", "implicit"),
            "background lama needs texture pyramid",
        ),
        (("--behind", ""), "the name of a file is empty"),
        (("--background", ""), "the name of a file is empty"),
        (("--background", "smoth"), "'smoth' is no method"),
        (("--behind", "out.pxi"), "input and output are the same file"),
        (("without.png", "-o", "all/", "--behind", "without.png"), "encode each by itself"),
    ],
)
def test_flags_that_contradict_it(tool, place, flags, why):
    (place / "out.pxi").write_bytes(b"precious")
    out = () if "-o" in flags else ("out.pxi",)
    masks = FLAGS[:-2] if "-o" in flags else FLAGS
    assert why in tool("encode", "photo.png", *out, *masks, *flags, code=2).err
    assert (place / "out.pxi").read_bytes() == b"precious"


@pytest.mark.parametrize("flag", [("--behind", "without.png"), ("--background", "smooth")])
def test_inputs_in_layers_hide_nothing(tool, place, small_pxi, flag):
    tool("decode", small_pxi, "a.ora")
    why = f"{flag[0]}: the layers of the input hide nothing unknown"
    assert why in tool("encode", "a.ora", *flag, code=2).err
    assert why in tool("encode", "masks", "a.pxi", "--stack", *flag, code=2).err


def test_photoshop_files_keep_their_layers(tool, place):
    psd_tools = pytest.importorskip("psd_tools")
    layered = psd_tools.PSDImage.new("RGB", (WIDTH, HEIGHT))
    layered.create_pixel_layer_from_array(flat(GROUND), name="back")
    layered.save("a.psd")
    ran = tool("encode", "a.psd", "--behind", "without.png", code=2)
    assert "--behind: the layers of the input hide nothing unknown" in ran.err
    tool("encode", "a.psd", "b.pxi", *FLAGS, "--behind", "without.png")  # taken flat
