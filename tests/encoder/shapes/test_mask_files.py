"""Masks that users save: folders and label pictures of all types, and what is refused."""

import logging

import numpy as np
import pytest
from PIL import Image

from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.errors import InputError

WIDTH, HEIGHT = 29, 23
LABELS = np.zeros((HEIGHT, WIDTH), np.uint8)
LABELS[2:11, 1:9], LABELS[8:20, 12:27], LABELS[14:22, 2:10] = 1, 2, 3
INSIDE = LABELS == 2
WHITE_FIRST = [255, 255, 255, 128, 0, 0, 0, 0, 0, 0, 128, 0]
VOC = [0, 0, 0, 128, 0, 0, 0, 128, 0, 128, 128, 0]


def load(path):
    return {r.name: r.mask for r in load_masks(path, WIDTH, HEIGHT)}


def save(path, values, mode=None, **options):
    image = Image.fromarray(np.asarray(values))
    assert mode is None or image.mode == mode
    image.save(path, **options)
    return path


def indexed(indices, palette):
    image = Image.new("P", indices.shape[::-1])
    image.putdata(indices.ravel().tolist())
    image.putpalette(palette)
    return image


def check_labels(path, labels=LABELS):
    found = load(path)
    assert list(found) == ["back" if k == 0 else f"object {k}" for k in np.unique(labels)]
    for name, mask in found.items():
        number = 0 if name == "back" else int(name.split()[1])
        np.testing.assert_array_equal(mask, labels == number, err_msg=name)


@pytest.mark.parametrize("palette", [WHITE_FIRST, VOC], ids=["white first", "VOC"])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.png", {"bits": 2}),
        ("a.png", {"bits": 4}),
        ("a.png", {"bits": 8}),
        ("a.png", {"transparency": 0}),
        ("a.png", {"transparency": bytes([255, 90, 0, 255])}),
        ("a.tif", {}),
        ("a.gif", {}),
        ("a.bmp", {}),
    ],
    ids=str,
)
def test_the_index_of_a_palette_is_the_label(tmp_path, palette, name, options):
    indexed(LABELS, palette).save(tmp_path / name, **options)
    check_labels(tmp_path / name)


def test_a_palette_of_two_colours(tmp_path):
    indexed(LABELS % 2, [240, 240, 10, 90, 0, 90]).save(tmp_path / "a.png", bits=1)
    check_labels(tmp_path / "a.png", LABELS % 2)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.npy"])
@pytest.mark.parametrize("values", [(0, 1, 2, 3), (0, 257, 300, 65535)])
def test_greys_of_8_and_16_bits(tmp_path, name, values):
    labels = np.array(values, np.uint8 if values[3] < 256 else np.uint16)[LABELS]
    path = tmp_path / name
    np.save(path, labels) if name == "a.npy" else save(path, labels)
    check_labels(path, labels)


def low_bits(labels, bits):
    """A PNG file of greys of a few bits, which Pillow cannot write; of a palette it can."""
    import io
    import struct
    import zlib

    buffer = io.BytesIO()
    indexed(labels, list(range(3 * 2**bits))).save(buffer, "PNG", bits=bits)
    data = buffer.getvalue()
    header = data[16:25] + b"\0" + data[26:29]
    crc = struct.pack(">I", zlib.crc32(b"IHDR" + header))
    palette = data.index(b"PLTE") - 4
    length = 12 + int.from_bytes(data[palette : palette + 4], "big")
    return data[:16] + header + crc + data[33:palette] + data[palette + length :]


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_greys_of_a_few_bits_are_not_scaled(tmp_path, bits):
    labels = LABELS % 2**bits
    (tmp_path / "a.png").write_bytes(low_bits(labels, bits))
    check_labels(tmp_path / "a.png", labels)


