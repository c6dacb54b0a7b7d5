"""What goes on beneath what stands in front of it."""

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.amodal import extended_beneath

SIZE = (83, 121)


def box(top: int, left: int, bottom: int, right: int) -> np.ndarray:
    mask = np.zeros(SIZE, np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def scene(*fronts: np.ndarray) -> list[np.ndarray]:
    """Disjoint masks, of which later ones hide earlier ones."""
    hidden, out = np.zeros(SIZE, np.bool_), []
    for mask in reversed(fronts):
        out.insert(0, mask & ~hidden)
        hidden |= mask
    return out


ALL, TABLE, CUP = box(0, 0, 83, 121), box(30, 0, 83, 121), box(20, 40, 60, 80)


def test_a_table_goes_on_beneath_a_cup_and_the_wall_does_where_it_is_nearer():
    masks = scene(ALL, TABLE, CUP)
    back, table, cup = extended_beneath(masks, [0.1, 0.3, 0.9])
    assert np.array_equal(back, masks[0])
    assert np.array_equal(cup, masks[2])
    assert (table & ~masks[2] == masks[1]).all(), "visible parts stay what they are"
    hidden = table & CUP
    assert hidden[32:60, 40:80].mean() > 0.9
    assert not hidden[20:24, 50:70].any(), "the wall is nearer"


@pytest.mark.parametrize(("score", "more"), [(0.9, False), (0.8, False), (0.74, True)])
def test_only_what_stands_out_less_goes_on(score, more):
    masks = scene(ALL, TABLE, CUP)
    assert bool((extended_beneath(masks, [0.1, score, 0.9])[1] & CUP).any()) is more


def test_a_short_contact_does_not_reach_far():
    ball = box(42, 34, 48, 40)
    masks = scene(ALL, ball, CUP)
    found = extended_beneath(masks, [0.1, 0.2, 0.9])[1] & CUP
    assert found[44, 40], "it touches"
    assert not found[:, 46:].any(), "10 pixels touch in all"


def test_what_does_not_touch_does_not_go_on():
    masks = scene(ALL, box(5, 100, 30, 118), CUP)
    for old, new in zip(masks, extended_beneath(masks, [0.1, 0.2, 0.9]), strict=True):
        assert np.array_equal(old, new)


def test_nothing_goes_on_beneath_what_is_behind_it():
    masks = scene(ALL, CUP, box(55, 0, 83, 121))
    _, cup, floor = extended_beneath(masks, [0.1, 0.9, 0.2])
    assert np.array_equal(cup, masks[1])
    assert np.array_equal(floor, masks[2])
