"""Colours of picture files: linear light, PNG's chunks, profiles, H.273, and conversion to sRGB."""

import struct

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, UnsupportedError
from proxyimg_codec.io import color
from proxyimg_codec.io.raster import Picture, parse, read, stripped, write
from tests.support.pictures import icc
from tests.support.profiles import (
    BT2020,
    MIXTURES,
    P3,
    SRGB,
    between,
    chrm,
    cmyk_icc,
    gama,
    grey_icc,
    iccp,
    png_of,
    tiff_of,
    to_light,
    to_numbers,
)

oiio = pytest.importorskip("OpenImageIO")
imagecodecs = pytest.importorskip("imagecodecs")
Image = pytest.importorskip("PIL.Image")

PQ = bytes([9, 16, 0, 1])
HLG = bytes([9, 18, 0, 1])
DISPLAY_P3 = bytes([12, 13, 0, 1])


def colours(height=5, width=13, dtype=np.uint8):
    top = np.iinfo(dtype).max
    return np.random.default_rng(7).integers(0, top, (height, width, 3), dtype, endpoint=True)


def save(path, pixels, **attributes):
    """Writes floating-point pixels with OpenImageIO; __ in an attribute stands for a colon."""
    pixels = np.asarray(pixels, np.float32)
    target = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "float")
    for name, value in attributes.items():
        kind = (oiio.TypeDesc(f"float[{len(value)}]"),) if isinstance(value, tuple) else ()
        spec.attribute(name.replace("__", ":"), *kind, value)
    assert target.open(str(path), spec), target.geterror()
    assert target.write_image(pixels)
    assert target.close()
    return path


# Linear light


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pfm"])
@pytest.mark.parametrize("channels", [1, 3])
def test_linear_types_become_srgb(tmp_path, suffix, channels):
    if suffix == ".hdr" and channels == 1:
        pytest.skip("Radiance has three channels")
    numbers = np.linspace(0.02, 1, 21 * channels).reshape(1, 21, channels)
    picture = read(save(tmp_path / f"a{suffix}", to_light(numbers)))
    assert picture.pixels.dtype == np.float32
    np.testing.assert_allclose(picture.pixels, numbers, atol=0.02 if suffix == ".hdr" else 2e-5)
    assert picture.blocks == {}
    assert any("linear" in note for note in picture.notes)


def test_linear_light_with_primaries_becomes_srgb(tmp_path):
    inside = 0.3 + 0.4 * np.random.default_rng(1).random((3, 7, 3))  # sRGB can show it
    light = inside @ between(SRGB, BT2020).T
    pixels = read(save(tmp_path / "a.exr", light, chromaticities=BT2020)).pixels
    np.testing.assert_allclose(pixels, to_numbers(inside), atol=1e-4)


def test_an_exr_file_that_says_srgb_is_left_as_it_is(tmp_path):
    numbers = np.linspace(0, 1, 24).reshape(1, 8, 3).astype(np.float32)
    path = save(tmp_path / "a.exr", numbers, oiio__ColorSpace="srgb_rec709_scene")
    picture = read(path)
    np.testing.assert_allclose(picture.pixels, numbers, atol=1e-6)
    assert picture.notes == ()


@pytest.mark.parametrize(
    ("space", "blocks"),
    [
        ("srgb_p3d65_scene", {"cicp": DISPLAY_P3}),
        ("pq_rec2020_display", {"cicp": PQ}),
        ("g22_rec709_scene", {"cicp": bytes([1, 4, 0, 1])}),
        ("g22_adobergb_scene", "icc"),
        ("lin_rec2020_scene", {}),
        ("lin_ap1_scene", {}),
    ],
)
def test_colour_spaces_that_openexr_names(tmp_path, space, blocks):
    path = save(tmp_path / "a.exr", np.full((3, 4, 3), 0.25), oiio__ColorSpace=space)
    picture = read(path)
    assert picture.blocks == blocks or set(picture.blocks) == {blocks}
    white = to_numbers(0.25) if space.startswith("lin") else 0.25  # grey is grey in all of them
    np.testing.assert_allclose(picture.pixels, white, atol=1e-4)