def test_colours_of_rgb(tmp_path):
    save(tmp_path / "a.png", np.array(VOC, np.uint8).reshape(4, 3)[LABELS], "RGB")
    # Packed, 0x008000 comes before 0x800000.
    check_labels(tmp_path / "a.png", np.array([0, 2, 1, 3], np.uint8)[LABELS])


@pytest.mark.parametrize("mode", ["LA", "RGBA"])
def test_what_is_clear_is_the_back(tmp_path, mode):
    alpha = np.where(LABELS == 1, 0, 255).astype(np.uint8)
    grey = [LABELS] * (1 if mode == "LA" else 3)
    save(tmp_path / "a.png", np.dstack([*grey, alpha]), mode)
    check_labels(tmp_path / "a.png", np.where(LABELS == 1, 0, LABELS))
    alpha[3, 4] = 200
    save(tmp_path / "a.png", np.dstack([*grey, alpha]), mode)
    with pytest.raises(InputError, match=r"a\.png: .*half transparent"):
        load(tmp_path / "a.png")


def test_orientation_is_applied(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # shown turned clockwise
    save(tmp_path / "a.png", np.rot90(LABELS).copy(), exif=exif)
    check_labels(tmp_path / "a.png")


def test_label_pictures_with_loss_are_refused(tmp_path):
    for name, options in (("a.jpg", {"quality": 95}), ("a.webp", {"quality": 60})):
        save(tmp_path / name, np.repeat(LABELS[..., None] * np.uint8(80), 3, 2), **options)
        with pytest.raises(InputError, match=name):
            load(tmp_path / name)


def test_label_pictures_that_hold_no_whole_numbers_are_refused(tmp_path):
    save(tmp_path / "whole.tif", LABELS.astype(np.float32), "F")
    check_labels(tmp_path / "whole.tif")
    save(tmp_path / "half.tif", LABELS.astype(np.float32) / 2, "F")
    np.save(tmp_path / "half.npy", LABELS / 2)
    np.save(tmp_path / "deep.npy", np.zeros((2, HEIGHT, WIDTH), int))
    for name, why in (("half.tif", "whole"), ("half.npy", "whole"), ("deep.npy", "shape")):
        with pytest.raises(InputError, match=f"{name}: .*{why}"):
            load(tmp_path / name)
    Image.new("CMYK", (WIDTH, HEIGHT)).save(tmp_path / "ink.tif")
    with pytest.raises(InputError, match="CMYK"):
        load(tmp_path / "ink.tif")


# Folders


def test_a_folder_is_read_in_natural_order_with_the_background_first(tmp_path):
    for k, name in enumerate(["object 10", "object 2", "Background"]):
        save(tmp_path / f"{name}.png", (k == LABELS) * np.uint8(255))
    found = load(tmp_path)
    assert list(found) == ["Background", "object 2", "object 10"]
    for k, mask in enumerate(reversed(found.values())):
        np.testing.assert_array_equal(mask, k == LABELS)


def test_numbers_that_order_files_are_no_part_of_names(tmp_path):
    for name in ("2 cat", "10_dog", "1-sky", "7", "3 "):
        save(tmp_path / f"{name}.png", INSIDE * np.uint8(255))
    assert list(load(tmp_path)) == ["sky", "cat", "3 ", "7", "dog"]


def test_names_that_cannot_be_printed(tmp_path):
    save(tmp_path / "1 c\na\udce9t.png", INSIDE * np.uint8(255))
    assert list(load(tmp_path)) == ["c?a?t"]


def test_what_is_no_mask_is_passed_over(tmp_path, caplog):
    save(tmp_path / "cat.png", INSIDE * np.uint8(255))
    (tmp_path / "._cat.png").write_bytes(b"\0\5\x16\7 of a Mac")
    (tmp_path / ".DS_Store").write_bytes(b"\0\0\0\1Bud1")
    (tmp_path / ".hidden").mkdir()
    (tmp_path / "Thumbs.db").write_bytes(b"thumbs")
    (tmp_path / "notes.txt").write_text("not a mask")
    assert list(load(tmp_path)) == ["cat"]
    assert not caplog.records
    (tmp_path / "more.png").mkdir()
    assert list(load(tmp_path)) == ["cat"]
    assert "more.png: a folder without masks; it is left out" in caplog.text
    for name in ("shapes.svg", "all.ora", "deep.exr"):
        (tmp_path / name).write_bytes(b"no mask")
    assert list(load(tmp_path)) == ["cat"]
    assert "deep.exr: no type of masks; it is left out" in caplog.text
    assert len(caplog.records) == 1 + 4
    (tmp_path / "cat.png").unlink()
    with pytest.raises(InputError, match="holds no picture"):
        load(tmp_path)


def test_a_folder_within_holds_parts_in_front_of_their_whole(tmp_path):
    names = ["1 bush", "2 cat", "3 dog", "cat/2 pupil", "cat/1 eye", "2 cat/ear", "dog.v1/tail",
             "cat/1 eye/glint", "0 sun/ray"]  # fmt: skip
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        save(tmp_path / f"{name}.png", INSIDE * np.uint8(255))
    assert list(load(tmp_path)) == [
        "dog.v1/tail", "sun/ray", "bush", "cat", "cat/ear", "cat/eye", "cat/eye/glint",
        "cat/pupil", "dog",
    ]  # fmt: skip


def test_folders_within_are_read_like_the_first(tmp_path, caplog):
    (tmp_path / "cat" / ".hidden").mkdir(parents=True)
    save(tmp_path / "cat" / "eye.png", INSIDE * np.uint8(255))
    (tmp_path / "cat" / "notes.txt").write_text("not a mask")
    assert list(load(tmp_path)) == ["cat/eye"]
    assert not caplog.records
    (tmp_path / "cat" / "again").symlink_to(tmp_path)
    (tmp_path / "cat" / "deep.exr").write_bytes(b"no mask")
    assert list(load(tmp_path)) == ["cat/eye"]
    assert [r.args[0].name for r in caplog.records] == ["again", "deep.exr"]
    save(tmp_path / "cat" / "eye.png", np.zeros((5, 9), np.uint8))
    with pytest.raises(InputError, match=r"cat.eye\.png: the mask is 9x5"):
        load(tmp_path)


def test_hundreds_of_masks_are_refused_before_they_are_read(tmp_path):
    for k in range(301):
        (tmp_path / f"{k}.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"301 masks in .* are too many; at most 64"):
        load(tmp_path)


def test_folders_without_end_are_refused(tmp_path):
    deep = tmp_path.joinpath(*["a" * 40] * 6)
    deep.mkdir(parents=True)
    with pytest.raises(InputError, match="lies too deep"):
        load(tmp_path)


GREY = np.where(INSIDE, 128, 127).astype(np.uint8)
CLEAR = np.dstack([GREY, np.where(INSIDE, 255, 0).astype(np.uint8)])


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("grey.png", GREY),
        ("ones.png", INSIDE.astype(np.uint8)),
        ("faint.png", INSIDE * np.uint8(60)),
        ("bits.png", INSIDE),
        ("deep.png", INSIDE * np.uint16(65535)),
        ("deep ones.png", INSIDE.astype(np.uint16)),
        ("float.tif", INSIDE.astype(np.float32)),
        ("yellow.png", np.where(INSIDE[..., None], (255, 255, 0), 20).astype(np.uint8)),
        ("alpha.png", CLEAR),
        ("opaque alpha.png", np.dstack([GREY, np.full_like(GREY, 255)])),
        ("array.npy", INSIDE),
    ],
)
def test_what_counts_as_inside(tmp_path, name, values, caplog):
    np.save(tmp_path / name, values) if name.endswith("npy") else save(tmp_path / name, values)
    (mask,) = load(tmp_path).values()
    np.testing.assert_array_equal(mask, INSIDE)
    assert not caplog.records


