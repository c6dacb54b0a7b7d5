"""pxi-decode: every flag, and every way to fail."""

import os
import zipfile

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec import encode
from proxyimg_codec.io.raster import read
from proxyimg_codec.render import engines

pytest.importorskip("OpenImageIO")


@pytest.fixture
def decode(tool, small_pxi, tmp_path):
    """decode(*flags, suffix) renders the small file and gives the pixels."""

    def call(*flags, suffix: str = ".png") -> np.ndarray:
        out = tmp_path / f"out{suffix}"
        tool("decode", small_pxi, out, "-f", *flags)
        return read(out).pixels

    return call


@pytest.fixture
def image(small_pxi):
    return pxi.open(small_pxi)


@pytest.fixture(scope="session")
def soft_pxi(tmp_path_factory):
    """A file with transparency: 24x16 pixels, alpha rising from left to right."""
    y, x = np.mgrid[0:16, 0:24]
    picture = np.dstack([8 * x, 9 * y, 99 + 0 * x, 10 * x + 10]).astype(np.uint8)
    path = tmp_path_factory.mktemp("soft") / "soft.pxi"
    encode(picture, effort=1, jobs=1).save(path)
    return path


def test_pixels_name_and_report(tool, small_pxi, tmp_path, image):
    copy = tmp_path / "a.pxi"
    copy.write_bytes(small_pxi.read_bytes())
    ran = tool("decode", copy)
    assert ran.out == b""
    assert str(tmp_path / "a.png") in ran.err
    np.testing.assert_array_equal(read(tmp_path / "a.png").pixels, image.render())
    assert tool("decode", copy, "--quiet", "-f").err == ""


def test_launcher_with_pipes(launch, small_pxi, tmp_path, image):
    ran = launch("decode", "-", "--quiet", input=small_pxi.read_bytes())
    assert ran.err == ""
    (tmp_path / "a.png").write_bytes(ran.out)
    np.testing.assert_array_equal(read(tmp_path / "a.png").pixels, image.render())


@pytest.mark.parametrize(
    ("flags", "size"),
    [
        (("--scale", "2"), (128, 96)),
        (("--scale", "0.25"), (16, 12)),
        (("--scale", "1e-9"), (1, 1)),
        (("--width", "100"), (100, 75)),
        (("--height", "24"), (32, 24)),
        (("--width", "31", "--height", "17"), (31, 17)),
        (("--region", "5,6,20,10"), (20, 10)),
        (("--region", "5,6,20,10", "--scale", "3"), (60, 30)),
        (("--region", "5,6,20,10", "--width", "10"), (10, 5)),
    ],
    ids=str,
)
def test_size(decode, flags, size):
    assert decode(*flags).shape == (size[1], size[0], 3)


def test_region_is_a_part_of_the_whole(decode, image):
    np.testing.assert_array_equal(
        decode("--region", "20,12,30,20"), image.render()[12:32, 20:50]
    )  # fmt: skip


@pytest.mark.parametrize("flag", ["disc", "2", "-1"])
def test_layer_by_name_and_index(decode, small_masks, flag):
    pixels = decode("--layer", flag)
    drawn, mask = pixels[..., 3] >= 128, small_masks["disc"]
    assert (drawn & mask).sum() > 0.95 * (drawn | mask).sum()


def test_layers_together_and_without_background(decode, image):
    front = decode("--layer", "disc", "--layer", "bar")
    np.testing.assert_array_equal(front, decode("--no-background"))
    np.testing.assert_array_equal(front, image.render(background=False))
    np.testing.assert_array_equal(
        decode("--layer", "0", "--layer", "1", "--layer", "2"), image.render()
    )


@pytest.mark.parametrize(
    ("bits", "suffix", "dtype"),
    [(8, ".png", "uint8"), (16, ".png", "uint16"), (16, ".ppm", "uint16"), (8, ".npy", "uint8"),
     (32, ".npy", "float32"), (32, ".tif", "float32"), (16, ".tif", "uint16")],
)  # fmt: skip
def test_bit_depth(decode, image, bits, suffix, dtype):
    pixels = decode("--bit-depth", bits, suffix=suffix)
    assert pixels.dtype == dtype
    top = 1 if bits == 32 else 2**bits - 1
    np.testing.assert_allclose(pixels / top, image.render(dtype=np.float32), atol=0.51 / 255)
    if bits > 8:
        assert len(np.unique(pixels)) > 256


