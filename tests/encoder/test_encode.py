import json

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.layers import plan_layers
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.errors import UsageError
from proxyimg_codec.geometry.coverage import FULL, coverage
from proxyimg_codec.io.psnr import psnr_8bit
from proxyimg_codec.render.quality import psnr
from tests.support.pictures import disc, smooth

FAST = {"texture": "implicit", "effort": 2, "jobs": 1}


def test_what_is_returned_is_what_is_read(photo):
    image = pxi.encode(photo, **FAST)
    data = image.to_bytes()
    again = pxi.from_bytes(data)
    assert again.to_bytes() == data
    assert (again.render() == image.render()).all()
    assert psnr(photo, image) > 31  # depends a little on which layers are found


def test_same_input_same_bytes_whatever_the_threads(photo):
    a = pxi.encode(photo, texture="implicit", effort=1, jobs=1).to_bytes()
    assert pxi.encode(photo, texture="implicit", effort=1, jobs=2).to_bytes() == a
    assert pxi.encode(photo, texture="implicit", effort=1, jobs=1, seed=1).to_bytes() != a


def test_quality_is_monotonic():
    picture = smooth(96, 96)
    picture[::3, ::5] //= 2
    files = [pxi.encode(picture, quality=q, max_layers=1, **FAST) for q in (5, 40, 75, 100)]
    sizes = [len(f.to_bytes()) for f in files]
    values = [psnr(picture, f) for f in files]
    assert sizes == sorted(sizes)
    assert values == sorted(values)
    assert values[-1] > values[0] + 3


def test_large_pictures_keep_within_what_readers_accept(photo, monkeypatch):
    def codes():
        image = pxi.encode(photo, quality=90, **FAST)
        return sum(v.texture.codes.size for v in image.layers)

    before = codes()
    monkeypatch.setattr("proxyimg_codec.encoder.encode.CODES_MAX", before // 2)
    assert before // 3 < codes() <= before // 2


def test_effort_helps(photo):
    values = [
        psnr(photo, pxi.encode(photo, texture="implicit", effort=e, jobs=1, max_layers=1))
        for e in (1, 4)
    ]
    assert values[1] > values[0] + 1


def test_masks_become_named_layers(small_masks):
    picture = smooth(64, 48)
    regions = [Region("disc", small_masks["disc"])]
    image = pxi.encode(picture, masks=regions, **FAST)
    assert [v.name for v in image.layers] == ["back", "disc"]
    alone = image.render(layers=["disc"])
    inside = small_masks["disc"]
    assert ((alone[..., 3] >= 128) == inside).mean() > 0.99
    assert np.abs(alone[inside][:, :3].astype(int) - picture[inside]).mean() < 8


def test_no_background_leaks_between_touching_layers():
    """Two halves in front of a back layer that is hidden: no seam may be seen."""
    half = np.zeros((40, 60), bool)
    half[:, :30] = True
    slanted = np.add.outer(np.arange(40), np.arange(60)) < 45
    picture = np.full((40, 60, 3), 200, np.uint8)
    picture[:6] = 10
    masks = [Region("a", slanted & ~half), Region("b", half)]
    masks = [Region(m.name, m.mask & (np.arange(40)[:, None] >= 6)) for m in masks]
    image = pxi.encode(picture, masks=masks, effort=3, jobs=1)
    for scale in (1, 3):
        out = image.render(scale=scale)
        middle = out[12 * scale : 34 * scale, 26 * scale : 34 * scale]
        assert np.abs(middle.astype(int) - 200).max() < 25


def test_hard_alpha_becomes_the_boundary(rgba_photo):
    image = pxi.encode(rgba_photo, **FAST)
    out = image.render()
    assert image.channels == 3
    assert not image.opaque
    assert np.abs(out[..., 3].astype(int) - rgba_photo[..., 3]).mean() < 6
    assert psnr(rgba_photo, image) > 27


def test_soft_alpha_is_a_texture_output():
    y, x = np.mgrid[0:48, 0:48]
    alpha = np.clip(255 - 9 * np.hypot(x - 24, y - 24), 0, 255)
    picture = np.dstack([smooth(48, 48), alpha.astype(np.uint8)])
    image = pxi.encode(picture, effort=3, jobs=1)
    assert image.channels == 4
    assert np.abs(image.render()[..., 3].astype(int) - picture[..., 3]).mean() < 4


@pytest.mark.parametrize("value", [(0, 0, 0), (255, 255, 255), (12, 200, 77)])
def test_one_colour_is_exact(value):
    picture = np.full((9, 30, 3), value, np.uint8)
    image = pxi.encode(picture, **FAST)
    assert psnr(picture, image) is None
    assert len(image.to_bytes()) < 1000


def test_a_fully_transparent_picture_stays_so():
    image = pxi.encode(np.zeros((10, 12, 4), np.uint8), **FAST)
    assert (image.render()[..., 3] == 0).all()


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 40, 3), (40, 1, 4), (3, 2), (5, 5, 1), (6, 4, 2)])
def test_any_shape(shape):
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, shape).astype(np.uint8)
    out = pxi.from_bytes(pxi.encode(picture, **FAST).to_bytes()).render()
    assert out.shape[:2] == shape[:2]
    assert out.shape[2] == (4 if len(shape) == 3 and shape[2] in (2, 4) else 3)


