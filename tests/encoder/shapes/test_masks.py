"""A valid stack of layers made of masks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from proxyimg_codec.encoder.shapes.masks import (
    Region,
    description,
    groups_of,
    nearness,
    resolve,
    unique_names,
    visible,
)
from proxyimg_codec.errors import InputError


def box(top: int, left: int, bottom: int, right: int, height: int = 6, width: int = 8):
    mask = np.zeros((height, width), np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def test_wrong_sizes_are_refused_with_both_sizes():
    with pytest.raises(InputError, match=r'"cat".*9x5.*8x6'):
        resolve([Region("cat", np.ones((5, 9), np.bool_))], 6, 8)


def test_overlaps_stay_and_the_rest_goes_to_a_new_back():
    stack = resolve([Region("cat", box(0, 0, 4, 4)), Region("dog", box(2, 2, 6, 6))], 6, 8)
    assert [r.name for r in stack] == ["back", "cat", "dog"]
    np.testing.assert_array_equal(stack[2].mask, box(2, 2, 6, 6))
    np.testing.assert_array_equal(stack[1].mask, box(0, 0, 4, 4))
    np.testing.assert_array_equal(stack[0].mask, ~(box(0, 0, 4, 4) | box(2, 2, 6, 6)))
    seen = visible(stack)
    np.testing.assert_array_equal(seen[1], box(0, 0, 4, 4) & ~box(2, 2, 6, 6))
    np.testing.assert_array_equal(sum(seen), np.ones((6, 8)))


def test_the_users_back_gets_the_rest_and_goes_first():
    user = [Region("cat", box(0, 0, 4, 4)), Region("Background", box(0, 0, 1, 8))]
    stack = resolve(user, 6, 8)
    assert [r.name for r in stack] == ["Background", "cat"]
    np.testing.assert_array_equal(stack[0].mask, ~box(0, 0, 4, 4) | box(0, 0, 1, 8))


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
def test_what_is_visible_is_a_partition(masks, support):
    regions = [Region("x", m) for m in masks]
    try:
        stack = resolve(regions, 4, 5, support)
    except InputError:
        return
    seen = visible(stack)
    counts = sum((m.astype(int) for m in seen), np.zeros((4, 5), int))
    np.testing.assert_array_equal(counts, 1 if support is None else support.astype(int))
    assert all(m.any() for m in seen)
    whole = np.ones((4, 5), bool) if support is None else support
    given = [m & whole for m in masks]
    kept = [r.mask for r in stack if r.name.startswith("x")]
    np.testing.assert_array_equal(kept, given)
    assert len({r.name for r in stack}) == len(stack)


def test_names_are_numbered_without_taking_given_ones():
    assert unique_names(["cat", "cat", "dog", "cat"]) == ["cat", "cat 2", "dog", "cat 3"]
    assert unique_names(["cat", "cat", "cat 2"]) == ["cat", "cat 3", "cat 2"]


def test_parts_follow_what_their_names_say():
    names = ["cat", "cat/eye", "cat/eye/pupil", "dog/ear", "/a", "b/", "c//d", "dog/tail/tip"]
    regions = [Region(name, box(0, 0, 1, 1)) for name in names]
    above = [r.parent for r in regions]
    assert above == [None, "cat", "cat/eye", "dog", None, None, None, "dog/tail"]
    assert groups_of(regions) == {"dog": None, "dog/tail": "dog"}
    assert groups_of(regions[:3]) == {}


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