@pytest.mark.parametrize("engine", ["numpy", "native", "ort"])
def test_engines_agree(decode, image, engine, monkeypatch):
    if engine == "ort":
        pytest.importorskip("onnxruntime")
    if engine == "native" and not engines.kernel.available():
        pytest.skip("the kernel is not compiled")
    used = []
    run = engines.find(engine)
    monkeypatch.setitem(engines.BUILT_IN, engine, lambda *a: used.append(engine) or run(*a))
    pixels = decode("--engine", engine).astype(int)
    assert used
    assert abs(pixels - image.render(engine="numpy")).max() <= 1


def test_metadata_is_handed_on(tool, tmp_path):
    blocks = {"exif": b"II*\0\x08\0\0\0\0\0\0\0\0\0", "xmp": b"<x:xmpmeta/>"}
    encode(np.full((4, 4, 3), 9, np.uint8), blocks=blocks).save(tmp_path / "a.pxi")
    tool("decode", tmp_path / "a.pxi")
    assert read(tmp_path / "a.png").blocks == blocks


def test_transparency_is_written(tool, soft_pxi, tmp_path):
    tool("decode", soft_pxi, tmp_path / "a.png", "--no-background")
    pixels = read(tmp_path / "a.png").pixels
    assert pixels.shape == (16, 24, 4)
    assert pixels[:, 20:, 3].min() > pixels[:, :4, 3].max()
    for name in ("a.ppm", "a.jpg"):
        assert "PNG" in tool("decode", soft_pxi, tmp_path / name, code=2).err


# Time


@pytest.mark.parametrize("t", [0.4, 0, -0.35, 1e9])
def test_a_time_of_a_motion(tool, moving_pxi, tmp_path, t):
    image = pxi.open(moving_pxi)
    tool("decode", moving_pxi, tmp_path / "a.png", "--time", t, "--layer", "disc", "--width", 90)
    pixels = read(tmp_path / "a.png").pixels
    np.testing.assert_array_equal(pixels, image.render(t=t, layers=["disc"], width=90))
    assert (pixels != image.render(layers=["disc"], width=90)).any()
    tool("decode", moving_pxi, tmp_path / "b.png")
    np.testing.assert_array_equal(read(tmp_path / "b.png").pixels, image.render())


def test_the_layers_of_a_moment(tool, moving_pxi, tmp_path):
    tool("decode", moving_pxi, tmp_path / "a.ora", "--time", "0.4")
    with zipfile.ZipFile(tmp_path / "a.ora") as archive:
        (tmp_path / "a.png").write_bytes(archive.read("mergedimage.png"))
    merged = read(tmp_path / "a.png").pixels[..., :3].astype(int)
    assert abs(merged - pxi.open(moving_pxi).render(t=0.4)).max() <= 2


@pytest.mark.parametrize("t", ["nan", "inf", "-inf", "1e305", "soon", ""])
def test_what_is_no_time(tool, moving_pxi, tmp_path, t):
    tool("decode", moving_pxi, tmp_path / "a.png", f"--time={t}", code=2)
    assert not os.listdir(tmp_path)


def test_a_time_of_what_does_not_move(tool, small_pxi, moving_pxi, tmp_path):
    err = tool("decode", small_pxi, tmp_path / "a.png", "--time", "0", code=2).err
    assert "does not move" in err
    err = tool("decode", moving_pxi, tmp_path / "a.svg", "--time", "0.4", code=2).err
    assert "--time" in err
    err = tool("decode", moving_pxi, "--export-onnx", tmp_path / "a", "--time", "0", code=2).err
    assert "--time" in err
    assert not os.listdir(tmp_path)


# ONNX


@pytest.mark.parametrize("flags", [(), ("--layer", "disc")])
def test_export_onnx(tool, small_pxi, tmp_path, image, flags):
    ort = pytest.importorskip("onnxruntime")
    path = tmp_path / "net.onnx"
    tool("decode", small_pxi, "--export-onnx", path, *flags)
    assert os.listdir(tmp_path) == ["net.onnx"]
    network = image.networks[0]
    features = np.random.default_rng(0).normal(0, 0.3, (50, network.shape.dim)).astype(np.float32)
    session = ort.InferenceSession(path.read_bytes(), providers=["CPUExecutionProvider"])
    (colour,) = session.run(None, {session.get_inputs()[0].name: features})
    np.testing.assert_allclose(colour, network(features), atol=1e-3)