@pytest.mark.parametrize(
    ("palette", "inside"),
    [
        (WHITE_FIRST[:6], INSIDE),  # with colours, index 0 is outside
        ([0, 0, 0, 255, 255, 255], INSIDE),
        ([255, 255, 255, 0, 0, 0], ~INSIDE),  # black and white mean what they show
    ],
)
def test_masks_with_palettes(tmp_path, palette, inside):
    indexed(INSIDE.astype(np.uint8), palette).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load(tmp_path)["a"], inside)


@pytest.mark.parametrize("kind", ["grey", "alpha", "deep", "float", "jpeg"])
@pytest.mark.parametrize("steep", [True, False])
def test_masks_of_many_values_have_alpha_and_that_narrow_rims_are_cut_is_said(
    tmp_path, kind, steep, caplog
):
    ramp = (np.arange(WIDTH) - 12.8) / 3 if steep else np.linspace(0, 1, WIDTH)
    soft = np.tile(ramp.clip(0, 1), (HEIGHT, 1))
    eight = np.rint(255 * soft).astype(np.uint8)
    values = {
        "grey": eight,
        "alpha": np.dstack([eight * 0, eight]),
        "deep": np.rint(65535 * soft).astype(np.uint16),
        "float": soft.astype(np.float32),
        "jpeg": eight,
    }
    suffix = {"float": "tif", "jpeg": "jpg"}.get(kind, "png")
    save(tmp_path / f"veil.{suffix}", values[kind])
    save(tmp_path / "rock.png", INSIDE * np.uint8(255))
    with caplog.at_level(logging.WARNING):
        rock, veil = load_masks(tmp_path, WIDTH, HEIGHT)
    np.testing.assert_array_equal(veil.mask[:, [0, 10, 18, 28]], np.tile([0, 0, 1, 1], (HEIGHT, 1)))
    np.testing.assert_allclose(veil.alpha, soft, atol=0.02)
    assert rock.alpha is None
    assert len(caplog.records) == steep
    if not steep:
        return
    assert f"veil.{suffix}" in caplog.text
    assert "one half" in caplog.text
    assert "rock" not in caplog.text


