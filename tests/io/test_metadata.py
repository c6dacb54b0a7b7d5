"""EXIF and XMP: found in every type, upright once, and put into every type that holds them."""

import io
import struct
import zlib

import numpy as np
import pytest

from proxyimg_codec.io import boxes, exif, metadata
from proxyimg_codec.io.raster import parse, read, write
from tests.support.profiles import png_of, tiff_of

pytest.importorskip("OpenImageIO")
Image = pytest.importorskip("PIL.Image")
IFDRational = pytest.importorskip("PIL.TiffImagePlugin").IFDRational

PIXELS = np.random.default_rng(5).integers(0, 256, (96, 133, 3), np.uint8)
TURNED = np.rot90(PIXELS, -1)  # what orientation 6 asks for
XMP = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><d tiff:Orientation="%d"/></x:xmpmeta>'


def block(orientation: int = 6, order: str = "MM", kind: int = 3) -> bytes:
    """EXIF block as Pillow writes it, with directories of its own for the camera and the place."""
    made = Image.Exif()
    made.endian = {"MM": ">", "II": "<"}[order]
    made[0x0112] = orientation
    made[0x010F] = "A maker of cameras"
    made.get_ifd(0x8769)[0x9003] = "2019:05:06 07:08:09"
    made.get_ifd(0x8769)[0x829A] = IFDRational(1, 250)
    made.get_ifd(0x8825)[1] = "S"
    made.get_ifd(0x8825)[2] = (33.0, 51.0, 7.5)
    found = made.tobytes().removeprefix(b"Exif\0\0")
    if kind != 3:
        form = {1: "B", 4: "I"}[kind]
        mark = made.endian
        old = struct.pack(mark + "HHIHH", 0x0112, 3, 1, orientation, 0)
        value = struct.pack(mark + form, orientation).ljust(4, b"\0")
        found = found.replace(old, struct.pack(mark + "HHI", 0x0112, kind, 1) + value)
    return found


def told(data: bytes) -> dict:
    """What Pillow finds in the EXIF of a file."""
    with Image.open(io.BytesIO(data)) as source:
        found = source.getexif()
        camera, place = dict(found.get_ifd(0x8769)), dict(found.get_ifd(0x8825))
        return {"orientation": found.get(0x0112, 1), "maker": found.get(0x010F),
                "date": camera.get(0x9003), "time": camera.get(0x829A), "place": place}  # fmt: skip


TOLD = {"orientation": 1, "maker": "A maker of cameras", "date": "2019:05:06 07:08:09",
        "time": 0.004, "place": {1: "S", 2: (33.0, 51.0, 7.5)}}  # fmt: skip


def saved(kind: str, **how) -> bytes:
    if kind == "jpeg" and "exif" in how:
        how["exif"] = b"Exif\0\0" + how["exif"]
    out = io.BytesIO()
    Image.fromarray(PIXELS).save(out, kind, **how)
    return out.getvalue()


def raw(name: str, content: bytes) -> bytes:
    """Text that ImageMagick makes of a block."""
    digits = content.hex()
    lines = [digits[k : k + 72] for k in range(0, len(digits), 72)]
    return f"\n{name}\n{len(content):8}\n".encode() + "\n".join(lines).encode() + b"\n"


def text(key: bytes, content: bytes, packed: bool) -> tuple[bytes, bytes]:
    """Chunk tEXt, or zTXt."""
    if packed:
        return b"zTXt", key + b"\0\0" + zlib.compress(content)
    return b"tEXt", key + b"\0" + content


def filled(data: bytes, count: int) -> bytes:
    """JPEG data with fill bytes before each marker up to the scan."""
    out, at = data[:2], 2
    while data[at + 1] != 0xDA:
        size = 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        out += b"\xff" * count + data[at : at + size]
        at += size
    return out + b"\xff" * count + data[at:]


JPEG = saved("jpeg", exif=block(), quality=98, subsampling=0)
CARRIERS = {
    "jpeg": JPEG,
    "jpeg-little": saved("jpeg", exif=block(order="II"), quality=98, subsampling=0),
    "jpeg-fill": filled(JPEG, 1),
    "jpeg-fills": filled(JPEG, 5),
    "jpeg-long": saved("jpeg", exif=block(kind=4), quality=98, subsampling=0),
    "jpeg-byte": saved("jpeg", exif=block(kind=1), quality=98, subsampling=0),
    "jpeg-xmp": saved("jpeg", xmp=XMP % 6, quality=98, subsampling=0),
    "png": png_of(PIXELS, (b"eXIf", block())),
    "png-late": png_of(PIXELS, late=((b"eXIf", block()),)),
    "png-mark": png_of(PIXELS, (b"eXIf", b"Exif\0\0" + block())),
    "png-raw": png_of(
        PIXELS, text(b"Raw profile type exif", raw("exif", b"Exif\0\0" + block()), 0)
    ),
    "png-raw-packed": png_of(
        PIXELS, text(b"Raw profile type APP1", raw("generic", b"Exif\0\0" + block()), True)
    ),
    "png-raw-late": png_of(
        PIXELS, late=(text(b"Raw profile type exif", raw("exif", block()), True),)
    ),
    "png-twice": png_of(
        PIXELS, (b"eXIf", block()), text(b"Raw profile type exif", raw("exif", block()), True)
    ),
    "png-xmp": png_of(PIXELS, (b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + XMP % 6)),
    "png-xmp-packed": png_of(
        PIXELS, (b"iTXt", b"XML:com.adobe.xmp\0\1\0en\0\0" + zlib.compress(XMP % 6))
    ),
    "png-xmp-raw": png_of(PIXELS, text(b"Raw profile type xmp", raw("xmp", XMP % 6), True)),
    "png-exif-and-xmp": png_of(
        PIXELS, (b"eXIf", block()), (b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + XMP % 6)
    ),
    "webp": saved("webp", exif=block(), lossless=True),
    "webp-mark": saved("webp", exif=b"Exif\0\0" + block(), lossless=True),
    "webp-xmp": saved("webp", xmp=XMP % 6, lossless=True),
    "tiff": tiff_of(PIXELS, t274=6),
    "tiff-big": tiff_of(PIXELS, order=">", t274=6),
}