def test_alpha_is_not_converted_and_colour_is_straight(tmp_path):
    alpha = np.array([[[0.25], [0.5], [1.0], [0.0]]])
    light = np.concatenate([np.full((1, 4, 3), 0.2) * alpha, alpha], axis=2)
    pixels = read(save(tmp_path / "a.exr", light)).pixels
    np.testing.assert_allclose(pixels[..., 3:], alpha)
    np.testing.assert_allclose(pixels[:, :3, :3], to_numbers(0.2), atol=1e-4)


@pytest.mark.parametrize("brightest", [1.7, 40.0])
def test_light_beyond_white_is_kept_to_be_refused_or_clipped(tmp_path, brightest):
    light = np.linspace(0, brightest, 27).reshape(1, 9, 3)
    path = save(tmp_path / "a.exr", light)
    assert read(path).pixels.max() > 1.2
    clipped = read(path, clip=True).pixels
    np.testing.assert_allclose(clipped, to_numbers(light), atol=1e-4)


def test_bright_light_that_is_half_transparent_is_not_clipped_in_silence(tmp_path):
    path = save(tmp_path / "a.exr", [[[0.9, 0.2, 0.2, 0.5]]])
    assert read(path).pixels[0, 0, 0] > 1


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_light_that_is_no_number_stays_so(tmp_path, wrong):
    light = np.full((2, 2, 3), 0.5)
    light[1, 1, 1] = wrong
    pixels = read(save(tmp_path / "a.exr", light)).pixels
    assert not np.isfinite(pixels).all()


def test_a_colour_space_that_nobody_knows_is_refused(tmp_path):
    path = save(tmp_path / "a.dpx", np.full((4, 4, 3), 0.5), oiio__ColorSpace="KodakLog")
    with pytest.raises(UnsupportedError, match="convert the picture to sRGB"):
        read(path)


@pytest.mark.parametrize("suffix", [".exr", ".pfm", ".hdr"])
def test_linear_types_are_written_in_linear_light(tmp_path, suffix):
    numbers = np.linspace(0, 1, 27, dtype=np.float32).reshape(1, 9, 3)
    assert write(tmp_path / f"a{suffix}", numbers) == ()
    source = oiio.ImageInput.open(str(tmp_path / f"a{suffix}"))
    stored = source.read_image("float")
    source.close()
    np.testing.assert_allclose(stored, to_light(numbers), atol=1e-2)
    back = read(tmp_path / f"a{suffix}").pixels
    np.testing.assert_allclose(back, numbers, atol=0.02 if suffix == ".hdr" else 1e-4)


def test_linear_types_are_written_from_the_colours_that_the_blocks_say(tmp_path):
    light = np.full((2, 3, 3), (0.5, 0.2, 0.1))
    numbers = to_numbers(light @ between(SRGB, P3).T).astype(np.float32)
    assert write(tmp_path / "a.exr", numbers, {"cicp": DISPLAY_P3}) == ()
    np.testing.assert_allclose(read(tmp_path / "a.exr").pixels, to_numbers(light), atol=1e-4)


# PNG


def adopted(*chunks, pixels=None):
    return parse(png_of(colours() if pixels is None else pixels, *chunks), "a.png")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_linear_png_becomes_srgb_with_more_bits(dtype):
    pixels = colours(dtype=dtype)
    picture = adopted(gama(100000), pixels=pixels)
    wanted = to_numbers(pixels / np.iinfo(dtype).max)
    np.testing.assert_allclose(picture.pixels, wanted, atol=2e-5)
    assert picture.blocks == {}


@pytest.mark.parametrize(
    "chunks",
    [
        [],
        [gama(45455)],
        [gama(45455), chrm(SRGB)],
        [(b"sRGB", b"\0")],
        [(b"sRGB", b"\0"), gama(100000)],
        [(b"cICP", bytes([1, 13, 0, 1])), gama(100000), iccp(icc())],
    ],
)
def test_png_files_that_are_srgb_stay_as_they_are(chunks):
    picture = adopted(*chunks)
    np.testing.assert_array_equal(picture.pixels, colours())
    assert picture.blocks == {}
    assert picture.notes == ()


