"""Pillow opens, makes small and saves `.pxi` files."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import proxyimg_codec as pxi
from tests.support.files import SMALL
from tests.support.images import changed
from tests.support.paths import ROOT
from tests.support.pictures import smooth

Image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
ImageFile = pytest.importorskip("PIL.ImageFile")
plugin = pytest.importorskip("proxyimg_codec.pillow")
encoder = pytest.mark.encoder

DATA = SMALL.read_bytes()


@pytest.fixture
def drawn(monkeypatch):
    """Sizes at which pictures were drawn."""
    sizes = []
    render = pxi.Image.render

    def counted(image, **options):
        sizes.append((options["width"], options["height"]))
        return render(image, **options)

    monkeypatch.setattr(pxi.Image, "render", counted)
    return sizes


def test_opening_draws_nothing(drawn):
    with Image.open(SMALL) as im:
        assert (im.format, im.mode, im.size) == ("PXI", "RGB", (64, 48))
        assert im.get_format_mimetype() == "image/vnd.pxi"
        assert [layer.name for layer in im.pxi.layers] == ["back", "bar", "disc"]
        assert not drawn
        im.load()
        im.load()
    assert drawn == [(64, 48)]


def test_pixels_are_those_of_the_renderer():
    for file in (SMALL, str(SMALL), io.BytesIO(DATA)):
        with Image.open(file) as im:
            np.testing.assert_array_equal(np.asarray(im), pxi.open(SMALL).render())
    with Image.open(SMALL) as im:
        corner = im.crop((3, 5, 20, 31))
    np.testing.assert_array_equal(np.asarray(corner), pxi.open(SMALL).render()[5:31, 3:20])


def test_what_has_holes_has_alpha(tmp_path):
    image = pxi.open(SMALL).layers["back"].hidden()
    image.save(tmp_path / "a.pxi")
    with Image.open(tmp_path / "a.pxi") as im:
        assert im.mode == "RGBA"
        np.testing.assert_array_equal(np.asarray(im), image.render())


def test_a_thumbnail_is_drawn_at_its_size(drawn):
    with Image.open(SMALL) as im:
        im.thumbnail((20, 20))
        assert im.size == (20, 15)
        pixels = np.asarray(im)
    assert drawn == [(20, 15)]
    np.testing.assert_array_equal(pixels, pxi.open(SMALL).render(width=20, height=15))


def test_a_thumbnail_of_what_is_drawn_already_is_resampled(drawn):
    for load, gap in ((True, 2.0), (False, None)):
        with Image.open(SMALL) as im:
            if load:
                im.load()
            im.thumbnail((20, 20), reducing_gap=gap)
            assert (im.size, drawn.pop(), drawn) == ((20, 15), (64, 48), [])


@given(st.tuples(*4 * [st.integers(1, 200)]))
def test_thumbnails_have_the_size_that_others_have(sizes):
    canvas, most = sizes[:2], sizes[2:]
    plain = Image.new("1", canvas)
    plain.thumbnail(most, reducing_gap=None)
    assert plugin._fitting(canvas, most) == plain.size


def test_a_draft_is_as_large_as_asked_and_no_larger(drawn):
    with Image.open(SMALL) as im:
        assert im.draft(None, (20, 20)) == ("RGB", (0, 0, 27, 20))
        assert im.size == (27, 20)
        assert im.draft("L", (30, 5)) == ("RGB", (0, 0, 30, 23))
        assert im.draft(None, (900, 5)) == ("RGB", (0, 0, 64, 48))
        im.draft(None, (9, 9))
        assert np.asarray(im).shape == (9, 12, 3)
        assert im.draft(None, (5, 5)) is None
    assert drawn == [(12, 9)]


def test_metadata_and_colours_are_passed_on(tmp_path):
    from PIL import ImageCms

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    exif = Image.Exif()
    exif[0x010F] = "Maker"
    blocks = {"icc": profile, "exif": exif.tobytes().removeprefix(b"Exif\0\0"), "xmp": b"<x/>"}
    changed(pxi.open(SMALL), blocks=blocks).save(tmp_path / "a.pxi")
    with Image.open(tmp_path / "a.pxi") as im:
        assert im.info["icc_profile"] == profile
        assert im.info["xmp"] == b"<x/>"
        assert im.getexif()[0x010F] == "Maker"
    changed(pxi.open(SMALL), blocks={"cicp": bytes((12, 13, 0, 1))}).save(tmp_path / "b.pxi")
    pytest.importorskip("imagecodecs")
    with Image.open(tmp_path / "b.pxi") as im:
        ImageCms.ImageCmsProfile(io.BytesIO(im.info["icc_profile"]))


def test_half_a_file_is_refused_or_taken_as_far_as_it_goes(monkeypatch):
    data = (ROOT / "spec" / "example.pxi").read_bytes()
    for cut in (9, 30, len(data) // 2, len(data) - 1):
        with pytest.raises(OSError, match=r"truncated|byte"):
            Image.open(io.BytesIO(data[:cut]))
    monkeypatch.setattr(ImageFile, "LOAD_TRUNCATED_IMAGES", True)
    with Image.open(io.BytesIO(data[:-5])) as im:
        assert im.pxi.damage
        im.load()


def test_what_is_no_picture_is_not_identified():
    for data in (b"", b"\x89PNG\r\n\x1a\nrest", b"\x89PX", b"nothing at all that is known"):
        with pytest.raises(Image.UnidentifiedImageError):
            Image.open(io.BytesIO(data))


def test_bombs_are_told_by_the_size_of_what_is_drawn(monkeypatch):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 64 * 48 // 3)
    with pytest.raises(Image.DecompressionBombError):
        Image.open(SMALL)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 64 * 48 - 1)
    with pytest.warns(Image.DecompressionBombWarning):
        im = Image.open(SMALL)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(Image.DecompressionBombError, match="output pixels"):
        im.load()
    im.thumbnail((14, 14))
    assert np.asarray(im).shape == (11, 14, 3)
    im.close()
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None)
    Image.open(SMALL).close()


@encoder
def test_saving_encodes_with_options(tmp_path):
    original = Image.fromarray(smooth(61, 43))
    files = {}
    for quality in (10, 90):
        path = tmp_path / f"{quality}.pxi"
        original.save(path, quality=quality, effort=1, max_layers=1, optimize=True, jobs=1)
        files[quality] = path.read_bytes()
    assert len(files[10]) < len(files[90])
    want = pxi.encode(smooth(61, 43), quality=90, effort=1, max_layers=1, jobs=1)
    assert files[90] == want.to_bytes()
    buffer = io.BytesIO()
    masks = {"left": np.arange(61)[None] < np.full((43, 1), 20)}
    original.save(buffer, "PXI", effort=1, masks=masks)
    assert [v.name for v in pxi.from_bytes(buffer.getvalue()).layers] == ["back", "left"]


@encoder
@pytest.mark.parametrize(
    ("mode", "like"),
    [("1", "RGB"), ("L", "RGB"), ("LA", "RGBA"), ("P", "RGB"), ("RGBA", "RGBA"), ("CMYK", "RGB"),
     ("YCbCr", "RGB"), ("I;16", "RGB")],
)  # fmt: skip
def test_modes(mode, like, tmp_path):
    if mode == "I;16":
        grey = smooth(29, 23)[..., 0].astype(np.uint16) * 257
        im = Image.fromarray(grey)
        want = np.repeat((grey // 257).astype(np.uint8)[..., None], 3, 2)
    else:
        im = Image.fromarray(smooth(29, 23)).convert(mode)
        want = np.asarray(im.convert(like))
    assert im.mode == mode
    im.save(tmp_path / "a.pxi", quality=100, effort=1, max_layers=1)
    with Image.open(tmp_path / "a.pxi") as again:
        assert again.pxi.depth == (16 if mode == "I;16" else 8)
        got = np.asarray(again.convert(like)).astype(int)
    assert np.abs(got - want).mean() < 8


@encoder
def test_clear_colours_of_palettes_stay_clear(tmp_path):
    im = Image.fromarray(np.repeat(np.array([[0, 1]], np.uint8), 24, 0).repeat(12, 1)).convert("P")
    im.putpalette([200, 30, 30, 10, 90, 220])
    im.save(tmp_path / "a.pxi", effort=1, transparency=1)
    im.info["transparency"] = 1
    im.save(tmp_path / "b.pxi", effort=1)
    with Image.open(tmp_path / "b.pxi") as again:
        alpha = np.asarray(again)[..., 3]
    assert alpha[:, :10].min() > 200
    assert alpha[:, 14:].max() < 50


@encoder
def test_saving_carries_metadata_and_turns_pixels(tmp_path):
    exif = Image.Exif()
    exif[0x0112], exif[0x010F] = 6, "Maker"
    im = Image.fromarray(smooth(61, 43))
    im.info["xmp"] = b"<x/>"
    im.save(tmp_path / "a.pxi", effort=1, max_layers=1, exif=exif, quality=95)
    with Image.open(tmp_path / "a.pxi") as again:
        assert again.size == (43, 61)
        assert (again.getexif().get(0x0112), again.getexif()[0x010F]) == (1, "Maker")
        assert again.info["xmp"] == b"<x/>"
        turned = np.asarray(im.transpose(Image.Transpose.ROTATE_270)).astype(int)
        assert np.abs(np.asarray(again) - turned).mean() < 8


@encoder
def test_what_cannot_be_saved_leaves_nothing(tmp_path):
    im = Image.fromarray(smooth(29, 23))
    with pytest.raises(ValueError, match="quality"):
        im.save(tmp_path / "a.pxi", quality=500)
    for mode in ("F", "I"):
        with pytest.raises(OSError, match=f"cannot write mode {mode}"):
            im.convert("L").convert(mode).save(tmp_path / "a.pxi")
    assert not os.listdir(tmp_path)


def test_without_the_import_pillow_does_not_know_it():
    code = f"""from PIL import Image, UnidentifiedImageError
try: Image.open({str(SMALL)!r})
except UnidentifiedImageError: import proxyimg_codec.pillow
print(Image.open({str(SMALL)!r}).size)"""
    command = [sys.executable, "-W", "error", "-W", "ignore::ResourceWarning", "-c", code]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert ran.stdout == "(64, 48)\n", ran.stderr
