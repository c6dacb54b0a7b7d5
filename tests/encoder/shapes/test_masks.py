"""Reading user masks and making a valid layer stack of them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from proxyimg_codec.encoder.shapes.masks import (
    MAX_LABELS,
    Region,
    description,
    load_masks,
    nearness,
    resolve,
    unique_names,
)
from proxyimg_codec.errors import InputError


def box(top: int, left: int, bottom: int, right: int, height: int = 6, width: int = 8):
    mask = np.zeros((height, width), np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def save(path: Path, image: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


def test_folder_is_read_in_natural_order_with_the_background_first(tmp_path):
    for i, name in enumerate(["object 10", "object 2", "Background"]):
        save(tmp_path / f"{name}.png", box(i, 0, i + 1, 8) * np.uint8(255))
    (tmp_path / "notes.txt").write_text("not a mask")
    regions = load_masks(tmp_path, 8, 6)
    assert [r.name for r in regions] == ["Background", "object 2", "object 10"]
    assert [int(np.flatnonzero(r.mask.any(1))[0]) for r in regions] == [2, 1, 0]


def test_what_counts_as_inside(tmp_path):
    inside = box(1, 1, 3, 4)
    grey = np.where(inside, 128, 127).astype(np.uint8)
    save(tmp_path / "a grey.png", grey)
    save(tmp_path / "b ones.png", inside.astype(np.uint8))
    save(tmp_path / "c colour.png", np.where(inside[..., None], (0, 255, 255), 20).astype(np.uint8))
    alpha = np.full((6, 8, 4), 255, np.uint8)
    alpha[..., 3] = np.where(inside, 200, 100)
    save(tmp_path / "d alpha.png", alpha)
    opaque = np.dstack([grey] * 3 + [np.full_like(grey, 255)])
    save(tmp_path / "e opaque alpha.png", opaque)
    for region in load_masks(tmp_path, 8, 6):
        np.testing.assert_array_equal(region.mask, inside, err_msg=region.name)


def test_grey_label_picture(tmp_path):
    labels = np.zeros((6, 8), np.uint8)
    labels[2:, :3], labels[:2, 5:] = 3, 1
    regions = load_masks(save(tmp_path / "labels.png", labels), 8, 6)
    assert [r.name for r in regions] == ["back", "object 1", "object 3"]
    for region, label in zip(regions, (0, 1, 3), strict=True):
        np.testing.assert_array_equal(region.mask, labels == label)


def test_colour_label_picture_is_ordered_by_packed_rgb(tmp_path):
    image = np.zeros((6, 8, 3), np.uint8)
    image[:, 2:5] = (0, 0, 255)  # red in BGR: 0xFF0000
    image[:, 5:] = (255, 0, 0)  # blue: 0x0000FF
    regions = load_masks(save(tmp_path / "labels.png", image), 8, 6)
    assert [r.name for r in regions] == ["back", "object 1", "object 2"]
    np.testing.assert_array_equal(regions[1].mask, box(0, 5, 6, 8))
    np.testing.assert_array_equal(regions[2].mask, box(0, 2, 6, 5))


def test_grey_labels_saved_as_colour_keep_their_value(tmp_path):
    image = np.zeros((6, 8, 3), np.uint8)
    image[3:] = 7
    regions = load_masks(save(tmp_path / "labels.png", image), 8, 6)
    assert [r.name for r in regions] == ["back", "object 7"]


@pytest.mark.parametrize("count", [MAX_LABELS, MAX_LABELS + 1])
def test_number_of_labels_is_limited(tmp_path, count):
    image = np.arange(70, dtype=np.uint8).clip(0, count - 1).reshape(7, 10)
    path = save(tmp_path / "labels.png", image)
    if count <= MAX_LABELS:
        assert len(load_masks(path, 10, 7)) == count
    else:
        with pytest.raises(InputError, match=f"labels.png.*{count} different labels"):
            load_masks(path, 10, 7)


def test_unusable_paths_are_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="holds no PNG"):
        load_masks(tmp_path, 8, 6)
    with pytest.raises(InputError, match=r"missing.png: cannot read"):
        load_masks(tmp_path / "missing.png", 8, 6)
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(InputError, match=r"text.png: the mask is not a valid PNG"):
        load_masks(tmp_path, 8, 6)
    (tmp_path / "text.png").write_bytes(b"\x89PNG\r\n\x1a\n broken")
    with pytest.raises(InputError, match=r"text.png: the mask is not a valid PNG"):
        load_masks(tmp_path, 8, 6)
    save(tmp_path / "text.png", np.zeros((6, 8), np.uint16))
    with pytest.raises(InputError, match="16 bits"):
        load_masks(tmp_path, 8, 6)


def test_wrong_sizes_are_refused_with_both_sizes(tmp_path):
    save(tmp_path / "cat.png", np.zeros((5, 9), np.uint8))
    with pytest.raises(InputError, match=r"cat.png.*9x5.*8x6"):
        load_masks(tmp_path, 8, 6)
    with pytest.raises(InputError, match=r'"cat".*9x5.*8x6'):
        resolve([Region("cat", np.ones((5, 9), np.bool_))], 6, 8)


def test_overlaps_go_to_the_front_and_the_rest_to_a_new_back():
    stack = resolve([Region("cat", box(0, 0, 4, 4)), Region("dog", box(2, 2, 6, 6))], 6, 8)
    assert [r.name for r in stack] == ["back", "cat", "dog"]
    np.testing.assert_array_equal(stack[2].mask, box(2, 2, 6, 6))
    np.testing.assert_array_equal(stack[1].mask, box(0, 0, 4, 4) & ~box(2, 2, 6, 6))


def test_the_users_back_gets_the_rest_and_goes_first():
    user = [Region("cat", box(0, 0, 4, 4)), Region("Background", box(0, 0, 1, 8))]
    stack = resolve(user, 6, 8)
    assert [r.name for r in stack] == ["Background", "cat"]
    np.testing.assert_array_equal(stack[0].mask, ~box(0, 0, 4, 4))


def test_full_cover_needs_no_back():
    left = box(0, 0, 6, 3)
    stack = resolve([Region("left", left), Region("right", ~left)], 6, 8)
    assert [r.name for r in stack] == ["left", "right"]


def test_support_cuts_masks_and_keeps_its_own_rest():
    support = box(1, 1, 5, 7)
    stack = resolve([Region("cat", box(0, 0, 3, 8))], 6, 8, support)
    assert [r.name for r in stack] == ["rest", "cat"]
    np.testing.assert_array_equal(stack[1].mask, box(1, 1, 3, 7))
    np.testing.assert_array_equal(stack[0].mask, box(3, 1, 5, 7))
    assert [r.name for r in resolve([Region("cat", support)], 6, 8, support)] == ["cat"]
    assert resolve([], 6, 8, np.zeros((6, 8), np.bool_)) == []


@pytest.mark.parametrize(
    ("front", "support"),
    [(box(0, 0, 6, 8), None), (box(5, 0, 6, 1), box(3, 0, 6, 8))],
)
def test_masks_that_nobody_can_see_are_refused(front, support):
    hidden = [Region("mouse", box(0, 0, 1, 1)), Region("cat", front)]
    with pytest.raises(InputError, match='"mouse" is empty'):
        resolve(hidden, 6, 8, support)


def test_inputs_stay_as_they_were():
    support, mask = box(0, 0, 6, 6), box(0, 0, 3, 3)
    resolve([Region("a", mask)], 6, 8, support)
    np.testing.assert_array_equal(support, box(0, 0, 6, 6))
    np.testing.assert_array_equal(mask, box(0, 0, 3, 3))


@given(
    masks=st.lists(hnp.arrays(np.bool_, (4, 5)), max_size=4),
    support=st.none() | hnp.arrays(np.bool_, (4, 5)),
)
def test_a_stack_is_a_partition(masks, support):
    regions = [Region("x", m) for m in masks]
    try:
        stack = resolve(regions, 4, 5, support)
    except InputError:
        return
    counts = sum((r.mask.astype(int) for r in stack), np.zeros((4, 5), int))
    np.testing.assert_array_equal(counts, 1 if support is None else support.astype(int))
    assert all(r.mask.any() for r in stack)
    assert len({r.name for r in stack}) == len(stack)


def test_numbers_that_order_files_are_no_part_of_names(tmp_path):
    for name in ("2 cat", "10_dog", "1-sky", "7", "3 "):
        save(tmp_path / f"{name}.png", box(0, 0, 4, 8) * np.uint8(255))
    names = [r.name for r in load_masks(tmp_path, 8, 6)]
    assert names == ["sky", "cat", "3 ", "7", "dog"]


def test_names_are_numbered_without_taking_given_ones():
    assert unique_names(["cat", "cat", "dog", "cat"]) == ["cat", "cat 2", "dog", "cat 3"]
    assert unique_names(["cat", "cat", "cat 2"]) == ["cat", "cat 3", "cat 2"]


@pytest.mark.parametrize(
    ("rgb", "mask", "name"),
    [
        ((220, 30, 30), box(2, 3, 4, 5), "red center"),
        ((40, 160, 40), box(5, 0, 6, 8), "green bottom"),
        ((10, 10, 12), box(2, 0, 4, 1), "black left"),
        ((250, 250, 250), box(0, 7, 1, 8), "white top right"),
        ((60, 110, 220), box(0, 0, 1, 8), "blue top"),
        ((110, 70, 30), box(5, 0, 6, 1), "brown bottom left"),
    ],
)
def test_description(rgb, mask, name):
    picture = np.full((6, 8, 3), 128, np.uint8)
    picture[mask] = rgb
    assert description(picture, mask) == name


def test_nearness():
    whole, sky, ground, disc = box(0, 0, 6, 8), box(0, 0, 3, 8), box(3, 0, 6, 8), box(2, 3, 5, 6)
    assert nearness(whole & ~disc, 0) < nearness(disc, 0)
    assert nearness(sky, 0) < nearness(ground, 0)
    assert nearness(ground, 0) < nearness(ground, 0.5)
    assert nearness(box(1, 3, 2, 4), 0) < nearness(box(4, 3, 5, 4), 0)
    assert nearness(box(1, 1, 5, 7) & ~disc, 0) < nearness(disc, 0)
