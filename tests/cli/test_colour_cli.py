"""Colours, metadata and frames through the tools: what is carried, converted, refused and said."""

import io
import json
import re

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.io.color import to_srgb
from proxyimg_codec.io.raster import read, write
from tests.support.profiles import P3, SRGB, between, chrm, gama, png_of, to_light, to_numbers

oiio = pytest.importorskip("OpenImageIO")
pytest.importorskip("imagecodecs")
Image = pytest.importorskip("PIL.Image")

TINY = ("-e", "1", "-j", "1", "--layers", "1", "-q", "90")
DISPLAY_P3, PQ = (bytes([*two, 0, 1]) for two in ((12, 13), (9, 16)))


def ramp(height=22, width=45):
    """Smooth uint8 picture."""
    y, x = np.mgrid[0:height, 0:width]
    return np.dstack([50 + 4 * x, 60 + 7 * y, 200 - 3 * x]).astype(np.uint8)


@pytest.fixture
def through(tool, tmp_path):
    """through(data, name, *flags) encodes a file, and gives the picture, and what was said."""

    def call(data: bytes, name: str, *flags: str, code: int = 0):
        (tmp_path / name).write_bytes(data)
        out = tmp_path / "out.pxi"
        ran = tool("encode", tmp_path / name, out, "-f", *TINY, *flags, code=code)
        return (pxi.open(out) if not code else None), ran.err

    return call


@pytest.fixture
def wide_pxi(tmp_path):
    path = tmp_path / "wide.pxi"
    pxi.encode(ramp(), effort=1, jobs=1, max_layers=1, blocks={"cicp": DISPLAY_P3}).save(path)
    return path


def exr(tmp_path, light) -> bytes:
    spec = oiio.ImageSpec(light.shape[1], light.shape[0], 3, "float")
    target = oiio.ImageOutput.create("a.exr")
    assert target.open(str(tmp_path / "made.exr"), spec)
    target.write_image(light.astype(np.float32))
    target.close()
    return (tmp_path / "made.exr").read_bytes()


def test_linear_light_is_encoded_as_srgb(through, tmp_path):
    image, said = through(exr(tmp_path, to_light(ramp() / 255)), "a.exr")
    assert "pxi-encode: warning: " in said
    assert "a.exr: converted from linear light to sRGB" in said
    assert image.blocks == {}
    assert abs(image.render().astype(int) - ramp()).mean() < 4
    _, said = through(exr(tmp_path, to_light(ramp() / 255)), "a.exr", "--quiet")
    assert said == ""


def test_light_beyond_white_needs_a_flag(through, tmp_path):
    light = to_light(ramp() / 255) * 3
    _, said = through(exr(tmp_path, light), "a.exr", code=3)
    assert "--tone clip" in said
    image, _ = through(exr(tmp_path, light), "a.exr", "--tone", "clip")
    wanted = np.rint(to_numbers(light) * 255)
    assert abs(image.render().astype(int) - wanted).mean() < 5
    light[3, 4, 1] = np.nan
    for flags in ((), ("--tone", "clip")):
        assert "NaN" in through(exr(tmp_path, light), "a.exr", *flags, code=3)[1]


@pytest.mark.parametrize("cicp", [DISPLAY_P3, PQ])
def test_png_colours_come_through(through, tool, tmp_path, cicp):
    image, said = through(png_of(ramp(), (b"cICP", cicp)), "a.png")
    assert "warning" not in said
    assert image.blocks == {"cicp": cicp}
    assert json.loads(tool("info", tmp_path / "out.pxi", "--json").out)["cicp"] == {
        "primaries": cicp[0], "transfer": cicp[1],
    }  # fmt: skip
    said = f"colour: primaries {cicp[0]}, transfer {cicp[1]} of H.273"
    assert said in tool("info", tmp_path / "out.pxi").out.decode()
    ran = tool("decode", tmp_path / "out.pxi", tmp_path / "out.png", "-f")
    assert "warning" not in ran.err
    assert read(tmp_path / "out.png").blocks == {"cicp": cicp}


def test_gamma_and_primaries_come_through_as_a_profile(through, tool, tmp_path):
    image, _ = through(png_of(ramp(), gama(60000), chrm(P3)), "a.png")
    assert set(image.blocks) == {"icc"}
    tool("decode", tmp_path / "out.pxi", tmp_path / "srgb.png", "--srgb")
    light = (ramp() / 255) ** (1 / 0.6) @ between(P3, SRGB).T
    shown = read(tmp_path / "srgb.png")
    assert shown.blocks == {}
    assert abs(shown.pixels - to_numbers(light) * 255).mean() < 4


def test_stripping_converts(through):
    image, said = through(png_of(ramp(), (b"cICP", DISPLAY_P3)), "a.png", "--strip")
    assert "converted to sRGB" in said
    assert image.blocks == {}
    wanted = to_srgb(ramp(), {"cicp": DISPLAY_P3}) * 255
    assert abs(image.render() - wanted).mean() < 4


