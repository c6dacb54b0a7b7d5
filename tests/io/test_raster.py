"""Ordinary picture files: pixels, metadata, orientation, alpha, and files that are none."""

import io
import re
import struct
import sys
import zlib

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, UnsupportedError, UsageError
from proxyimg_codec.io.metadata import is_cut_jpeg, raw_blocks, upright
from proxyimg_codec.io.png import _file, chunks, encode_png
from proxyimg_codec.io.raster import parse, read, write
from tests.support.pictures import icc

oiio = pytest.importorskip("OpenImageIO")

XMP = (
    b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-'
    b'syntax-ns#"><rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/" '
    b'tiff:Orientation="6"/></rdf:RDF></x:xmpmeta>'
)


def exif(orientation: int, order: str = "<") -> bytes:
    """A TIFF structure with another tag, the orientation, and a third."""
    head = b"II*\0" if order == "<" else b"MM\0*"
    tags = [(0x0100, 3, 1, 7, 0), (0x0112, 3, 1, orientation, 0), (0x0128, 3, 1, 2, 0)]
    body = b"".join(struct.pack(order + "HHIHH", *t) for t in tags)
    return head + struct.pack(order + "IH", 8, len(tags)) + body + struct.pack(order + "I", 0)


def linear(numbers: np.ndarray) -> np.ndarray:
    """Light of sRGB numbers (IEC 61966-2-1)."""
    return np.where(numbers <= 0.04045, numbers / 12.92, ((numbers + 0.055) / 1.055) ** 2.4)


def noise(channels: int, dtype: str = "uint8", height: int = 7, width: int = 11) -> np.ndarray:
    rng = np.random.default_rng(channels)
    top = np.iinfo(dtype).max
    return rng.integers(0, top, (height, width, channels), dtype, endpoint=True)


def save(path, pixels, **attributes):
    """Writes pixels with OpenImageIO; __ in an attribute stands for a colon."""
    pixels = np.ascontiguousarray(pixels)
    target = oiio.ImageOutput.create(str(path))
    kind = {"float32": "float"}.get(str(pixels.dtype), str(pixels.dtype))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    for name, value in attributes.items():
        if hasattr(spec, name):
            setattr(spec, name, value)
        elif isinstance(value, bytes):
            array = np.frombuffer(value, np.uint8)
            spec.attribute(name, oiio.TypeDesc(f"uint8[{len(array)}]"), array)
        else:
            spec.attribute(name.replace("__", ":"), value)
    assert target.open(str(path), spec), target.geterror()
    assert target.write_image(pixels), target.geterror()
    assert target.close()
    return path


def png(color_type: int, depth: int, rows: bytes, size=(2, 2), **chunks: bytes) -> bytes:
    """A PNG file of unfiltered rows (each after a zero byte), with more chunks before them."""
    parts = {"IHDR": struct.pack(">IIBBBBB", *size, depth, color_type, 0, 0, 0), **chunks}
    out = b"\x89PNG\r\n\x1a\n"
    for name, body in {**parts, "IDAT": zlib.compress(rows), "IEND": b""}.items():
        typed = name.encode() + body
        out += struct.pack(">I", len(body)) + typed + struct.pack(">I", zlib.crc32(typed))
    return out


# Writing and reading back


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize(
    ("suffix", "channels"), [(".png", 3), (".png", 4), (".PNG", 3), (".ppm", 3), (".npy", 4)]
)
def test_our_writers_are_read_back_exactly(tmp_path, suffix, channels, dtype):
    pixels = noise(channels, dtype)
    write(tmp_path / f"a{suffix}", pixels)
    back = read(tmp_path / f"a{suffix}").pixels
    assert back.dtype == pixels.dtype
    np.testing.assert_array_equal(back, pixels)


