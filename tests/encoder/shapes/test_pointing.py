"""Objects found where somebody points, in maps that are known."""

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.pointing import point_at
from proxyimg_codec.encoder.shapes.pointing_scene import scene_of
from proxyimg_codec.encoder.shapes.prompts import Prompt, checked
from tests.support.maps import HOUSE, TREE, WINDOW, house, plain

pytestmark = pytest.mark.usefixtures("plain_maps")


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def found(*prompts, picture=None):
    picture = house() if picture is None else picture
    regions = point_at(picture, checked(prompts, *picture.shape[:2]))
    assert [r.name for r in regions] == [p.name for p in prompts]
    return [r.mask for r in regions]


def test_one_click_gives_the_object_there():
    assert iou(found(Prompt("tree", ((100, 50),)))[0], TREE) > 0.95
    assert iou(found(Prompt("window", ((40, 52),)))[0], WINDOW) > 0.85


def test_points_of_one_name_make_one_object():
    (both,) = found(Prompt("both", ((22, 80), (100, 50))))
    assert iou(both, (HOUSE & ~WINDOW) | TREE) > 0.9


def test_a_point_outside_takes_away_what_is_like_it():
    whole = Prompt("house", ((22, 80), (40, 52)))
    assert found(whole)[0][52, 40]
    (without,) = found(Prompt("house", ((22, 80),), ((40, 52),)))
    assert not without[50:57, 34:45].any()
    assert iou(without, HOUSE & ~WINDOW) > 0.85


def test_a_box_bounds_its_object():
    (mask,) = found(Prompt("tree", box=(80, 15, 42, 80)))
    assert iou(mask, TREE) > 0.95
    (half,) = found(Prompt("tree", ((100, 30),), box=(80, 15, 42, 40)))
    assert not half[70:].any()


def test_an_object_of_several_parts_fills_its_box():
    (mask,) = found(Prompt("house", box=(12, 32, 56, 58)))
    assert iou(mask, HOUSE) > 0.9


def test_strokes_are_inside():
    strokes = np.zeros(TREE.shape, bool)
    strokes[30:80, 100] = True
    assert iou(found(Prompt("tree", strokes=strokes))[0], TREE) > 0.95


def test_a_mask_is_drawn_to_the_edges_of_the_picture():
    rough = np.roll(TREE, (3, -3), (0, 1))
    (mask,) = found(Prompt("tree", mask=rough))
    assert iou(mask, TREE) > max(0.93, iou(rough, TREE))


def test_a_mask_of_one_pixel_is_like_a_point():
    dot = np.zeros(TREE.shape, bool)
    dot[50, 100] = True
    assert found(Prompt("tree", mask=dot))[0][50, 100]


def test_objects_share_nothing_unless_one_is_a_part_of_the_other():
    a, b = found(Prompt("left", ((20, 80),)), Prompt("right", ((60, 80),)))
    assert not (a & b).any()
    assert a[80, 20]
    assert b[80, 60]
    whole, part = found(Prompt("house", ((20, 80), (40, 52))), Prompt("house/window", ((41, 50),)))
    assert iou(part, WINDOW) > 0.85
    assert (whole & part).sum() > 0.9 * part.sum()


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (7, 2), (5, 5)])
def test_tiny_and_plain_pictures_have_an_object_where_somebody_points(size):
    picture = np.full((*size, 3), 90, np.uint8)
    (mask,) = found(Prompt("dot", ((size[1] - 1, 0),)), picture=picture)
    assert mask[0, size[1] - 1]


def test_the_same_comes_out_again():
    prompts = (Prompt("tree", ((100, 50),)), Prompt("house", ((22, 80),)))
    for one, two in zip(found(*prompts), found(*prompts), strict=True):
        assert (one == two).all()


def test_large_pictures_are_sought_in_a_copy_and_drawn_at_their_size():
    large = np.kron(house(), np.ones((7, 7, 1), np.uint8))
    (mask,) = found(Prompt("tree", ((700, 350),)), picture=large)
    assert iou(mask, np.kron(TREE, np.ones((7, 7), bool))) > 0.95


def test_basins_lie_within_what_boundaries_part():
    scene = scene_of(house(), plain(house()))
    assert scene.labels.shape == (97, 131)
    assert scene.area.sum() == 97 * 131
    crossing = set(scene.labels[TREE].tolist()) & set(scene.labels[HOUSE].tolist())
    assert not crossing
    assert scene.likeness(50, 100)[scene.labels[60, 100]] > 0.5
    assert scene.likeness(50, 100)[scene.labels[80, 20]] < 0.5
