"""The scores of layers are right where the answer is known, and composites are what they say."""

import cv2
import numpy as np
import pytest

from benchmarks import composites as c
from benchmarks import layer_scores as s

HEIGHT, WIDTH = 61, 83


def box(left, top, width, height):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top : top + height, left : left + width] = True
    return mask


ALL = box(0, 0, WIDTH, HEIGHT)


def test_things_are_the_largest_labels_that_are_no_stuff():
    labels = np.zeros((HEIGHT, WIDTH), np.uint8)
    for label, part in ((200, box(0, 0, WIDTH, 20)), (3, box(0, 20, 20, 20)),
                        (9, box(20, 20, 30, 20)), (1, box(50, 20, 12, 12)),
                        (4, box(62, 20, 11, 11)), (5, box(0, 50, 5, 5))):  # fmt: skip
        labels[part] = label
    assert [int(m.sum()) for m in s.things(labels)] == [600, 400, 144]
    assert len(s.things(labels, None)) == 4


def test_layers_that_are_the_things_score_one_and_others_their_overlap():
    things = [box(0, 0, 30, 20), box(40, 0, 10, 20)]
    assert s.best([~(things[0] | things[1]), *things], things) == [1, 1]
    assert s.best([box(0, 0, 15, 20)], things) == [0.5, 0]
    assert s.best([], things) == [0, 0]


def test_an_interval_holds_the_mean_and_shrinks_with_more_values():
    few, many = s.interval([0, 1] * 5), s.interval([0, 1] * 500)
    assert few[0] < many[0] < 0.5 < many[1] < few[1]
    assert s.interval([0.25] * 7) == (0.25, 0.25)


def test_covering_is_one_for_the_same_regions_and_the_mean_over_people():
    halves = (np.arange(WIDTH) >= 40).astype(int) + np.zeros((HEIGHT, 1), int)
    one = np.zeros_like(halves)
    assert s.covering(7 - halves, [halves]) == 1
    # Each half is covered by the whole as far as its share of it goes.
    part = 40 / WIDTH
    expected = part**2 + (1 - part) ** 2
    assert s.covering(one, [halves]) == pytest.approx(expected)
    assert s.covering(one, [halves, one]) == pytest.approx((expected + 1) / 2)
    assert s.covering(halves, [one]) == pytest.approx(max(part, 1 - part))


def test_sprites_in_the_right_order_and_the_wrong_one():
    rear, front = box(0, 0, 20, 20), box(20, 0, 20, 20)
    good = s.sprites([~(rear | front), rear, front], [rear, front], [(0, 1)])
    assert good == ([1, 1], [True], 1)
    assert s.sprites([front, rear], [rear, front], [(0, 1)]) == ([1, 1], [False], 1)
    joined = s.sprites([rear | front], [rear, front], [(0, 1)])
    assert joined == ([0.5, 0.5], [False], 1)
    lost = s.sprites([rear, box(20, 0, 9, 20)], [rear, front], [(0, 1)])
    assert lost.ordered == []
    assert lost.pairs == 1


def test_the_deepest_point_is_inside_and_away_from_the_frame():
    assert s.deepest(ALL)[1] == HEIGHT // 2
    ring = box(10, 10, 41, 41) & ~box(20, 20, 31, 31)
    x, y = s.deepest(ring)
    assert ring[y, x]


def test_clicks_go_to_the_largest_errors():
    thing, asked = box(10, 10, 40, 30), []

    def find(inside, outside):
        asked.append((list(inside), list(outside)))
        answers = {1: box(10, 10, 20, 30), 2: box(10, 10, 60, 30), 3: thing}
        return answers[len(asked)]

    assert s.clicked(thing, find) == [0.5, pytest.approx(2 / 3), 1]
    (first, _), (second, _), (third, outside) = asked
    assert thing[first[0][1], first[0][0]]
    assert 30 <= second[1][0] < 50
    assert third == second
    assert 50 <= outside[0][0] < 70


def test_a_thing_that_is_found_needs_no_further_click():
    thing, calls = box(3, 3, 9, 9), []
    assert s.clicked(thing, lambda *points: calls.append(points) or thing) == [1, 1, 1]
    assert len(calls) == 1


def test_pairs_in_order_are_counted():
    assert s.inversions([0, 1, 2, 3]) == (6, 6)
    assert s.inversions([3, 2, 1, 0]) == (0, 6)
    assert s.inversions([0, 2, 1]) == (2, 3)


def disc(colour, size=64):
    y, x = np.indices((size, size)) - (size - 1) / 2
    rgba = np.full((size, size, 4), (*colour, 255), np.uint8)
    rgba[..., 3] *= (np.hypot(x, y) < size / 2).astype(np.uint8)
    return rgba


@pytest.mark.parametrize("overlapping", [False, True])
def test_a_composite_shows_its_sprites_where_its_masks_say(overlapping):
    photograph = np.full((211, 307, 3), 90, np.uint8)
    colours = [(250, 10, 10), (10, 250, 10), (10, 10, 250)]
    sprites = [disc(colour) for colour in colours]
    made = c.composite(photograph, sprites, np.random.default_rng(1), overlapping)
    assert len(made.masks) in (2, 3)
    assert not sum(m.astype(int) for m in made.masks).max() > 1
    assert made.pairs == ([(len(made.masks) - 2, len(made.masks) - 1)] if overlapping else [])
    for mask in made.masks:
        mean = made.rgb[mask].mean(0)
        assert min(np.abs(mean - colour).max() for colour in colours) < 12
    outside = made.rgb[~np.any(made.masks, axis=0)]
    assert np.abs(outside.mean(0) - 90).max() < 5


def test_scattered_full_and_translucent_sprites_are_left_out():
    one = disc((9, 9, 9))
    assert c.solid(np.pad(one, ((3, 5), (2, 4), (0, 0)))).shape == one.shape
    assert c.solid(np.hstack([one, 0 * one[:, :3], one])) is None
    assert c.solid(np.full((9, 9, 4), 255, np.uint8)) is None
    assert c.solid(np.zeros((9, 9, 4), np.uint8)) is None
    one[..., 3] //= 2
    one[..., 3] += one[..., 3] // 100
    assert c.solid(one) is None


def test_blur_and_noise_are_measured():
    rng = np.random.default_rng(0)
    step = np.zeros((128, 160, 3), np.uint8)
    step[:, 80:] = 200
    wide = cv2.GaussianBlur(step, (0, 0), 2.0)
    assert c.blur_of(wide) == pytest.approx(2.0, rel=0.2)
    assert c.blur_of(step) < 1
    noisy = np.clip(100 + rng.normal(0, 6, step.shape), 0, 255).astype(np.uint8)
    assert c.noise_of(noisy) == pytest.approx(6, rel=0.15)
    assert c.noise_of(step) == 0
