"""Label pictures as arrays: which layer a number or colour is, and what is no label picture."""

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.labels import MAX_LABELS, label_regions
from proxyimg_codec.errors import InputError

LABELS = np.zeros((30, 41), np.uint8)
LABELS[2:13, 3:17], LABELS[9:26, 12:30], LABELS[4:21, 33:39] = 1, 2, 3


def areas(image):
    return {r.name: int(r.mask.sum()) for r in label_regions(image, "labels")}


def enlarged(image, factor):
    return image.repeat(factor, 0).repeat(factor, 1)


def reduced(image, factor):
    """The mean of each square, rounded: edges become mixed."""
    h, w = image.shape[0] // factor, image.shape[1] // factor
    blocks = image[: h * factor, : w * factor].reshape(h, factor, w, factor, -1)
    return np.rint(blocks.mean((1, 3))).astype(np.uint8)


@pytest.mark.parametrize("values", [(0, 1, 2, 3), (0, 85, 170, 255), (0, 300, 40000, 65535)])
def test_numbers_are_labels_as_they_are(values):
    image = np.array(values, np.uint16)[LABELS]
    regions = label_regions(image, "labels")
    assert [r.name for r in regions] == ["back", *(f"object {v}" for v in values[1:])]
    for region, value in zip(regions, values, strict=True):
        np.testing.assert_array_equal(region.mask, image == value)


def test_colours_are_ordered_by_packed_rgb_after_black():
    palette = np.array([[0, 0, 0], [200, 0, 0], [0, 160, 0], [0, 0, 220]], np.uint8)
    found = {r.name: r.mask for r in label_regions(palette[LABELS], "labels")}
    for name, label in (("back", 0), ("object 1", 3), ("object 2", 2), ("object 3", 1)):
        np.testing.assert_array_equal(found[name], label == LABELS)


def test_colours_without_black_have_no_back():
    palette = np.array([[255, 255, 255], [200, 0, 0], [0, 160, 0], [0, 0, 220]], np.uint8)
    with pytest.raises(InputError, match="labels: no pixel is black"):
        label_regions(palette[LABELS], "labels")


def test_greys_in_three_channels_are_numbers():
    assert areas(np.repeat(7 * LABELS[..., None], 3, 2)) == areas(7 * LABELS)


def disc(side, radius):
    y, x = np.mgrid[:side, :side] + 0.5
    return np.hypot(y - side / 2, x - side * 0.47) < radius


@pytest.mark.parametrize("top", [255, 90, 5])
@pytest.mark.parametrize("factor", [3, 5])
def test_smoothed_edges_are_refused_however_faint(top, factor):
    image = disc(53 * factor, 17 * factor) * np.uint8(top)
    with pytest.raises(InputError, match=r"labels.*smoothed"):
        label_regions(reduced(image, factor)[..., 0], "labels")


def test_smoothed_colours_are_refused():
    palette = np.array([[0, 0, 0], [250, 40, 0], [30, 160, 90], [0, 90, 220]], np.uint8)
    with pytest.raises(InputError, match="different labels"):
        label_regions(reduced(np.roll(palette[enlarged(LABELS, 4)], 2, 1), 4), "labels")


def test_smoothed_numbers_that_are_also_labels_are_refused():
    """Between 0 and 9 smoothing makes 3, which is an object elsewhere."""
    image = np.zeros((120, 120), np.uint8)
    image[disc(120, 45)] = 9
    small = reduced(image, 3)[..., 0] // 3 * 3
    small[2:8, 2:8], small[2:8, 30:36] = 3, 6
    assert set(np.unique(small)) == {0, 3, 6, 9}
    with pytest.raises(InputError, match="smoothed"):
        label_regions(small, "labels")


def test_a_palette_of_smoothed_colours_is_refused():
    """Its indices are in any order, so that none lies between its neighbours."""
    grey = reduced(disc(212, 70) * np.uint8(255), 4)[..., 0]
    few = grey // 16
    index = np.random.default_rng(3).permutation(16).astype(np.uint8)[few]
    with pytest.raises(InputError, match="nowhere 2 pixels wide"):
        label_regions(index, "labels")


def test_sharp_pictures_with_small_and_thin_objects_are_taken():
    image = LABELS.copy()
    image[27, 3:37] = 4  # a wire
    image[0, 0] = 5  # a corner
    image[22:24, 34:36] = 6
    assert areas(image)["object 4"] == 34
    wedges = np.add.outer(np.arange(60), np.arange(50)) // 9 * np.uint8(2)
    assert len(areas(wedges)) == 13


@pytest.mark.parametrize("shape", [(1, 31), (31, 1), (1, 1), (2, 2)])
def test_pictures_of_any_shape(shape):
    image = (np.arange(shape[0] * shape[1]) // 4).reshape(shape)
    assert sum(areas(image).values()) == image.size


@pytest.mark.parametrize("count", [MAX_LABELS, MAX_LABELS + 1])
def test_number_of_labels_is_limited(count):
    image = enlarged(np.arange(70).clip(0, count - 1).reshape(7, 10), 3)
    if count <= MAX_LABELS:
        assert len(areas(image)) == count
    else:
        with pytest.raises(InputError, match=f"{count} different labels"):
            areas(image)


def test_negative_labels_are_refused():
    with pytest.raises(InputError, match="there is -1"):
        label_regions(LABELS.astype(int) - 1, "labels")