@pytest.mark.parametrize(("value", "primaries"), [(55556, SRGB), (45455, P3), (38462, BT2020)])
def test_gamma_and_primaries_become_a_profile(value, primaries):
    picture = adopted(gama(value), chrm(primaries))
    assert set(picture.blocks) == {"icc"}
    np.testing.assert_array_equal(picture.pixels, colours())
    light = (colours() / 255) ** (1e5 / value) @ between(primaries, SRGB).T
    shown = color.to_srgb(picture.pixels, picture.blocks)
    np.testing.assert_allclose(shown, to_numbers(light), atol=4e-3)


def test_primaries_alone_have_the_curve_of_srgb():
    picture = adopted(chrm(P3))
    light = to_light(colours() / 255) @ between(P3, SRGB).T
    shown = color.to_srgb(picture.pixels, picture.blocks)
    np.testing.assert_allclose(shown, to_numbers(light), atol=4e-3)


def test_a_made_profile_has_the_same_bytes_at_any_time(monkeypatch):
    made = adopted(gama(60000)).blocks["icc"]
    assert made[24:36] == struct.pack(">6H", 2000, 1, 1, 0, 0, 0)


@pytest.mark.parametrize(
    ("chunks", "wanted"),
    [
        ([iccp(icc()), (b"sRGB", b"\0"), gama(100000)], {"icc": icc()}),
        ([(b"cICP", PQ), gama(100000)], {"cicp": PQ}),
        ([(b"cICP", PQ), iccp(icc())], {"cicp": PQ, "icc": icc()}),
        ([(b"cICP", DISPLAY_P3), (b"sRGB", b"\0")], {"cicp": DISPLAY_P3}),
        ([gama(60000), (b"cICP", HLG)], {"cicp": HLG}),
        ([(b"cICP", bytes([2, 2, 0, 1])), iccp(icc())], {"icc": icc()}),
        ([(b"cICP", bytes([9, 16, 9, 1])), iccp(icc())], {"icc": icc()}),
        ([(b"cICP", b"\1"), iccp(icc())], {"icc": icc()}),
    ],
)  # fmt: skip
def test_what_counts_before_what_in_png(chunks, wanted):
    assert adopted(*chunks).blocks == wanted


def test_a_cicp_that_says_nothing_is_reported():
    (note,) = adopted((b"cICP", bytes([9, 77, 0, 1]))).notes
    assert "cICP" in note


def test_narrow_range_is_stretched():
    pixels = np.array([[[16, 126, 235], [0, 255, 16]]], np.uint8)
    picture = adopted((b"cICP", bytes([9, 16, 0, 0])), pixels=pixels)
    wanted = [[[0, 110 / 219, 1], [0, 1, 0]]]
    np.testing.assert_allclose(picture.pixels, wanted, atol=1e-6)
    assert picture.blocks == {"cicp": PQ}


@pytest.mark.parametrize(("primaries", "curve"), [(1, SRGB), (9, BT2020)])
def test_a_linear_cicp_becomes_srgb(primaries, curve):
    inside = np.random.default_rng(3).integers(20000, 40000, (4, 5, 3), np.uint16)
    picture = adopted((b"cICP", bytes([primaries, 8, 0, 1])), pixels=inside)
    light = inside / 65535 @ between(curve, SRGB).T
    np.testing.assert_allclose(np.clip(picture.pixels, 0, 1), to_numbers(light), atol=2e-4)
    assert picture.blocks == {}


@pytest.mark.parametrize("number", [0, 10**6])
def test_nonsense_of_primaries_is_passed_over(number):
    broken = b"cHRM", struct.pack(">8I", *[number] * 8)
    assert adopted(broken).blocks == {}


@pytest.mark.parametrize("number", [0, 1, 9_999, 1_000_001, 2**32 - 1])
def test_nonsense_of_gamma_is_passed_over(number):
    assert adopted((b"gAMA", struct.pack(">I", number))).blocks == {}


# CIE L*a*b*

LAB = [(100, 0, 0), (0, 0, 0), (53.585, 0, 0), (54.29, 80.81, 69.89), (29.57, 68.3, -112.03)]
"""White, black, middle grey, and the red and the blue of sRGB, at D50."""