@pytest.mark.parametrize("name", CARRIERS)
def test_orientation_is_turned_once_whatever_carries_it(tmp_path, name):
    picture = parse(CARRIERS[name], "a")
    assert picture.pixels.shape == TURNED.shape
    error = picture.pixels.astype(int) - TURNED
    assert abs(error).mean() < (12 if name.startswith("jpeg") else 1e-9)
    for suffix in (".png", ".jpg", ".tif", ".webp"):
        assert write(tmp_path / f"a{suffix}", picture.pixels, picture.blocks) == ()
        assert told((tmp_path / f"a{suffix}").read_bytes())["orientation"] == 1
        assert read(tmp_path / f"a{suffix}").pixels.shape == TURNED.shape


def test_exif_says_more_than_xmp():
    one = png_of(PIXELS, (b"eXIf", block(1)), (b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + XMP % 6))
    picture = parse(one, "a")
    np.testing.assert_array_equal(picture.pixels, PIXELS)
    assert picture.blocks["xmp"] == XMP % 1


@pytest.mark.parametrize("order", ["MM", "II"])
@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".webp", ".jxl", ".jp2"])
def test_blocks_arrive_in_every_type_that_holds_them(tmp_path, suffix, order):
    blocks = {"exif": exif.upright(block(order=order)), "xmp": XMP % 1}
    path = tmp_path / f"a{suffix}"
    assert write(path, PIXELS, blocks) == ()
    found = read(path)
    assert found.pixels.shape == PIXELS.shape
    assert found.blocks["xmp"] == blocks["xmp"]
    assert told(saved("jpeg", exif=found.blocks["exif"])) == TOLD
    if suffix not in (".jxl", ".jp2"):
        assert told(path.read_bytes()) == TOLD


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".webp"])
def test_putting_blocks_in_changes_no_pixel(tmp_path, suffix):
    with_alpha = np.dstack([PIXELS, 255 - PIXELS[..., :1] // 2]) if suffix != ".jpg" else PIXELS
    write(tmp_path / f"a{suffix}", with_alpha)
    write(tmp_path / f"b{suffix}", with_alpha, {"exif": block(1), "xmp": XMP % 1})
    plain, full = read(tmp_path / f"a{suffix}"), read(tmp_path / f"b{suffix}")
    np.testing.assert_array_equal(plain.pixels, full.pixels)
    assert plain.blocks == {}
    with Image.open(tmp_path / f"b{suffix}") as source:
        source.load()
        assert source.size == (133, 96)


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".webp"])
def test_files_have_the_same_bytes_at_any_time(tmp_path, suffix):
    found = []
    for _ in range(2):
        write(tmp_path / f"a{suffix}", PIXELS, {"exif": block(1)})
        found.append((tmp_path / f"a{suffix}").read_bytes())
    assert found[0] == found[1]
    assert b"OpenImageIO" not in found[0].replace(b"Software", b"")


@pytest.mark.parametrize("suffix", [".bmp", ".tga", ".ppm", ".npy", ".exr", ".gif"])
def test_types_that_hold_no_metadata_are_reported(tmp_path, suffix):
    (note,) = write(tmp_path / f"a{suffix}", PIXELS, {"exif": block(1), "xmp": XMP % 1})
    assert "EXIF and XMP" in note
    assert write(tmp_path / f"a{suffix}", PIXELS) == ()


def test_blocks_too_large_for_a_jpeg_segment_are_reported(tmp_path):
    big = XMP % 1 + b" " * 66_000
    (note,) = write(tmp_path / "a.jpg", PIXELS, {"exif": block(1), "xmp": big})
    assert "XMP" in note
    assert "EXIF" not in note
    assert set(read(tmp_path / "a.jpg").blocks) == {"exif"}


def test_directories_of_tiff_files_become_exif(tmp_path):
    for order in ("II", "MM"):
        write(tmp_path / "a.tif", PIXELS, {"exif": block(6, order)})
        found = read(tmp_path / "a.tif")
        np.testing.assert_array_equal(found.pixels, PIXELS)
        assert told(saved("jpeg", exif=found.blocks["exif"])) == TOLD