def test_export_onnx_and_render(tool, small_pxi, tmp_path):
    pytest.importorskip("onnx")
    tool("decode", small_pxi, tmp_path / "a.png", "--export-onnx", tmp_path / "a.onnx", "--quiet")
    assert sorted(os.listdir(tmp_path)) == ["a.onnx", "a.png"]
    assert tool("decode", small_pxi, "--export-onnx", tmp_path / "a.onnx", code=3).err
    tool("decode", small_pxi, "--export-onnx", tmp_path / "a.onnx", "-f")


@pytest.mark.parametrize(
    ("flags", "wanted"),
    [
        ((), {}),
        (("--graph", "full", "--layer", "disc", "--time", "0.4"), {"layers": ["disc"], "t": 0.4}),
        (("--graph", "full", "--no-background"), {"background": False}),
    ],
    ids=["nothing", "layer and time", "no background"],
)
def test_export_the_renderer(tool, moving_pxi, tmp_path, flags, wanted):
    """What flags choose of the picture, they choose of the model."""
    ort = pytest.importorskip("onnxruntime")
    path = tmp_path / "a.onnx"
    tool("decode", moving_pxi, "--export-onnx", path, "--graph", "full", *flags)
    assert os.listdir(tmp_path) == ["a.onnx"]
    image = pxi.open(moving_pxi)
    centres = np.meshgrid(np.arange(image.width) + 0.5, np.arange(image.height) + 0.5)
    inputs = {"points": np.stack(centres, 2).reshape(-1, 2), "pixel_size": np.ones(2)}
    session = ort.InferenceSession(path.read_bytes(), providers=["CPUExecutionProvider"])
    (colour,) = session.run(None, inputs)
    expected = image.render(**wanted, dtype=np.float32)
    if expected.shape[2] == 4:
        expected[..., :3] *= expected[..., 3:]
    found = colour.reshape(image.height, image.width, 4)[..., : expected.shape[2]]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_a_picture_and_its_renderer_show_the_same_moment(tool, moving_pxi, tmp_path):
    pytest.importorskip("onnx")
    one, other = tmp_path / "a.onnx", tmp_path / "b.onnx"
    flags = "--graph", "full", "--time", "0.4"
    tool("decode", moving_pxi, "--export-onnx", one, *flags)
    tool("decode", moving_pxi, tmp_path / "b.png", "--export-onnx", other, *flags)
    assert one.read_bytes() == other.read_bytes()


def test_flags_of_the_renderer(tool, small_pxi, tmp_path):
    assert "--export-onnx" in tool("decode", small_pxi, "--graph", "full", code=2).err
    export = "decode", small_pxi, "--export-onnx", tmp_path / "a.onnx"
    err = tool(*export, "--graph", "network", "--no-background", code=2).err
    assert "--no-background" in err
    assert "--scale" in tool(*export, "--graph", "full", "--scale", "2", code=2).err
    assert "'cat'" in tool(*export, "--graph", "full", "--layer", "cat", code=2).err
    assert "does not move" in tool(*export, "--graph", "full", "--time", "1", code=2).err
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize(
    "flags",
    [
        ("--scale", "0"),
        ("--width", "0"),
        ("--height", "5"),
        ("--region", "0,0,1,1"),
        ("--no-background",),
        ("--bit-depth", "8"),
        ("--engine", "numpy"),
    ],
    ids=" ".join,
)
def test_flags_for_pictures_need_a_picture(tool, small_pxi, tmp_path, flags):
    err = tool("decode", small_pxi, "--export-onnx", tmp_path / "a.onnx", *flags, code=2).err
    assert flags[0] in err
    assert not os.listdir(tmp_path)


def test_two_outputs_need_two_places(tool, small_pxi, tmp_path):
    tool("decode", small_pxi, tmp_path / "a", "--export-onnx", tmp_path / "a", code=2)
    tool("decode", small_pxi, "-", "--export-onnx", "-", code=2)


# Refusals