LOOKS = [(1, 1, 1), (0, 0, 0), (0.5, 0.5, 0.5), (1, 0, 0), (0, 0, 1)]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("order", "<>")
def test_lab_is_converted(tmp_path, dtype, order):
    top, steps = (255, 1) if dtype == np.uint8 else (65535, 256)
    lab = np.rint(np.array([LAB]) * (top / 100, steps, steps))
    (tmp_path / "a.tif").write_bytes(tiff_of(lab.astype(np.int64).astype(dtype), order, t262=8))
    picture = read(tmp_path / "a.tif")
    np.testing.assert_allclose(picture.pixels, [LOOKS], atol=0.02 if steps == 1 else 0.002)
    assert picture.notes == ("converted from CIE L*a*b* to sRGB",)
    assert picture.blocks == {}


@pytest.mark.parametrize("kind", [9, 10])
def test_other_kinds_of_lab_are_refused(tmp_path, kind):
    (tmp_path / "a.tif").write_bytes(tiff_of(colours(), t262=kind))
    with pytest.raises((InputError, UnsupportedError), match=r"a\.tif: "):
        read(tmp_path / "a.tif")


# Grey


@pytest.mark.parametrize("alpha", [False, True])
def test_grey_jpeg_xl_keeps_its_numbers(tmp_path, alpha):
    grey = colours(31, 23)[..., : 1 + alpha]
    (tmp_path / "a.jxl").write_bytes(imagecodecs.jpegxl_encode(grey, lossless=True))
    picture = read(tmp_path / "a.jxl")
    assert picture.notes == ()
    assert picture.blocks == {}
    np.testing.assert_array_equal(picture.pixels, grey)


# Profiles


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_profiles_are_converted(gamma, dtype):
    pixels = colours(dtype=dtype)[..., :1]
    picture = adopted(iccp(grey_icc(gamma)), pixels=pixels)
    wanted = to_numbers((pixels / np.iinfo(dtype).max) ** gamma)
    np.testing.assert_allclose(picture.pixels, wanted, atol=2e-3)
    assert picture.blocks == {}
    assert picture.notes == ("converted from its grey profile to sRGB",)


def test_alpha_beside_a_grey_profile_stays(tmp_path):
    pixels = np.dstack([np.full((3, 4), 99, np.uint8), np.arange(12, dtype=np.uint8).reshape(3, 4)])
    Image.fromarray(pixels, "LA").save(tmp_path / "a.png", icc_profile=grey_icc(1.8))
    picture = read(tmp_path / "a.png")
    np.testing.assert_allclose(picture.pixels[..., 1], pixels[..., 1] / 255, atol=1e-6)
    np.testing.assert_allclose(picture.pixels[..., 0], to_numbers((99 / 255) ** 1.8), atol=2e-3)


GREYS = [100.0, 0.0, 50.0, 0.0, 70.0, 0.0, 30.0, 0.0, 60.0, 0.0, 25.0, 0.0, 45.0, 0.0, 20.0, 0.0]


@pytest.mark.parametrize("name", ["a.jpg", "a.tif"])
def test_cmyk_profiles_are_converted(tmp_path, name):
    inks = np.repeat(np.uint8(MIXTURES), 16, axis=0).reshape(16, 16, 4).repeat(8, axis=0)
    how = {"quality": 100, "subsampling": 0} if name == "a.jpg" else {}
    Image.fromarray(inks, "CMYK").save(tmp_path / name, icc_profile=cmyk_icc(GREYS), **how)
    picture = read(tmp_path / name)
    light = ((np.array(GREYS) + 16) / 116) ** 3
    light = np.where(np.array(GREYS) > 8, light, np.array(GREYS) / 903.3)
    wanted = to_numbers(light)[:, None, None].repeat(8, axis=0) + np.zeros((128, 16, 3))
    assert picture.pixels.shape == (128, 16, 3)
    np.testing.assert_allclose(picture.pixels, wanted, atol=0.03)
    assert "converted from its CMYK profile to sRGB" in picture.notes
    assert "icc" not in picture.blocks