def test_the_second_page_of_a_tiff_file_has_metadata_of_its_own(tmp_path):
    pages = [Image.new("RGB", (20, 10), c) for c in ("red", "lime")]
    pages[0].encoderinfo = {"tiffinfo": {271: "first"}}
    pages[1].encoderinfo = {"tiffinfo": {271: "second"}}
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    for number in range(2):
        blocks = exif.from_tiff((tmp_path / "a.tif").read_bytes(), number)
        with Image.open(tmp_path / "a.tif") as source:
            source.seek(number)
            maker = source.tag_v2.get(271)
        assert told(saved("jpeg", exif=blocks.get("exif", b"")))["maker"] == maker


def test_resolution_and_software_alone_are_no_exif(tmp_path):
    Image.fromarray(PIXELS).save(tmp_path / "a.tif", dpi=(300, 300), software="x")
    assert read(tmp_path / "a.tif").blocks == {}


def test_a_thumbnail_of_a_picture_that_was_turned_is_dropped():
    plain = block()
    (count,) = struct.unpack_from(">H", plain, 8)
    link = 10 + 12 * count
    linked = plain[:link] + struct.pack(">I", len(plain)) + plain[link + 4 :] + bytes(6)
    assert exif.upright(linked)[link : link + 4] == bytes(4)
    straight = linked.replace(
        struct.pack(">HHIH", 0x0112, 3, 1, 6), struct.pack(">HHIH", 0x0112, 3, 1, 1)
    )
    assert exif.upright(straight) == straight


@pytest.mark.parametrize("name", ["jpeg", "webp", "png", "tiff", "jpeg-fill"])
def test_damaged_files_never_raise_another_error(name):
    data = CARRIERS[name]
    rng = np.random.default_rng(11)
    for _ in range(150):
        broken = bytearray(data[: rng.integers(1, 900)])
        for at in rng.integers(0, len(broken), 4):
            broken[at] = rng.integers(0, 256)
        metadata.raw_blocks(bytes(broken))
        metadata.left_out(bytes(broken))
        exif.upright(bytes(broken))


def test_damaged_directories_are_left_out():
    rng = np.random.default_rng(3)
    file = tiff_of(PIXELS[:4, :4])
    for _ in range(300):
        broken = bytearray(block())
        for at in rng.integers(4, len(broken), 3):
            broken[at] = rng.integers(0, 256)
        made = exif.into_tiff(file, {"exif": bytes(broken)})
        np.testing.assert_array_equal(parse(made, "a.tif").pixels.shape[2], 3)
        exif.orientation(bytes(broken))
        exif.is_adobe_rgb(bytes(broken))


def test_directories_in_circles_come_to_an_end():
    circle = bytearray(b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHII", 0x8769, 4, 1, 8) + bytes(4))
    assert exif.from_tiff(bytes(circle)) == {}


def test_what_is_neither_exif_nor_xmp_is_named():
    iptc = b"Photoshop 3.0\x008BIM\x04\x04\0\0\0\0\0\x05\x1c\x02\x05\0\0"
    more = b"http://ns.adobe.com/xmp/extension/\0" + bytes(40)
    parts = ((0xED, iptc), (0xE1, more), (0xFE, b"hello"))
    segments = b"".join(struct.pack(">BBH", 0xFF, m, len(b) + 2) + b for m, b in parts)
    data = JPEG[:2] + segments + JPEG[2:]
    assert metadata.left_out(data) == ["IPTC", "extended XMP", "comments"]
    assert parse(data, "a.jpg").notes == ("IPTC, extended XMP, comments: left out",)
    assert metadata.left_out(png_of(PIXELS, (b"tEXt", b"Title\0Cat"))) == ["texts"]
    assert metadata.left_out(png_of(PIXELS, (b"tEXt", b"Software\0Cat"))) == []
    assert metadata.left_out(JPEG) == []
    assert metadata.left_out(tiff_of(PIXELS, t33723=7)) == ["IPTC"]
    assert metadata.left_out(tiff_of(PIXELS)) == []
    gif, xmp = saved("gif"), b"!\xff\x0bXMP DataXMP<x:xmpmeta/>\1\xff\xfe\0\0"
    assert parse(gif[:-1] + xmp + b";", "a.gif").notes == ("XMP: left out",)
    assert parse(gif, "a.gif").notes == ()


def test_boxes_that_are_open_ended_or_long(tmp_path):
    write(tmp_path / "a.jp2", PIXELS)
    data = (tmp_path / "a.jp2").read_bytes()
    at = data.rindex(b"jp2c") - 4
    open_ended = data[:at] + bytes(4) + data[at + 4 :]
    made = boxes.put(open_ended, {"xmp": XMP % 1})
    assert parse(made, "a.jp2").blocks == {"xmp": XMP % 1}
    size = len(data) - at
    long = data[:at] + b"\0\0\0\1jp2c" + (size + 8).to_bytes(8, "big") + data[at + 8 :]
    assert dict(boxes.blocks(boxes.put(long, {"exif": block(1)}))) == {"exif": block(1)}