@pytest.mark.parametrize(
    ("suffix", "dtype", "tolerance"),
    [
        (".tif", "uint16", 0),
        (".tif", "float32", 0),
        (".bmp", "uint8", 0),
        (".tga", "uint8", 0),
        (".exr", "float32", 1e-5),
        (".webp", "uint8", 30),
    ],
)
def test_alpha_survives_the_writers_of_openimageio(tmp_path, suffix, dtype, tolerance):
    y, x = np.mgrid[0:16, 0:24]
    pixels = np.dstack([x / 23, y / 15, (x + y) / 38, 0.5 + 0.5 * x / 23])
    if dtype != "float32":
        pixels = np.rint(pixels * np.iinfo(dtype).max)
    pixels = pixels.astype(dtype)
    write(tmp_path / f"a{suffix}", pixels)
    back = read(tmp_path / f"a{suffix}").pixels
    assert back.dtype == pixels.dtype
    np.testing.assert_allclose(back.astype(float), pixels.astype(float), rtol=0, atol=tolerance)


def test_npy_holds_floats(tmp_path):
    pixels = noise(3).astype(np.float32) / 255
    write(tmp_path / "a.npy", pixels)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), pixels)


@pytest.mark.parametrize(
    ("name", "channels", "dtype", "error"),
    [
        ("a.ppm", 4, "uint8", UsageError),
        ("a.ppm", 3, "float32", UsageError),
        ("a.png", 3, "float32", UsageError),
        ("a.jpg", 4, "uint8", UsageError),
        ("a.jpg", 3, "uint16", UsageError),
        ("a.bmp", 3, "float32", UsageError),
        ("a", 3, "uint8", UsageError),
        ("a.txt", 3, "uint8", UnsupportedError),
        ("a.pxi", 3, "uint8", UnsupportedError),
        ("a.null", 3, "uint8", UnsupportedError),
    ],
)
def test_types_that_cannot_hold_the_picture(tmp_path, name, channels, dtype, error):
    with pytest.raises(error):
        write(tmp_path / name, noise(channels).astype(dtype))
    assert not list(tmp_path.iterdir())


def test_a_writer_that_reports_success_but_fails(tmp_path):
    """OpenImageIO's JPEG 2000 writer leaves a stump of a tiny picture, and says that all is well.

    Where it does write the picture, it must be readable.
    """
    path = tmp_path / "a.jp2"
    try:
        write(path, noise(3))
    except UnsupportedError:
        assert not path.exists()
    else:
        assert read(path).pixels.shape == (7, 11, 3)


def test_png_and_npy_need_no_openimageio(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenImageIO", None)
    write(tmp_path / "a.png", noise(3))
    write(tmp_path / "a.npy", noise(3))
    np.testing.assert_array_equal(read(tmp_path / "a.npy").pixels, noise(3))
    with pytest.raises(UnsupportedError, match="needs OpenImageIO"):
        read(tmp_path / "a.png")
    with pytest.raises(UnsupportedError, match="needs OpenImageIO"):
        write(tmp_path / "a.jpg", noise(3))


# Metadata


def test_png_carries_metadata(tmp_path):
    blocks = {"icc": icc(), "exif": exif(1), "xmp": XMP.replace(b'"6"', b'"1"')}
    write(tmp_path / "a.png", noise(3), blocks)
    assert read(tmp_path / "a.png").blocks == blocks


def test_orientation_is_reset_in_the_metadata(tmp_path):
    (tmp_path / "a.png").write_bytes(encode_png(noise(3), {"exif": exif(6), "xmp": XMP}))
    picture = read(tmp_path / "a.png")
    assert picture.pixels.shape == (11, 7, 3)
    assert picture.blocks == {"exif": exif(1), "xmp": XMP.replace(b'"6"', b'"1"')}


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_icc_profiles_pass_through_openimageio(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", noise(3), {"icc": icc()})
    assert read(tmp_path / f"a{suffix}").blocks["icc"] == icc()


@pytest.mark.parametrize("space", [b"GRAY", b"CMYK"])
def test_profiles_of_other_colour_spaces_are_left_out(tmp_path, space):
    path = save(tmp_path / "a.tif", noise(1), ICCProfile=icc(space))
    assert "icc" not in read(path).blocks


def jpeg_segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body


def riff_chunk(name: bytes, body: bytes) -> bytes:
    return name + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)


JPEG = (
    b"\xff\xd8"
    + jpeg_segment(0xE0, b"JFIF\0 and more")
    + jpeg_segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + XMP)
    + jpeg_segment(0xE1, b"Exif\0\0" + exif(3))
    + jpeg_segment(0xE1, b"Exif\0\0" + exif(4))
    + jpeg_segment(0xDA, b"scan")
    + jpeg_segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0too late")
    + b"\xff\xd9"
)
WEBP_BODY = b"".join(
    [
        b"WEBP",
        riff_chunk(b"VP8X", b"odd"),
        riff_chunk(b"EXIF", b"Exif\0\0" + exif(3)),
        riff_chunk(b"XMP ", XMP),
    ]
)
WEBP = riff_chunk(b"RIFF", WEBP_BODY)
PNG = encode_png(noise(3), {"exif": exif(3), "xmp": XMP})