@pytest.mark.parametrize("name", ["a.jpg", "a.tif"])
def test_a_damaged_cmyk_profile_is_reported(tmp_path, name):
    inks = np.zeros((16, 16, 4), np.uint8)
    inks[..., 1:3] = 255  # magenta and yellow make red
    Image.fromarray(inks, "CMYK").save(tmp_path / name, icc_profile=icc(b"CMYK"), quality=100)
    picture = read(tmp_path / name)
    np.testing.assert_allclose(
        picture.pixels[8, 8] / (1 if picture.pixels.dtype.kind == "f" else 255),
        [1, 0, 0],
        atol=0.02,
    )
    assert any("damaged" in note for note in picture.notes)


def test_a_profile_of_other_pixels_is_left_out():
    picture = adopted(iccp(grey_icc(2.2)))
    assert picture.blocks == {}
    assert any("profile" in note for note in picture.notes)


def test_the_camera_mark_of_adobe_rgb(tmp_path):
    """Cameras say Adobe RGB by the index R03 of EXIF, many of them without a profile."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA005] = {1: "R03"}
    pixels = np.full((16, 16, 3), (200, 120, 60), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=exif, quality=100, subsampling=0)
    picture = read(tmp_path / "a.jpg")
    adobe = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290)
    light = (picture.pixels[0, 0] / 255) ** 2.199 @ between(adobe, SRGB).T
    shown = color.to_srgb(picture.pixels, picture.blocks)
    np.testing.assert_allclose(shown[0, 0], to_numbers(light), atol=4e-3)
    # A picture that was converted must not bear the mark on.
    pixels = np.rint(shown * 255).astype(np.uint8)
    for suffix in (".jpg", ".png", ".tif", ".webp"):
        write(tmp_path / f"b{suffix}", pixels, {"exif": picture.blocks["exif"]})
        again = read(tmp_path / f"b{suffix}")
        assert set(again.blocks) == {"exif"}
        assert b"R03" not in again.blocks["exif"]
    write(tmp_path / "c.jpg", picture.pixels, picture.blocks)
    assert b"R03" in read(tmp_path / "c.jpg").blocks["exif"]


# Conversion to sRGB


def pq(light):
    """Numbers of light in cd/m² (SMPTE ST 2084)."""
    power = (np.asarray(light) / 10000) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375


@pytest.mark.parametrize("share", [0.0, 0.01, 0.2, 0.7, 1.0])
def test_pq_has_its_white_at_203_candela(share):
    pixels = np.full((1, 2, 3), pq(203 * share), np.float32)
    np.testing.assert_allclose(color.to_srgb(pixels, {"cicp": PQ}), to_numbers(share), atol=1e-3)
    assert color.to_srgb(pixels * 0 + np.float32(pq(4000)), {"cicp": PQ}).max() == 1


def test_hlg_has_its_white_at_three_quarters():
    for number, wanted in ((0.0, 0.0), (0.75, 1.0), (1.0, 1.0)):
        pixels = np.full((1, 2, 3), number, np.float32)
        shown = color.to_srgb(pixels, {"cicp": HLG})
        np.testing.assert_allclose(shown, wanted, atol=2e-3)


@pytest.mark.parametrize("primaries", sorted(color.PRIMARIES))
@pytest.mark.parametrize("transfer", sorted(color._LIGHT))
def test_white_is_white_and_black_is_black_in_every_colour_space(primaries, transfer):
    blocks = {"cicp": bytes([primaries, transfer, 0, 1])}
    assert color.cicp_problem(blocks["cicp"]) is None
    ends = np.array([[[0, 0, 0], [1, 1, 1]]], np.float32)
    np.testing.assert_allclose(color.to_srgb(ends, blocks), ends, atol=0.03)


def test_a_profile_made_for_cicp_says_the_same():
    pixels = colours(20, 20)
    for cicp in (DISPLAY_P3, bytes([9, 1, 0, 1]), bytes([1, 4, 0, 1])):
        made = color.profile_of(cicp)
        one, two = (color.to_srgb(pixels, b) for b in ({"icc": made}, {"cicp": cicp}))
        np.testing.assert_allclose(one, two, atol=2e-3)
    assert color.profile_of(PQ) is None
    assert color.profile_of(HLG) is None


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_channels_of_what_is_converted(channels):
    pixels = np.random.default_rng(2).random((3, 5, channels)).astype(np.float32)
    shown = color.to_srgb(pixels, {"cicp": DISPLAY_P3})
    assert shown.shape == (3, 5, 4 if channels in (2, 4) else 3)
    if channels in (2, 4):
        np.testing.assert_array_equal(shown[..., 3], pixels[..., -1])
    if channels < 3:
        np.testing.assert_allclose(shown[..., :3], pixels[..., :1].repeat(3, 2), atol=1e-3)


def test_a_damaged_profile_cannot_be_used():
    with pytest.raises(UnsupportedError, match="profile cannot be used"):
        color.to_srgb(colours(), {"icc": icc()})


def test_stripped_pictures_are_srgb():
    pixels = colours()
    found = stripped(Picture(pixels, {"cicp": DISPLAY_P3, "xmp": b"<x/>"}))
    assert found.blocks == {}
    np.testing.assert_allclose(found.pixels, color.to_srgb(pixels, {"cicp": DISPLAY_P3}))
    damaged = stripped(Picture(pixels, {"icc": icc()}))
    np.testing.assert_array_equal(damaged.pixels, pixels)
    assert "not converted" in damaged.notes[0]


# Other types


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".webp", ".png"])
@pytest.mark.parametrize("blocks", [{"cicp": DISPLAY_P3}, {"icc": color.profile_of(DISPLAY_P3)}])
def test_types_that_can_say_what_colours_they_have(tmp_path, suffix, blocks):
    pixels = np.full((24, 40, 3), (250, 40, 30), np.uint8)
    assert write(tmp_path / f"a{suffix}", pixels, blocks) == ()
    picture = read(tmp_path / f"a{suffix}")
    wanted = color.to_srgb(pixels, blocks)
    np.testing.assert_allclose(color.to_srgb(picture.pixels, picture.blocks), wanted, atol=0.02)


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".webp"])
def test_a_profile_beside_cicp_is_for_types_that_hold_only_those(tmp_path, suffix):
    profile = color.profile_of(bytes([9, 14, 0, 1]))
    for cicp in (PQ, DISPLAY_P3):
        assert write(tmp_path / f"a{suffix}", colours(), {"cicp": cicp, "icc": profile}) == ()
        assert read(tmp_path / f"a{suffix}").blocks == {"icc": profile}


@pytest.mark.parametrize(
    ("suffix", "blocks"),
    [
        (".bmp", {"icc": color.profile_of(DISPLAY_P3)}),
        (".tga", {"cicp": DISPLAY_P3}),
        (".ppm", {"cicp": PQ}),
        (".npy", {"icc": icc()}),
        (".jpg", {"cicp": PQ}),
        (".tif", {"cicp": HLG}),
    ],
)
def test_types_that_cannot_say_it_are_reported(tmp_path, suffix, blocks):
    (note,) = write(tmp_path / f"a{suffix}", colours(), blocks)
    assert suffix in note
    assert "--srgb" in note


def test_pixels_keep_their_numbers_whatever_their_colours(tmp_path):
    write(tmp_path / "a.bmp", colours(), {"cicp": DISPLAY_P3})
    np.testing.assert_array_equal(read(tmp_path / "a.bmp").pixels, colours())


def test_converting_needs_imagecodecs(tmp_path, monkeypatch):
    path = save(tmp_path / "a.exr", np.full((2, 2, 3), 0.5))
    monkeypatch.setitem(__import__("sys").modules, "imagecodecs", None)
    with pytest.raises(UnsupportedError, match="needs imagecodecs"):
        read(path)


def test_white_is_zero_in_files_of_any_depth(tmp_path):
    for dtype, top in ((np.uint8, 255), (np.uint16, 65535), (np.float32, 1)):
        grey = (np.arange(12).reshape(3, 4, 1) * (top / 12)).astype(dtype)
        (tmp_path / "a.tif").write_bytes(tiff_of(grey, t262=0))
        np.testing.assert_array_equal(read(tmp_path / "a.tif").pixels, top - grey)


def test_errors_are_of_the_picture_and_name_it(tmp_path):
    path = save(tmp_path / "a.exr", np.full((2, 2, 3), 0.5))
    with pytest.raises(InputError, match=r"a\.exr: --frame 4"):
        read(path, frame=4)