def test_labels_among_masks_and_faint_masks_are_refused(tmp_path):
    save(tmp_path / "labels.png", LABELS)
    with pytest.raises(InputError, match=r"labels\.png.*labels are given alone"):
        load(tmp_path)


@pytest.mark.parametrize("shape", [(HEIGHT, WIDTH + 1), (WIDTH, HEIGHT), (5, 9)])
@pytest.mark.parametrize("folder", [True, False])
def test_wrong_sizes_are_refused_with_both_sizes(tmp_path, shape, folder):
    save(tmp_path / "cat.png", np.zeros(shape, np.uint8))
    with pytest.raises(InputError, match=rf"cat\.png.*{shape[1]}x{shape[0]}.*{WIDTH}x{HEIGHT}"):
        load(tmp_path if folder else tmp_path / "cat.png")


def test_unusable_paths_are_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="holds no picture"):
        load(tmp_path)
    with pytest.raises(InputError, match=r"missing.png: cannot read"):
        load(tmp_path / "missing.png")
    whole = save(tmp_path / "whole.png", LABELS).read_bytes()
    for data in (b"", b"hello", b"\x89PNG\r\n\x1a\n broken", whole[:60], b"\x93NUMPY\1\0"):
        (tmp_path / "a.png").write_bytes(data)
        for path in (tmp_path, tmp_path / "a.png"):
            with pytest.raises(InputError, match=r"a\.png: the mask is no valid picture(?!.*0x)"):
                load(path)


def test_several_pictures_in_one_file_are_refused(tmp_path):
    frames = [Image.fromarray(LABELS), Image.fromarray(LABELS + 1)]
    frames[0].save(tmp_path / "a.tif", save_all=True, append_images=frames[1:])
    with pytest.raises(InputError, match="holds 2 pictures"):
        load(tmp_path / "a.tif")
