"""Pictures of the user behind objects, and what inpainters make of what is hidden."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec import plugins
from proxyimg_codec.errors import InputError, UsageError
from proxyimg_codec.io.psnr import psnr_8bit
from tests.support import onnx_models

HEIGHT, WIDTH = 77, 109
Y, X = np.mgrid[:HEIGHT, :WIDTH]
OBJECT = (abs(Y - 41) < 21) & (abs(X - 50) < 25)
AROUND, INSIDE = np.s_[17:66, 22:79], np.s_[24:59, 29:72]
FAST = {"effort": 1, "jobs": 1, "quality": 70}


def ground():
    """uint8 [77, 109, 3]: waves that a smooth fill does not guess."""
    waves = [120 + 60 * np.sin(X / 5), 120 + 60 * np.cos((X + Y) / 7), 80 + Y]
    return np.stack(waves, -1).astype(np.uint8)


def without():
    """What the user brings: the ground with a blue disc where the object is."""
    return np.where((np.hypot(Y - 41, X - 50) < 13)[..., None], np.uint8([20, 40, 230]), ground())


def picture():
    """The ground with a red object before it."""
    return np.where(OBJECT[..., None], np.uint8([230, 20, 20]), ground())


def encoded(pixels=None, **options):
    pixels = picture() if pixels is None else pixels
    return pxi.encode(pixels, **{"masks": {"box": OBJECT}, **FAST, **options})


def revealed(image):
    return image.layers["box"].removed().render()


@pytest.fixture(scope="module")
def brought():
    return encoded(behind=without())


def test_what_the_user_brings_is_shown_where_an_object_was(brought):
    shown = revealed(brought)
    assert psnr_8bit(without()[AROUND], shown[AROUND]) > 30
    assert psnr_8bit(without()[AROUND], revealed(encoded())[AROUND]) < 20
    more = shown[AROUND].astype(int) - without()[AROUND]
    assert more[..., 0].max() < 50  # nothing is red


def test_only_what_is_hidden_is_stored_and_nothing_else_changes(brought):
    plain, texture = encoded(), brought.layers[0].texture
    assert texture.copies is None
    assert texture.behind.size == (WIDTH, HEIGHT)
    assert texture.behind.packed["step"] == texture.planes.packed["step"]
    cells = texture.behind.support
    assert 0.2 < cells.mean() < 0.5
    assert cells[2:8, 3:9].all()
    assert not cells[:, 11:].any()
    assert texture.planes.packed == plain.layers[0].texture.planes.packed
    assert (brought.render() == plain.render()).all()
    assert brought.layers["box"].texture.behind is None


def test_a_file_keeps_it(brought):
    again = pxi.from_bytes(brought.to_bytes())
    assert (revealed(again) == revealed(brought)).all()


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v.astype(np.uint16) * 257,
        lambda v: v / 255,
        lambda v: np.dstack([v, np.full((HEIGHT, WIDTH), 255, np.uint8)]),
    ],
)
def test_other_types_of_samples_are_converted(brought, change):
    quality = psnr_8bit(revealed(brought), revealed(encoded(behind=change(without()))))
    assert quality is None or quality > 50


def test_grey_and_colour_may_lie_behind_each_other():
    grey = without()[..., 2:]
    under_colour = revealed(encoded(behind=grey))
    assert psnr_8bit(grey.repeat(3, 2)[INSIDE], under_colour[INSIDE]) > 30
    grey_picture = np.where(OBJECT, np.uint8(250), grey[..., 0])
    image = encoded(grey_picture, behind=grey)
    assert (
        image.layers[0].texture.planes.components,
        image.layers[0].texture.behind.components,
    ) == (1, 1)
    assert psnr_8bit(grey.repeat(3, 2)[AROUND], revealed(image)[AROUND]) > 30
    image = encoded(grey_picture, behind=without())
    assert psnr_8bit(without()[INSIDE], revealed(image)[INSIDE]) > 30


def test_what_lies_behind_translucent_parts_is_as_translucent():
    """The picture is faint below; the object is opaque, and hides all but the last columns."""
    alpha = np.where(Y < 40, 255, 100).astype(np.uint8)
    pixels = np.dstack([picture(), np.where(OBJECT, np.uint8(255), alpha)])
    image = encoded(pixels, masks={"back": np.ones_like(OBJECT), "box": OBJECT}, behind=without())
    texture = image.layers["back"].texture
    assert texture.behind_alpha.components == 1
    shown = revealed(image)
    assert psnr_8bit(without()[28:35, 30:70], shown[28:35, 30:70, :3]) > 28
    assert np.abs(shown[..., 3].astype(int) - alpha)[:, :20].max() < 25
    rim = shown[50:60, 77, 3]  # beside the object
    assert (abs(rim.astype(int) - 100) < 25).all()


def test_a_picture_of_one_colour_may_hide_something():
    flat = np.full((HEIGHT, WIDTH, 3), 99, np.uint8)
    image = encoded(flat, behind=without())
    assert psnr_8bit(without()[INSIDE], revealed(image)[INSIDE]) > 28


def test_what_hides_nothing_is_said(caplog):
    flags = {"masks": {"all": np.ones_like(OBJECT)}}
    image = encoded(behind=without(), **flags)
    (record,) = caplog.records
    assert "nothing hides a part of the back layer" in record.getMessage()
    assert image.to_bytes() == encoded(**flags).to_bytes()


@pytest.mark.parametrize(
    ("behind", "why"),
    [
        (without()[:-1], "behind is 109x76, the picture 109x77"),
        (np.dstack([without(), np.where(X > 3, 255, 254).astype(np.uint8)]), "not opaque"),
        (without().astype(np.int32), "behind: samples of type int32"),
        (without() * 1.0, r"behind: samples of .* do not lie in 0..1"),
        (np.full((HEIGHT, WIDTH), np.nan), "behind: .*NaN"),
        (np.zeros(5, np.uint8), r"behind: .*\(5,\)"),
    ],
)
def test_pictures_that_cannot_lie_behind(behind, why):
    with pytest.raises(InputError, match=why):
        encoded(behind=behind)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"background": "exemplar"}, "behind and background exemplar contradict"),
        ({"background": "none"}, "behind and background none contradict"),
        ({"texture": "implicit"}, "behind needs texture pyramid"),
        ({"feature_bits": 4}, "behind needs texture pyramid"),
    ],
)
def test_settings_that_contradict_it(options, why):
    with pytest.raises(UsageError, match=why):
        encoded(behind=without(), **options)


@pytest.fixture
def inpainters(monkeypatch):
    """Plug-ins, and what the one called `sea` was asked."""
    asked = []

    def sea(picture, hole):
        asked.append((picture, hole))
        return np.where(hole[..., None], np.float32([0, 0.2, 0.9]), picture)

    stand_ins = {
        "sea": sea,
        "small": lambda picture, hole: picture[1:],
        "flat": lambda picture, hole: picture[..., 0],
        "void": lambda picture, hole: picture * np.nan,
    }
    monkeypatch.setitem(plugins.BUILT_IN, "inpainters", dict.fromkeys(stand_ins, ""))
    monkeypatch.setattr(plugins, "find", lambda kind, name: stand_ins[name])
    return asked


def test_a_plugin_fills_what_is_hidden(inpainters):
    image = encoded(background="sea")
    ((seen, hole),) = inpainters
    assert seen.dtype == np.float32
    assert np.abs(seen - picture() / np.float32(255)).max() < 1e-6
    assert hole[OBJECT].all()
    assert hole.sum() == hole[AROUND].sum()
    shown = revealed(image)[INSIDE]
    assert np.abs(shown.astype(int) - [0, 51, 230]).max() < 25
    assert image.layers[0].texture.copies is None


@pytest.mark.parametrize("name", ["small", "flat", "void"])
def test_plugins_that_give_no_picture_are_told(inpainters, name):
    with pytest.raises(InputError, match=f"the picture of {name}"):
        encoded(background=name)


def test_a_model_fills_what_is_hidden_and_sees_nothing_of_it(tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.inpainting("96, 96", 255, 61))
    flat = np.where(OBJECT[..., None], np.uint8([230, 20, 20]), np.uint8([60, 90, 120]))
    shown = revealed(encoded(flat, background=str(path)))
    assert np.abs(shown.astype(int) - [60, 90, 120]).max() < 20


def test_backgrounds_that_are_not_there(tmp_path):
    with pytest.raises(
        UsageError, match="background: 'smoth' is no method; plug-ins: none; there is"
    ):
        encoded(background="smoth")
    with pytest.raises(InputError, match="cannot be read"):
        encoded(background=str(tmp_path / "missing.onnx"))
    with pytest.raises(UsageError, match="background lama needs texture pyramid"):
        pxi.Settings(background="lama", texture="implicit")
    path = onnx_models.write(tmp_path / "d.onnx", onnx_models.depth())
    with pytest.raises(InputError, match=r"relative depth.*; a background needs inpainting"):
        encoded(background=str(path))


def test_files_do_not_tell_folders():
    assert pxi.Settings(background="/home/me/lama.onnx").record() == {"background": "lama.onnx"}