@pytest.mark.parametrize(
    "flags",
    [
        ("--scale", "0"),
        ("--scale", "-1"),
        ("--scale", "nan"),
        ("--scale", "inf"),
        ("--scale", "2", "--width", "5"),
        ("--width", "0"),
        ("--height", "-3"),
        ("--width", "1.5"),
        ("--region", "1,2,3"),
        ("--region", "0,0,0,5"),
        ("--region", "-1,0,5,5"),
        ("--region", "60,0,5,5"),
        ("--region", "a,b,c,d"),
        ("--layer", "cat"),
        ("--layer", "3"),
        ("--layer", "-4"),
        ("--layer", "9" * 5000),
        ("--bit-depth", "12"),
        ("--bit-depth", "32"),
        ("--engine", "gpu"),
        ("--unknown",),
    ],
    ids=lambda f: " ".join(f)[:30],
)
def test_usage_errors(tool, small_pxi, tmp_path, flags):
    tool("decode", small_pxi, tmp_path / "a.png", *flags, code=2)
    assert not os.listdir(tmp_path)


def test_a_missing_layer_is_answered_with_the_names(tool, small_pxi, tmp_path):
    err = tool("decode", small_pxi, tmp_path / "a.png", "--layer", "cat", code=2).err
    assert "'back', 'bar', 'disc'" in err


@pytest.mark.parametrize(
    ("name", "flags", "code"),
    [
        ("a.txt", (), 5),
        ("a", (), 2),
        ("a.jpg", ("--bit-depth", "16"), 2),
        ("a.png", ("--width", "100000000"), 6),
        ("missing/a.png", (), 3),
        ("", (), 2),
    ],
)
def test_impossible_outputs(tool, small_pxi, tmp_path, name, flags, code):
    target = tmp_path / name if name else ""
    tool("decode", small_pxi, target, *flags, code=code)
    assert not os.listdir(tmp_path)


def test_output_that_is_there_is_kept_without_force(tool, small_pxi, tmp_path):
    out = tmp_path / "a.png"
    out.write_bytes(b"precious")
    assert "--force" in tool("decode", small_pxi, out, code=3).err
    tool("decode", small_pxi, out, "-f", "--scale", "-1", code=2)
    assert out.read_bytes() == b"precious"
    tool("decode", small_pxi, out, "--force")
    assert read(out).pixels.shape == (48, 64, 3)


def test_the_input_is_never_overwritten(tool, small_pxi):
    before = small_pxi.read_bytes()
    tool("decode", small_pxi, small_pxi, "-f", code=2)
    tool("decode", small_pxi, "--export-onnx", small_pxi, "-f", code=2)
    assert small_pxi.read_bytes() == before


@pytest.mark.parametrize(("suffix", "code"), [(".jp2", (0, 5)), (".tif", 0), (".x", 5)])
def test_image_libraries_print_nothing_of_their_own(launch, tmp_path, suffix, code):
    """OpenImageIO 3 cannot write tiny JPEG 2000, and prints errors that nobody asked about."""
    encode(np.full((4, 4, 3), 9, np.uint8)).save(tmp_path / "a.pxi")
    ran = launch("decode", tmp_path / "a.pxi", tmp_path / f"b{suffix}", "--quiet", code=code)
    assert ran.code or ran.err == ""


def broken(data: bytes, kind: str) -> bytes:
    middle = len(data) // 2
    return {
        "empty": b"",
        "text": b"hello",
        "png": b"\x89PNG\r\n\x1a\n" + bytes(50),
        "truncated": data[:middle],
        "flipped": data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :],
        "longer": data + b"\0",
    }[kind]


@pytest.mark.parametrize("kind", ["empty", "text", "png", "truncated", "flipped", "longer"])
@pytest.mark.parametrize("name", ["decode", "info"])
def test_invalid_files(tool, small_pxi, tmp_path, name, kind):
    (tmp_path / "a.pxi").write_bytes(broken(small_pxi.read_bytes(), kind))
    tool(name, tmp_path / "a.pxi", code=4)
    tool(name, "-", code=4, stdin=broken(small_pxi.read_bytes(), kind))
    assert os.listdir(tmp_path) == ["a.pxi"]


@pytest.mark.parametrize("name", ["decode", "info"])
def test_unreadable_files(tool, tmp_path, name):
    assert "missing.pxi" in tool(name, tmp_path / "missing.pxi", code=3).err
    (tmp_path / "folder").mkdir()
    tool(name, tmp_path / "folder", code=3)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
@pytest.mark.parametrize("args", [("decode", "-"), ("info",), ("info", "--json")])
def test_a_full_standard_output(launch, small_pxi, args):
    with open("/dev/full", "wb") as full:
        launch(args[0], small_pxi, *args[1:], code=3, stdout=full)


def test_closed_standard_streams(launch, small_pxi):
    launch("decode", "-", "-", code=3, first="exec <&-")
    launch("decode", small_pxi, "-", code=3, first="exec >&-")