@pytest.mark.parametrize("data", [JPEG, WEBP, PNG], ids=["jpeg", "webp", "png"])
def test_raw_blocks(data):
    assert raw_blocks(data) == {"exif": exif(3), "xmp": XMP}
    assert raw_blocks(data[1:]) == {}
    for stop in range(len(data)):
        assert set(raw_blocks(data[:stop])) <= {"exif", "xmp"}


@pytest.mark.parametrize("order", ["<", ">"])
def test_upright_sets_the_tag_to_one(order):
    assert upright({"exif": exif(8, order)}) == {"exif": exif(1, order)}
    for stop in range(len(exif(8))):
        assert len(upright({"exif": exif(8, order)[:stop]})["exif"]) == stop


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (b'tiff:Orientation="8"', b'tiff:Orientation="1"'),
        (b"tiff:Orientation = '3'", b"tiff:Orientation = '1'"),
        (b"<tiff:Orientation>6</tiff:Orientation>", b"<tiff:Orientation>1</tiff:Orientation>"),
        (b'other:Orientation="8"', b'other:Orientation="8"'),
    ],
)
def test_upright_changes_xmp(before, after):
    assert upright({"xmp": b"..." + before + b"..."}) == {"xmp": b"..." + after + b"..."}


def test_upright_leaves_the_rest_alone():
    blocks = {"icc": icc(), "exif": b"not TIFF, but long enough", "xmp": b"<x/>"}
    assert upright(blocks) == blocks


# EXIF 2.3, 4.6.4 A: what must be done to the stored picture.
TURNS = {
    1: lambda a: a,
    2: np.fliplr,
    3: lambda a: np.rot90(a, 2),
    4: np.flipud,
    5: lambda a: np.fliplr(np.rot90(a, -1)),
    6: lambda a: np.rot90(a, -1),
    7: lambda a: np.fliplr(np.rot90(a, 1)),
    8: lambda a: np.rot90(a, 1),
}


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_applied_to_the_pixels(tmp_path, orientation):
    pixels = noise(3)
    path = save(tmp_path / "a.tif", pixels, Orientation=orientation)
    np.testing.assert_array_equal(read(path).pixels, TURNS[orientation](pixels))
    (tmp_path / "a.png").write_bytes(encode_png(pixels, {"exif": exif(orientation)}))
    np.testing.assert_array_equal(read(tmp_path / "a.png").pixels, TURNS[orientation](pixels))


# Kinds of pictures


def test_premultiplied_sources_become_straight(tmp_path):
    straight = np.array([[[200, 100, 50, 128], [10, 20, 30, 255]]], np.uint8)
    stored = np.array([[[100, 50, 25, 128], [10, 20, 30, 255]]], np.uint8)
    np.testing.assert_allclose(
        read(save(tmp_path / "a.tif", stored)).pixels, straight, rtol=0, atol=1
    )
    alpha = straight[..., 3:] / 255
    light = np.concatenate([linear(straight[..., :3] / 255) * alpha, alpha], axis=2)
    path = save(tmp_path / "a.exr", light.astype(np.float32))
    shown = read(path).pixels
    np.testing.assert_allclose(shown[..., :3] * 255, straight[..., :3], rtol=0, atol=0.01)
    np.testing.assert_allclose(shown[..., 3:], alpha, rtol=0, atol=1e-6)