def test_edits_and_undo_keep_the_colour(tool, wide_pxi, tmp_path):
    tool("edit", wide_pxi, tmp_path / "b.pxi", "--opacity", "0", "1")
    edited = pxi.open(tmp_path / "b.pxi")
    assert edited.blocks == edited.undone().blocks == {"cicp": DISPLAY_P3}


@pytest.mark.parametrize("depth", ["8", "16", "32"])
def test_decoding_to_srgb(tool, wide_pxi, tmp_path, depth):
    name = tmp_path / ("a.npy" if depth == "32" else "a.png")
    ran = tool("decode", wide_pxi, name, "--srgb", "--bit-depth", depth)
    assert "warning" not in ran.err
    found = np.load(name) if depth == "32" else read(name).pixels
    wanted = to_srgb(pxi.open(wide_pxi).render(dtype="float32"), {"cicp": DISPLAY_P3})
    top = {"8": 255, "16": 65535, "32": 1}[depth]
    np.testing.assert_allclose(found, wanted * top, atol=0.51 if top > 1 else 1e-6)
    if name.suffix == ".png":
        assert read(name).blocks == {}


def test_srgb_files_are_decoded_alike_with_srgb(tool, small_pxi, tmp_path):
    for name, flags in (("a.png", ()), ("b.png", ("--srgb",))):
        tool("decode", small_pxi, tmp_path / name, *flags)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".webp"])
def test_profiles_are_made_for_types_that_hold_only_those(tool, wide_pxi, tmp_path, suffix):
    ran = tool("decode", wide_pxi, tmp_path / f"a{suffix}")
    assert "warning" not in ran.err
    with Image.open(tmp_path / f"a{suffix}") as source:
        assert source.info["icc_profile"][16:20] == b"RGB "


@pytest.mark.parametrize("suffix", [".bmp", ".ppm", ".npy"])
def test_lost_colours_are_said(tool, wide_pxi, tmp_path, suffix):
    ran = tool("decode", wide_pxi, tmp_path / f"a{suffix}")
    assert f"a{suffix}: {suffix} cannot say what colours these are" in ran.err
    assert tool("decode", wide_pxi, tmp_path / f"b{suffix}", "--quiet").err == ""
    assert "warning" not in tool("decode", wide_pxi, tmp_path / f"c{suffix}", "--srgb").err


@pytest.mark.parametrize("suffix", [".ora", ".svg"])
def test_layers_are_not_converted(tool, wide_pxi, tmp_path, suffix):
    assert "--srgb" in tool("decode", wide_pxi, tmp_path / f"a{suffix}", "--srgb", code=2).err


def test_outlines_have_srgb_colours(tool, tmp_path):
    skin = np.full((13, 21, 3), (190, 100, 80), np.uint8)
    image = pxi.encode(skin, effort=1, jobs=1, max_layers=1, blocks={"cicp": DISPLAY_P3})
    image.save(tmp_path / "in.pxi")
    ran = tool("decode", tmp_path / "in.pxi", tmp_path / "a.svg")
    assert "warning" not in ran.err
    (fill,) = re.findall('fill="#(..)(..)(..)"', (tmp_path / "a.svg").read_text())
    mean = image.render(dtype="float32").mean((0, 1))
    wanted = to_numbers(between(P3, SRGB) @ to_light(mean))
    assert np.abs(wanted - mean).max() > 0.02
    np.testing.assert_allclose([int(v, 16) / 255 for v in fill], wanted, atol=0.004)


@pytest.mark.parametrize("suffix", [".ora", ".svg"])
def test_lost_metadata_of_layers_is_said(tool, tmp_path, suffix):
    blocks = {"cicp": DISPLAY_P3, "xmp": b"<x:xmpmeta/>"}
    image = pxi.encode(ramp(), effort=1, jobs=1, max_layers=1, blocks=blocks)
    image.save(tmp_path / "in.pxi")
    ran = tool("decode", tmp_path / "in.pxi", tmp_path / f"a{suffix}")
    assert ran.err.count("warning") == 1
    assert f"{suffix} does not take this XMP; left out" in ran.err
    assert tool("decode", tmp_path / "in.pxi", tmp_path / f"b{suffix}", "--quiet").err == ""


def test_types_of_linear_light_have_more_bits_by_default(tool, small_pxi, tmp_path):
    tool("decode", small_pxi, tmp_path / "a.exr")
    wanted = pxi.open(small_pxi).render(dtype="float32")
    np.testing.assert_allclose(read(tmp_path / "a.exr").pixels, wanted, atol=1e-3)


