"""Masks that programs pass: all kinds of arrays, and what is refused."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.shapes.mask_arrays import regions_of
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.errors import InputError

HEIGHT, WIDTH = 17, 22
ONE, TWO = np.zeros((2, HEIGHT, WIDTH), bool)
ONE[2:9, 3:11], TWO[8:15, 9:20] = True, True
LABELS = np.where(TWO, 2, ONE.astype(int))


def regions(masks):
    return regions_of(masks, HEIGHT, WIDTH)


@pytest.mark.parametrize(
    "like",
    [
        lambda m: m,
        lambda m: m.astype(np.uint8),
        lambda m: m * np.uint8(255),
        lambda m: m * np.uint8(7),
        lambda m: m.astype(np.uint16) * 65535,
        lambda m: m.astype(np.int64),
        lambda m: m.astype(np.float32),
        lambda m: m * 255.0,
        lambda m: m.astype(np.float16) * 0.9,
        lambda m: m.tolist(),
        lambda m: np.asfortranarray(m),
    ],
)
def test_masks_of_two_values_in_any_type(like, caplog):
    for masks in ([like(ONE), like(TWO)], (like(ONE), like(TWO)), iter([like(ONE), like(TWO)])):
        found = regions(masks)
        assert [r.name for r in found] == ["object 1", "object 2"]
        for region, mask in zip(found, (ONE, TWO), strict=True):
            assert region.mask.dtype == bool
            np.testing.assert_array_equal(region.mask, mask)
    assert not caplog.records


def test_stacks_dicts_and_regions():
    for masks in (
        np.stack([ONE, TWO]),
        np.stack([ONE, TWO]) * np.uint8(255),
        {"object 1": ONE, "object 2": TWO},
        {"object 1": Region("another", ONE), "object 2": TWO},
        [Region("object 1", ONE), Region("object 2", TWO * 1.0)],
        [Region("object 1", ONE), TWO],
    ):
        found = regions(masks)
        assert [r.name for r in found] == ["object 1", "object 2"]
        assert [r.mask.tolist() for r in found] == [ONE.tolist(), TWO.tolist()]
    assert [r.name for r in regions({"fox": ONE, "den": TWO})] == ["fox", "den"]
    assert regions([]) == []


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.int32, np.int64])
def test_one_array_of_whole_numbers_has_labels(kind):
    found = regions(LABELS.astype(kind))
    assert [r.name for r in found] == ["back", "object 1", "object 2"]
    np.testing.assert_array_equal(found[1].mask, LABELS == 1)
    assert [r.name for r in regions(ONE)] == ["back", "object 1"]


def test_one_array_of_floats_is_a_mask():
    (region,) = regions(ONE.astype(np.float32))
    assert region.name == "object 1"
    np.testing.assert_array_equal(region.mask, ONE)


@pytest.mark.parametrize(
    ("top", "kind"), [(1, np.float32), (1, np.float64), (255, np.uint8), (65535, np.uint16)]
)
def test_masks_with_narrow_rims_are_cut_at_one_half_and_it_is_said(top, kind, caplog):
    ramp = ((np.arange(WIDTH) - 8.8) / 3).clip(0, 1)
    soft = (np.tile(ramp, (HEIGHT, 1)) * top).astype(kind)
    (veil, rock) = regions({"veil": soft, "rock": ONE})
    np.testing.assert_array_equal(veil.mask, soft >= (0.5 if top == 1 else (top + 1) // 2))
    np.testing.assert_array_equal(rock.mask, ONE)
    np.testing.assert_allclose(veil.alpha, np.tile(ramp, (HEIGHT, 1)), atol=0.005)
    assert rock.alpha is None
    assert [r.getMessage() for r in caplog.records] == ["soft masks are cut at one half: 'veil'"]


def soft_with(value):
    soft = np.tile(np.linspace(0, 1, WIDTH), (HEIGHT, 1))
    soft[3, 3] = value
    return soft


@pytest.mark.parametrize(
    ("masks", "why"),
    [
        ([soft_with(np.nan)], "0..1"),
        ([soft_with(1.5)], "0..1 in floats"),
        ([soft_with(-0.2)], "0..1 in floats"),
        ([soft_with(0) * 0.3], "none of which is half"),
        ([LABELS], "int64 values 0..2"),
        ([LABELS.astype(np.uint8)], "labels are given alone"),
        (LABELS.astype(float), "0..1 in floats"),
        (LABELS - 1, "there is -1"),
        ([ONE.T], "17x22, the picture 22x17"),
        (LABELS[1:], "22x16, the picture 22x17"),
        ([ONE, TWO[:, :-1]], "object 2"),
        (np.stack([ONE, TWO], 2), "shape (17, 22, 2)"),
        (np.zeros((1, 1, HEIGHT, WIDTH), bool), "shape (1, 1, 17, 22)"),
        (ONE[0], "shape (22,)"),
        ([ONE[..., None]], "shape (17, 22, 1)"),
        (ONE.tolist(), "shape (22,)"),
        ([{"segmentation": ONE}], "dict"),
        ([None], "NoneType"),
        (["mask.png"], "str"),
        ("mask.png", "str"),
        (7, "int"),
        ({1: ONE}, "the name 1"),
        ([ONE.astype(object)], "ndarray"),
        ([ONE * 1j], "ndarray"),
        ([[[0, 1], [0]]], "list"),
    ],
    ids=str,
)  # fmt: skip
def test_what_is_no_mask_is_refused(masks, why):
    with pytest.raises(InputError) as caught:
        regions(masks)
    assert why in str(caught.value)


@pytest.mark.parametrize("name", [3, None, b"fox", "", "a\nb", "x" * 201])
def test_names_are_texts(name):
    pixels = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    with pytest.raises(InputError, match="printable"):
        pxi.encode(pixels, masks=[Region(name, ONE)], effort=1)


def test_encode_takes_them_all_and_says_what_it_wants():
    pixels = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    pixels[ONE], pixels[TWO] = (200, 30, 30), (20, 60, 220)
    fast = {"effort": 1, "jobs": 1}
    whole = pxi.encode(pixels, masks=LABELS, **fast)
    assert [layer.name for layer in whole.layers] == ["back", "object 1", "object 2"]
    for masks in ([ONE & ~TWO, TWO], {"object 1": ONE & ~TWO, "object 2": TWO * 255}):
        assert pxi.encode(pixels, masks=masks, **fast).to_bytes() == whole.to_bytes()
    with pytest.raises(InputError, match=r"pass a list of arrays \[17, 22\]"):
        pxi.encode(pixels, masks=[3], **fast)