def test_straight_sources_stay_as_they_are(tmp_path):
    pixels = noise(4)
    for suffix in (".png", ".tga", ".bmp", ".tif"):
        path = save(tmp_path / f"a{suffix}", pixels, oiio__UnassociatedAlpha=1)
        if suffix in (".bmp", ".tif"):  # the other writers of OpenImageIO round
            np.testing.assert_array_equal(read(path).pixels, pixels)
        else:
            visible = pixels[..., 3] > 200
            error = read(path).pixels[visible].astype(int) - pixels[visible]
            assert abs(error).max() <= 1


PALETTE = bytes([255, 0, 0, 0, 255, 0, 0, 0, 255])
RED, GREEN, BLUE = [255, 0, 0], [0, 255, 0], [0, 0, 255]


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (png(3, 8, b"\0\0\1\0\2\0", PLTE=PALETTE), [[RED, GREEN], [BLUE, RED]]),
        (
            png(3, 8, b"\0\0\1\0\2\0", PLTE=PALETTE, tRNS=b"\0\x80"),
            [[[*RED, 0], [*GREEN, 128]], [[*BLUE, 255], [*RED, 0]]],
        ),
        (png(3, 2, b"\0\x10\0\x80", PLTE=PALETTE), [[RED, GREEN], [BLUE, RED]]),
        (png(0, 8, b"\0\0\x40\0\x80\xff"), [[[0], [64]], [[128], [255]]]),
        (png(0, 1, b"\0\x40\0\x80"), [[[0], [255]], [[255], [0]]]),
        (
            png(4, 8, b"\0\x0a\x14\x1e\x28\0\x32\x3c\x46\xff"),
            [[[10, 20], [30, 40]], [[50, 60], [70, 255]]],
        ),
        (
            png(0, 16, b"\0\0\1\1\0\0\2\0\xff\xff"),
            np.array([[[1], [256]], [[512], [65535]]], np.uint16),
        ),
        (
            png(6, 16, b"\0" + struct.pack(">4H", 1, 2, 3, 40000), size=(1, 1)),
            np.array([[[1, 2, 3, 40000]]], np.uint16),
        ),
    ],
    ids=["palette", "palette-alpha", "palette-2", "grey", "bits", "grey-alpha", "grey-16", "rgba"],
)
def test_kinds_of_png(tmp_path, data, expected):
    (tmp_path / "a.png").write_bytes(data)
    expected = np.asarray(expected) if isinstance(expected, np.ndarray) else np.uint8(expected)
    pixels = read(tmp_path / "a.png").pixels
    assert pixels.dtype == expected.dtype
    np.testing.assert_array_equal(pixels, expected)


def parts_of(data: bytes) -> list[tuple[bytes, bytes]]:
    return list(chunks(data))


CHANGES = {
    "no-end": lambda p: p[:-1],
    "no-pixels": lambda p: [c for c in p if c[0] != b"IDAT"],
    "no-palette": lambda p: [c for c in p if c[0] != b"PLTE"],
    "two-palettes": lambda p: [*p[:2], p[1], *p[2:]],
    "palette-odd": lambda p: [(k, b[:-1] if k == b"PLTE" else b) for k, b in p],
    "head-short": lambda p: [(k, b[:-1] if k == b"IHDR" else b) for k, b in p],
    "head-empty": lambda p: [(k, bytes(13) if k == b"IHDR" else b) for k, b in p],
    "huge": lambda p: [(k, b"\x7f\xff\xff\xff" * 2 + b[8:] if k == b"IHDR" else b) for k, b in p],
    "depth": lambda p: [(k, b[:8] + b"\x20" + b[9:] if k == b"IHDR" else b) for k, b in p],
    "rows-few": lambda p: [(k, zlib.compress(bytes(3)) if k == b"IDAT" else b) for k, b in p],
    "filter": lambda p: [(k, zlib.compress(b"\5\0\0\0\0\0") if k == b"IDAT" else b) for k, b in p],
    "stream": lambda p: [(k, b[:-5] if k == b"IDAT" else b) for k, b in p],
    "no-stream": lambda p: [(k, b"rubbish" if k == b"IDAT" else b) for k, b in p],
}