def test_metadata_comes_through_every_type(through, tool, tmp_path):
    exif = Image.Exif()
    exif[0x0112], exif[0x010F] = 8, "A maker"
    exif.get_ifd(0x8769)[0x9003] = "2018:02:03 04:05:06"
    out = io.BytesIO()
    Image.fromarray(ramp()).save(out, "jpeg", exif=exif, quality=95)
    image, said = through(out.getvalue(), "a.jpg")
    assert "warning" not in said
    assert (image.width, image.height) == (22, 45)
    for suffix in (".png", ".jpg", ".tif", ".webp"):
        ran = tool("decode", tmp_path / "out.pxi", tmp_path / f"o{suffix}")
        assert "warning" not in ran.err
        with Image.open(tmp_path / f"o{suffix}") as source:
            found = source.getexif()
            assert source.size == (22, 45)
            assert found.get(0x0112, 1) == 1
            assert found[0x010F] == "A maker"
            assert found.get_ifd(0x8769)[0x9003] == "2018:02:03 04:05:06"
    said = tool("decode", tmp_path / "out.pxi", tmp_path / "o.bmp").err
    assert "pxi-decode: warning: " in said
    assert "EXIF" in said


def pictures(kind):
    found = [Image.fromarray(np.roll(ramp(), 11 * k, axis=1)) for k in range(3)]
    out = io.BytesIO()
    how = {"lossless": True} if kind == "webp" else {}
    found[0].save(out, kind, save_all=True, append_images=found[1:], **how)
    return out.getvalue(), [np.asarray(v) for v in found]


@pytest.mark.parametrize("kind", ["gif", "png", "webp", "tiff"])
def test_one_frame_of_several(through, kind):
    data, frames = pictures(kind)
    image, said = through(data, "a")
    assert "it holds 3 pictures, of which number 0 is taken" in said
    assert abs(image.render().astype(int) - frames[0]).mean() < 9
    image, said = through(data, "a", "--frame", "2")
    assert "warning" not in said
    assert abs(image.render().astype(int) - frames[2]).mean() < 9
    for number in ("3", "-1"):
        assert "3 pictures" in through(data, "a", f"--frame={number}", code=3)[1]


def test_layers_of_an_ora_file_are_no_frames(tool, small_pxi, tmp_path):
    tool("decode", small_pxi, tmp_path / "a.ora")
    for flags in (("--frame", "0"), ("--tone", "clip")):
        assert flags[0] in tool("encode", tmp_path / "a.ora", *flags, code=2).err


@pytest.mark.parametrize("dtype", [np.uint32, np.uint64, np.float16, np.float64, np.bool_])
def test_arrays_of_any_width(through, dtype):
    top = 1 if np.dtype(dtype).kind in "fb" else int(np.iinfo(dtype).max)
    shares = ramp() / 255 if dtype is not np.bool_ else ramp() > 128
    out = io.BytesIO()
    np.save(out, (shares * top).astype(dtype) if dtype is not np.uint64 else np.uint64(
        ramp()) * np.uint64(top // 255))  # fmt: skip
    image, _ = through(out.getvalue(), "a.npy")
    assert abs(image.render() / 255 - shares).mean() < 0.03


def test_arrays_that_have_a_sign_are_refused(through):
    out = io.BytesIO()
    np.save(out, ramp().astype(np.int64))
    assert "int64" in through(out.getvalue(), "a.npy", code=3)[1]


def test_clips_are_srgb(tool, tmp_path, moving_pxi):
    pytest.importorskip("av")
    from dataclasses import replace

    image = pxi.open(moving_pxi)
    picture = replace(image.picture, blocks={"cicp": DISPLAY_P3})
    type(image)(picture).save(tmp_path / "wide.pxi")
    for name in ("wide", "plain"):
        source = moving_pxi if name == "plain" else tmp_path / "wide.pxi"
        tool("animate", source, tmp_path / f"{name}-%d.png", "--fps", "2")
    wide, plain = (read(tmp_path / f"{n}-1.png").pixels for n in ("wide", "plain"))
    wanted = to_srgb(plain, {"cicp": DISPLAY_P3}) * 255
    np.testing.assert_allclose(wide, wanted, atol=0.51)


def test_a_picture_as_texture_is_taken_as_srgb(tool, small_pxi, tmp_path):
    write(tmp_path / "wide.png", np.full((9, 9, 3), (200, 90, 60), np.uint8), {"cicp": DISPLAY_P3})
    write(tmp_path / "plain.png", np.full((9, 9, 3), (200, 90, 60), np.uint8))
    found = []
    for name in ("wide", "plain"):
        out = tmp_path / f"{name}.pxi"
        tool("edit", small_pxi, out, "--texture", f"disc={tmp_path / name}.png")
        image = pxi.open(out)
        x, y, w, h = image.layers["disc"].box
        found.append(image.render()[y + h // 2, x + w // 2].astype(int))
    wanted = to_srgb(np.full((1, 1, 3), (200, 90, 60), np.uint8), {"cicp": DISPLAY_P3})[0, 0] * 255
    assert abs(found[0] - wanted).max() < 8
    assert abs(found[1] - [200, 90, 60]).max() < 8
