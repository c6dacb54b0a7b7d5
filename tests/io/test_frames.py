"""Files that hold several pictures: which one is read, as it is displayed, and what is said."""

import contextlib
import io
import struct

import numpy as np
import pytest

from proxyimg_codec.errors import InputError, UnsupportedError
from proxyimg_codec.io.raster import parse, read
from tests.support.profiles import png_of

oiio = pytest.importorskip("OpenImageIO")
Image = pytest.importorskip("PIL.Image")
ImageDraw = pytest.importorskip("PIL.ImageDraw")

COLOURS = [(200, 30, 20), (20, 180, 40), (30, 40, 210), (240, 240, 20)]


def moved(count=4, size=(41, 27), clear=False):
    """RGBA frames: a square that moves over a plain or transparent ground."""
    found = []
    for k in range(count):
        ground = (0, 0, 0, 0) if clear else (90, 80, 70, 255)
        frame = Image.new("RGBA", size, ground)
        ImageDraw.Draw(frame).rectangle([3 + 6 * k, 4, 9 + 6 * k, 11], fill=(*COLOURS[k], 255))
        found.append(frame)
    return found


def animation(kind, frames, **how):
    out = io.BytesIO()
    frames[0].save(out, kind, save_all=True, append_images=frames[1:], **how)
    return out.getvalue()


ANIMATIONS = {
    "gif-kept": ("gif", False, {"duration": 50, "disposal": 1}),
    "gif-cleared": ("gif", True, {"duration": 50, "disposal": 2}),
    "webp": ("webp", False, {"duration": 50, "lossless": True}),
    "webp-clear": ("webp", True, {"duration": 50, "lossless": True}),
    "png-kept": ("png", False, {"duration": 50}),
    "png-cleared": ("png", True, {"duration": 50, "disposal": 1, "blend": 0}),
}


@pytest.mark.parametrize("number", [None, 0, 1, 3])
@pytest.mark.parametrize("name", ANIMATIONS)
def test_frames_of_animations_are_as_they_are_displayed(name, number):
    kind, clear, how = ANIMATIONS[name]
    frames = moved(clear=clear)
    picture = parse(animation(kind, frames, **how), "a", frame=number)
    wanted = np.asarray(frames[number or 0])
    found = picture.pixels
    if found.shape[2] == 3:
        found = np.dstack([found, np.full_like(found[..., :1], 255)])
    seen = (found[..., 3] > 0) | (wanted[..., 3] > 0)
    assert abs(found.astype(int) - wanted)[seen].max() <= 8  # palettes of GIF
    if number is None:
        assert "holds 4 pictures, of which number 0" in picture.notes[0]
    else:
        assert picture.notes == ()


def test_a_picture_apart_comes_before_the_frames_of_an_apng():
    out = io.BytesIO()
    frames = moved(3)
    frames[0].save(out, "png", save_all=True, append_images=frames[1:], default_image=True)
    assert "holds 3 pictures" in parse(out.getvalue(), "a").notes[0]
    last = parse(out.getvalue(), "a", frame=2).pixels
    np.testing.assert_array_equal(last, np.asarray(frames[2])[..., :3])


@pytest.mark.parametrize("number", [None, 0, 1, 2])
def test_pages_of_tiff(tmp_path, number):
    pages = [Image.new("RGB", (20 + k, 10), COLOURS[k]) for k in range(3)]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    picture = read(tmp_path / "a.tif", frame=number)
    assert picture.pixels.shape == (10, 20 + (number or 0), 3)
    assert tuple(picture.pixels[0, 0]) == COLOURS[number or 0]
    assert bool(picture.notes) == (number is None)


def test_thumbnails_of_tiff_are_no_pictures(tmp_path):
    """NewSubfileType 1 is a reduced version, wherever it stands; 4 is a mask (TIFF 6.0)."""
    wide, small = np.full((8, 30, 3), 9, np.uint8), np.full((4, 15, 3), 200, np.uint8)
    for order, kind in (((small, wide), 1), ((wide, small), 1), ((small, wide, wide), 4)):
        target = oiio.ImageOutput.create("a.tif")
        specs = []
        for pixels in order:
            spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8")
            if pixels is small:
                spec.attribute("tiff:subfiletype", kind)
            specs.append(spec)
        path = str(tmp_path / "a.tif")
        assert target.open(path, tuple(specs))
        for k, pixels in enumerate(order):
            assert k == 0 or target.open(path, specs[k], "AppendSubimage")
            target.write_image(pixels)
        target.close()
        source = oiio.ImageInput.open(path)
        kinds = []
        while source.seek_subimage(len(kinds), 0):
            kinds.append(source.spec().get_int_attribute("tiff:subfiletype"))
        source.geterror()
        source.close()
        if kind not in kinds:
            pytest.skip("this OpenImageIO does not write what the test is about")
        picture = read(path)
        assert picture.pixels.shape == wide.shape
        assert bool(picture.notes) == (len(order) > 2)


