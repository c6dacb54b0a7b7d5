"""Depth order by ownership of edges, by depth maps and by cues."""

import numpy as np

from proxyimg_codec.encoder.shapes.external_models.depth import ordered_by_depth
from proxyimg_codec.encoder.shapes.maps import Maps
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.encoder.shapes.order import back_to_front, ownership


def disc(x: float, y: float, radius: float, height: int = 81, width: int = 117) -> np.ndarray:
    rows, cols = np.indices((height, width))
    return (rows - y) ** 2 + (cols - x) ** 2 <= radius**2


def towards(mask: np.ndarray) -> np.ndarray:
    """Vectors towards the centre of a mask, as ownership of a disc has them."""
    rows, cols = np.indices(mask.shape)
    y, x = (v.mean() for v in np.nonzero(mask))
    away = np.dstack([x - cols, y - rows]).astype(np.float32)
    return away / np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1)


def maps_with(owner: np.ndarray) -> Maps:
    plane = np.full(owner.shape[:2], 0.5, np.float32)
    return Maps(plane, plane, owner)


def test_who_owns_the_border_is_in_front():
    front, behind = disc(50, 40, 22), disc(72, 40, 25)
    behind = behind & ~front
    maps = maps_with(towards(front))
    assert ownership([front, behind], maps.owner)[0, 1] > 0.5
    assert ownership([front, behind], maps.owner)[1, 0] < -0.5
    for masks in ([front, behind], [behind, front]):
        stack = back_to_front(masks, maps)
        assert stack[0] is behind
        assert stack[1] is front
    turned = back_to_front([front, behind], maps_with(-towards(front)))
    assert turned[1] is behind


def test_masks_that_do_not_touch_own_nothing_of_each_other():
    one, two = disc(20, 40, 10), disc(90, 40, 10)
    np.testing.assert_array_equal(ownership([one, two], towards(one)), 0)


def test_lower_is_nearer_without_other_cues():
    high, low = disc(58, 20, 12), disc(58, 60, 12)
    assert back_to_front([low, high], maps_with(np.zeros((81, 117, 2), np.float32)))[1] is low


def test_depth_decides_where_there_is_one():
    front, behind = disc(50, 40, 22), disc(72, 40, 25)
    behind = behind & ~front
    depth = np.where(behind, 5.0, 1.0).astype(np.float32)
    regions = [Region("front", front), Region("behind", behind)]
    assert ordered_by_depth(regions, depth, opaque=False)[1].name == "behind"


def test_circles_of_overlaps_end():
    masks = [disc(30, 40, 9), disc(48, 40, 9), disc(39, 55, 8)]
    owner = np.random.default_rng(3).normal(0, 1, (81, 117, 2)).astype(np.float32)
    stack = back_to_front(masks, maps_with(owner))
    assert sorted(map(id, stack)) == sorted(map(id, masks))