def test_sixteen_bits():
    picture = np.linspace(0, 65535, 40 * 30 * 3).reshape(30, 40, 3).astype(np.uint16)
    image = pxi.encode(picture, **FAST)
    assert image.depth == 16
    error = image.render(dtype=np.uint16).astype(int) - picture
    assert np.sqrt((error**2).mean()) < 0.03 * 65535


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((0, 4, 3)), np.zeros(5), np.zeros((2, 2, 5)), np.full((4, 4, 3), np.nan),
        np.full((4, 4, 3), 1.5), np.full((4, 4, 3), -0.1), np.zeros((4, 4, 3), np.int32),
    ],
)  # fmt: skip
def test_arrays_that_are_no_pictures_are_refused(pixels):
    with pytest.raises(pxi.InputError):
        pxi.encode(pixels)


@pytest.mark.parametrize(
    "options",
    [
        {"quality": -1}, {"quality": float("nan")}, {"effort": 0}, {"effort": 10}, {"effort": 1.5},
        {"feature_bits": 1}, {"net_bits": 9}, {"boundary": "x"}, {"background": "x"},
        {"jobs": 0}, {"device": "tpu"}, {"max_layers": 0}, {"seed": -1}, {"speed": 3},
    ],
)  # fmt: skip
def test_settings_out_of_range_are_refused(options, photo):
    with pytest.raises(pxi.UsageError):
        pxi.encode(photo, **options)


@pytest.mark.parametrize("block", [b"", "text", 7, None])
def test_metadata_that_is_no_bytes_is_refused(photo, block):
    with pytest.raises(UsageError, match="metadata block 'exif'"):
        pxi.encode(photo, blocks={"exif": block}, **FAST)


def test_the_file_says_how_it_was_made(photo):
    image = pxi.encode(photo, quality=33, **FAST)
    recorded = json.loads(image.info["settings"])
    assert recorded["quality"] == 33
    assert "jobs" not in recorded
    assert sum(image.info["areas"]) == pytest.approx(48 * 40, rel=0.02)


def test_completed_background_stores_all_its_codes(small_masks):
    picture = smooth(64, 48)
    masks = [Region("disc", small_masks["disc"])]
    plain = pxi.encode(picture, masks=masks, quality=80, **FAST)
    full = pxi.encode(picture, masks=masks, quality=80, background="complete", **FAST)
    assert not plain.layers[0].texture.stored.all()
    assert full.layers[0].texture.stored.all()
    visible = ~small_masks["disc"]
    a, b = (i.render(layers=["back"]) for i in (plain, full))
    assert np.abs(a[visible].astype(int) - b[visible]).mean() < 2
    hidden = disc(64, 48)
    assert np.abs(np.diff(b.astype(int), axis=1)[hidden[:, 1:]]).mean() < 12


def test_chamfer_boundaries(small_masks):
    settings = Settings(boundary="chamfer")
    picture = np.dstack([smooth(64, 48) / np.float32(255), np.ones((48, 64), np.float32)])
    plan = plan_layers(picture.astype(np.float32), settings, [Region("d", small_masks["disc"])])
    boundary = plan.layers[1].boundary
    paths = [p << (8 - boundary.unit) for p in boundary.paths]
    inside = coverage(paths, 0, 0, 64, 48) > FULL // 2
    assert (inside == small_masks["disc"]).mean() > 0.98


def test_psnr_ignores_the_colour_of_invisible_pixels():
    a = np.zeros((2, 2, 4), np.uint8)
    b = a.copy()
    b[..., :3] = 99
    assert psnr_8bit(a, b) is None
    b[0, 0, 3] = 255
    assert psnr_8bit(a, b) == pytest.approx(10 * np.log10(255**2 * 16 / (3 * 99**2 + 255**2)))


def test_too_little_memory_is_a_limit(monkeypatch):
    def fails(*_):
        raise MemoryError

    monkeypatch.setattr("proxyimg_codec.encoder.encode.plan_layers", fails)
    with pytest.raises(pxi.LimitError, match="memory to encode"):
        pxi.encode(np.zeros((5, 7, 3), np.uint8), effort=1)