@pytest.mark.parametrize("sizes", [[16, 32, 64], [64, 16, 32], [24, 48]])
def test_the_largest_of_an_icon(tmp_path, sizes):
    biggest = Image.new("RGB", (256, 256), COLOURS[0])
    biggest.save(tmp_path / "a.ico", sizes=[(n, n) for n in sizes])
    picture = read(tmp_path / "a.ico")
    assert picture.pixels.shape[:2] == (max(sizes), max(sizes))
    assert f"holds {len(sizes)} pictures" in picture.notes[0]
    found = {read(tmp_path / "a.ico", frame=k).pixels.shape[0] for k in range(len(sizes))}
    assert found == set(sizes)


def test_parts_of_openexr(tmp_path):
    path = str(tmp_path / "a.exr")
    specs = [oiio.ImageSpec(11, 5, 3, "half") for k in range(3)]
    for k, spec in enumerate(specs):
        spec.attribute("oiio:subimagename", f"part {k}")
    target = oiio.ImageOutput.create(path)
    assert target.open(path, tuple(specs))
    for k, spec in enumerate(specs):
        assert k == 0 or target.open(path, spec, "AppendSubimage")
        target.write_image(np.full((5, 11, 3), 0.25 * (k + 1), np.float32))
    target.close()
    assert "holds 3 pictures" in read(path).notes[0]
    picture = read(path, frame=2)
    assert picture.pixels.shape == (5, 11, 3)
    np.testing.assert_allclose(picture.pixels, 0.8808, atol=1e-3)  # 0.75 of the light


@pytest.mark.parametrize("number", [0, 1, 2])
def test_pictures_behind_the_first_of_a_jpeg_file(number):
    frames = [Image.new("RGB", (24 + 8 * k, 16), COLOURS[k]) for k in range(3)]
    data = animation("mpo", frames)
    assert "holds 3 pictures" in parse(data, "a.jpg").notes[0]
    picture = parse(data, "a.jpg", frame=number)
    assert picture.pixels.shape == (16, 24 + 8 * number, 3)
    assert abs(picture.pixels[0, 0].astype(int) - COLOURS[number]).max() < 6


def files(tmp_path):
    frames = moved(2)
    Image.new("RGB", (9, 9)).save(tmp_path / "one.tif")
    frames[0].convert("RGB").save(tmp_path / "one.jpg")
    np.save(tmp_path / "one.npy", np.zeros((3, 3), np.uint8))
    (tmp_path / "one.png").write_bytes(png_of(np.zeros((4, 4, 3), np.uint8)))
    (tmp_path / "two.gif").write_bytes(animation("gif", frames, duration=50))
    (tmp_path / "two.png").write_bytes(animation("png", frames, duration=50))
    (tmp_path / "two.mpo").write_bytes(animation("mpo", [f.convert("RGB") for f in frames]))
    frames[0].save(tmp_path / "one.gif")
    return sorted(p for p in tmp_path.iterdir())


def test_frames_that_are_not_there_are_refused(tmp_path):
    for path in files(tmp_path):
        for number in (-1, 2, 99, *([1] if path.name.startswith("one") else [])):
            with pytest.raises(InputError, match=rf"--frame {number}: it has \d picture"):
                read(path, frame=number)
        assert read(path, frame=0).notes == ()


def test_damaged_animations_raise_no_other_error():
    rng = np.random.default_rng(4)
    for kind, _, how in ANIMATIONS.values():
        data = animation(kind, moved(3), **how)
        for _ in range(25):
            broken = bytearray(data[: rng.integers(20, len(data))])
            broken[rng.integers(8, len(broken))] ^= 85
            with contextlib.suppress(InputError):
                parse(bytes(broken), "a", frame=1)


def test_an_index_of_pictures_that_is_damaged_is_passed_over():
    data = animation("mpo", [Image.new("RGB", (24, 16), c) for c in COLOURS[:2]])
    at = data.index(b"MPF\0")
    rng = np.random.default_rng(8)
    for _ in range(60):
        broken = bytearray(data)
        for place in rng.integers(at + 4, at + 80, 3):
            broken[place] = rng.integers(0, 256)
        assert parse(bytes(broken), "a.jpg").pixels.shape == (16, 24, 3)
    assert struct.unpack(">H", data[:2]) == (0xFFD8,)


def test_animations_need_pillow(monkeypatch):
    data = animation("gif", moved(2), duration=50)
    monkeypatch.setitem(__import__("sys").modules, "PIL", None)
    with pytest.raises(UnsupportedError, match="needs Pillow"):
        parse(data, "a.gif")