@pytest.mark.parametrize("name", CHANGES)
def test_damaged_png_files_are_refused_before_libpng_prints(name, capfd):
    whole = parts_of(png(3, 8, b"\0\0\1\0\2\0", PLTE=PALETTE))
    with pytest.raises(InputError, match=r"^a: damaged or truncated \([^\n]+\)$"):
        parse(_file(CHANGES[name](whole)), "a")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kind", [b"PLTE", b"tRNS", b"iCCP", b"gAMA", b"zTXt", b"teST", b"sBIT"])
def test_chunks_that_are_wrong_or_out_of_place_do_not_matter(kind, capfd):
    first, *rest = parts_of(encode_png(noise(3)))
    found = parse(_file([first, (kind, b"\1\2\3" * 9), *rest]), "a")
    np.testing.assert_array_equal(found.pixels, noise(3))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("mode", ["L", "P", "RGB", "RGBA", "1"])
def test_interlaced_png(tmp_path, mode):
    """The seven passes of the rows that come first, of sizes that some passes miss."""
    image = pytest.importorskip("PIL.Image")
    rng = np.random.default_rng(1)
    for width, height in ((1, 1), (3, 2), (5, 9), (13, 8)):
        shown = image.fromarray(rng.integers(0, 256, (height, width, 3), np.uint8)).convert(mode)
        pixels = np.asarray(shown.convert("RGBA" if mode == "RGBA" else "RGB"))
        depth, kind = {"L": (8, 0), "P": (8, 3), "RGB": (8, 2), "RGBA": (8, 6), "1": (1, 0)}[mode]
        stored = np.asarray(shown).reshape(height, width, -1)
        rows = b""
        for x, y, dx, dy in ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4),
                             (1, 0, 2, 2), (0, 1, 1, 2)):  # fmt: skip
            for row in stored[y::dy, x::dx]:
                if len(row):
                    rows += b"\0" + (np.packbits(row) if mode == "1" else row).tobytes()
        head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 1)
        palette = [(b"PLTE", bytes(shown.getpalette()))] if mode == "P" else []
        parts = [(b"IHDR", head), *palette, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
        found = parse(_file(parts), "a").pixels
        np.testing.assert_array_equal(found, pixels[..., : found.shape[2]])


def test_cmyk_becomes_rgb(tmp_path):
    inks = np.zeros((4, 4, 4), np.uint8)
    inks[..., 1:3] = 255  # magenta and yellow make red
    path = save(tmp_path / "a.tif", inks, tiff__ColorSpace="CMYK", channelnames=tuple("CMYK"))
    picture = read(path)
    np.testing.assert_array_equal(picture.pixels, np.full((4, 4, 3), RED, np.uint8))
    assert picture.notes == ("converted from CMYK without a profile",)


def test_inks_of_ycck_are_said_too(tmp_path):
    imagecodecs = pytest.importorskip("imagecodecs")
    light = np.full((16, 16, 4), 255, np.uint8)
    light[..., 1:3] = 0  # as Adobe stores inks: magenta and yellow make red
    data = imagecodecs.jpeg8_encode(light, 95, colorspace="CMYK", outcolorspace="YCCK")
    picture = parse(data, "a.jpg")
    np.testing.assert_allclose(picture.pixels[8, 8], RED, atol=3)
    assert picture.notes == ("converted from CMYK without a profile",)


@pytest.mark.parametrize(
    ("channels", "kept", "named"), [(2, 1, "G"), (5, 4, "channel4"), (14, 4, "channel11, ...")]
)
def test_further_channels_are_left_out_and_named(tmp_path, channels, kept, named):
    pixels = np.repeat(noise(2), channels, axis=2)[..., :channels]
    pixels[..., 3:4] = 255
    picture = read(save(tmp_path / "a.tif", pixels, oiio__UnassociatedAlpha=1))
    np.testing.assert_array_equal(picture.pixels, pixels[..., :kept])
    assert [note.endswith(named) for note in picture.notes] == [True]


def test_depth_and_the_display_window_of_openexr_are_named(tmp_path):
    names = ("R", "G", "B", "Z", "diffuse.R")
    path = save(tmp_path / "a.exr", np.zeros((6, 9, 5), np.float32), channelnames=names,
                x=3, y=-2, full_width=20, full_height=10)  # fmt: skip
    picture = read(path)
    assert picture.pixels.shape == (6, 9, 3)
    assert "channels left out: Z, diffuse.R" in picture.notes
    assert any("9x6 at 3,-2" in v and "20x10 at 0,0" in v for v in picture.notes)


@pytest.mark.parametrize("name", ["a.\0png", "a." + "x" * 300, "a.\u732b", "a.\udcff", "a.\n", "-"])
def test_names_are_for_messages_and_may_be_any(name):
    np.testing.assert_array_equal(parse(encode_png(noise(3)), name).pixels, noise(3))
    with pytest.raises(InputError):
        parse(b"no picture", name)


@pytest.mark.parametrize("name", ["a.jpg", "a.dat", "a"])
def test_contents_decide_not_the_name(tmp_path, name):
    (tmp_path / name).write_bytes(encode_png(noise(3)))
    np.testing.assert_array_equal(read(tmp_path / name).pixels, noise(3))


@pytest.mark.parametrize("order", ["<", ">"])
def test_npy_in_either_byte_order(tmp_path, order):
    pixels = noise(3, "uint16")
    np.save(tmp_path / "a.npy", pixels.astype(pixels.dtype.newbyteorder(order)))
    back = read(tmp_path / "a.npy").pixels
    assert back.dtype == np.uint16
    np.testing.assert_array_equal(back, pixels)


# Files that cannot be read


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def encoded(tmp_path, name: str) -> bytes:
    return save(tmp_path / f"whole-{name}", noise(3, height=40, width=60)).read_bytes()


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.png", b""),
        ("a.png", b"\x89PNG\r\n\x1a\n"),
        ("a.png", PNG[: len(PNG) // 2]),
        ("a.png", PNG[:-40] + bytes(20) + PNG[-20:]),
        ("a.jpg", b"\xff\xd8\xff"),
        ("a.txt", b"hello\n" * 100),
        ("a", bytes(5000)),
        ("a.null", b"\1" * 100),
        ("a.pxi", b"\x89PXI\r\n\x1a\n" + bytes(100)),
        ("a.npy", npy(noise(3))[:150]),
        ("a.npy", b"\x93NUMPY\x01\0\x08\0{'a': 1}"),
        ("a.npy", npy(np.array([[[{}]]], object))),
        ("a.npy", npy(np.zeros(4, np.uint8))),
        ("a.npy", npy(np.zeros((0, 4, 3), np.uint8))),
    ],
)
def test_unusable_files_are_named_in_one_line(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=rf"^{re.escape(str(path))}: [^\n]+$"):
        read(path)


@pytest.mark.parametrize("name", ["a.jpg", "a.tif", "a.webp", "a.bmp", "a.ppm", "a.png", "a.exr"])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.95])
def test_truncated_files_are_refused(tmp_path, name, share):
    data = encoded(tmp_path, name)
    path = tmp_path / name
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"^{re.escape(str(path))}: [^\n]+$"):
        read(path)


def test_the_end_of_a_jpeg_may_be_followed_by_more(tmp_path):
    data = encoded(tmp_path, "a.jpg")
    assert not is_cut_jpeg(data + b"appended")
    assert is_cut_jpeg(data[:-2])
    assert not is_cut_jpeg(PNG)


@pytest.mark.parametrize("name", ["missing.png", "."])
def test_missing_files_and_folders(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read"):
        read(tmp_path / name)


def test_a_pickle_is_never_run(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (tmp_path.joinpath("boom").touch, ())

    (tmp_path / "a.npy").write_bytes(npy(np.array([[[Bomb()]]], object)))
    with pytest.raises(InputError, match="without pickled objects"):
        read(tmp_path / "a.npy")
    assert not (tmp_path / "boom").exists()


def test_standard_input(monkeypatch):
    stdin = io.TextIOWrapper(io.BytesIO(PNG))
    monkeypatch.setattr(sys, "stdin", stdin)
    np.testing.assert_array_equal(read("-").pixels, TURNS[3](noise(3)))
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
    with pytest.raises(InputError, match="standard input: the file is empty"):
        read("-")
