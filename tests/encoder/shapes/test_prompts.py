"""Prompts are checked against the picture and each other."""

import re

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.prompts import Prompt, checked, pixel
from proxyimg_codec.errors import InputError

H, W = 37, 53
EMPTY = np.zeros((H, W), bool)
SPOT = np.eye(H, W, dtype=bool)


def test_good_prompts_stay_and_boxes_are_clipped() -> None:
    cat = Prompt("cat", inside=((0, 0), (52.9, 36.9)), outside=((5, 5),), strokes=SPOT)
    dog = Prompt("dog", box=(-4, 10, 20, 100))
    one, two = checked([cat, dog], H, W)
    assert (one.inside, one.outside, one.box) == (cat.inside, cat.outside, None)
    assert one.strokes is SPOT
    assert two.box == (0, 10, 16, 27)


def test_points_inside_one_object_are_outside_of_those_that_are_no_part_of_it() -> None:
    cat, eye, dog = checked(
        [Prompt("cat", ((1, 1),)), Prompt("cat/eye", ((2, 2),)), Prompt("cat2", ((3, 3),))], H, W
    )
    assert cat.outside == eye.outside == ((3, 3),)
    assert dog.outside == ((1, 1), (2, 2))


def test_points_lie_in_pixels() -> None:
    assert pixel((7.99, 3)) == (3, 7)


@pytest.mark.parametrize(
    ("prompts", "message"),
    [
        ([Prompt("cat", ((53, 3),))], 'point 53,3 of "cat" lies outside the picture.*53x37'),
        ([Prompt("cat", ((3, 3),), ((3, -1),))], "point 3,-1 .* lies outside"),
        ([Prompt("cat", ((float("nan"), 3),))], "lies outside"),
        ([Prompt("cat", ((3.2, 4),), ((3, 4.9),))], "pixel 3,4 cannot be inside and outside"),
        ([Prompt("a", ((3, 4),)), Prompt("b", ((3, 4),))], 'inside both "a" and "b"'),
        ([Prompt("a", ((3, 4),)), Prompt("a", ((9, 4),))], "two prompts"),
        ([Prompt("cat", outside=((3, 4),))], 'nothing is said to be inside "cat"'),
        ([Prompt("cat", box=(60, 3, 9, 9))], "box 60,3,9,9 .* no pixel"),
        ([Prompt("cat", box=(6, 3, -9, 9))], "no pixel"),
        ([Prompt("cat", box=(6, 3, float("inf"), 9))], "no pixel"),
        ([Prompt("cat", strokes=EMPTY)], "strokes .* no pixel is inside"),
        ([Prompt("cat", mask=EMPTY[1:])], re.escape('the mask of "cat" is 53x36')),
    ],
)
def test_bad_prompts_are_refused(prompts: list[Prompt], message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked(prompts, H, W)
