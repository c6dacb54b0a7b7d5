"""Objects out of maps: what becomes a layer, what is split, joined or dropped."""

import numpy as np
import pytest

from proxyimg_codec.encoder.shapes import figures
from proxyimg_codec.encoder.shapes.figures import segment
from proxyimg_codec.encoder.shapes.maps import Maps
from proxyimg_codec.encoder.shapes.pointing_scene import scene_of

SIZE = (187, 253)


def box(top: int, left: int, bottom: int, right: int) -> np.ndarray:
    mask = np.zeros(SIZE, np.bool_)
    mask[top:bottom, left:right] = True
    return mask


def outline(mask: np.ndarray, strength: float) -> np.ndarray:
    """Lines of two pixels, one on each side of the edges of a mask."""
    edge = np.zeros(SIZE, np.bool_)
    across, down = mask[:, 1:] != mask[:, :-1], mask[1:] != mask[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return np.where(edge, strength, 0).astype(np.float32)


def maps_of(figure: np.ndarray, *edges: np.ndarray) -> Maps:
    boundary = np.maximum.reduce([np.zeros(SIZE, np.float32), *edges])
    return Maps(figure.astype(np.float32), boundary, np.zeros((*SIZE, 2), np.float32))


def objects(maps: Maps, most: int, support: np.ndarray | None = None) -> np.ndarray:
    """Labels of a picture that is grey on figures, black elsewhere."""
    rgb = (maps.figure[..., None] * (200, 200, 200)).astype(np.uint8)
    return figures.objects(scene_of(rgb, maps), most, support)


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def best(labels: np.ndarray, mask: np.ndarray) -> float:
    return max(iou(labels == k, mask) for k in np.unique(labels))


def test_figures_that_do_not_touch_are_objects():
    one, two = box(30, 20, 120, 90), box(60, 140, 170, 230)
    maps = maps_of((one | two) * 0.9, outline(one, 0.9), outline(two, 0.9))
    labels = objects(maps, 4)
    assert labels.max() == 2
    assert best(labels, one) > 0.9
    assert best(labels, two) > 0.9
    assert best(labels, ~(one | two)) > 0.9


@pytest.mark.parametrize(("strength", "parts"), [(0.9, 2), (0.2, 1)])
def test_a_figure_is_split_at_strong_boundaries_only(strength, parts):
    one, two = box(30, 20, 120, 120), box(30, 120, 120, 230)
    maps = maps_of((one | two) * 0.9, outline(one | two, 0.9), outline(two, strength))
    assert objects(maps, 4).max() == parts


def test_a_part_that_is_not_worth_a_layer_joins_its_figure():
    whole, eye = box(30, 20, 170, 230), box(80, 100, 95, 115)
    labels = objects(maps_of(whole * 0.9, outline(whole, 0.9), outline(eye, 0.95)), 4)
    assert labels.max() == 1
    assert best(labels, whole) > 0.95


def test_there_are_no_more_than_asked_and_the_largest_stay():
    boxes = [box(5 + 36 * i, 10, 35 + 36 * i, 60 + 40 * i) for i in range(5)]
    figure = np.any(boxes, axis=0) * 0.9
    for most in (1, 2, 3, 6):
        labels = objects(maps_of(figure, *(outline(b, 0.9) for b in boxes)), most)
        assert labels.max() == min(most, 6) - 1
        assert most == 1 or best(labels, boxes[4]) > 0.9


@pytest.mark.parametrize("level", [0.0, 0.1, 0.99])
def test_a_picture_without_figures_or_all_figure_is_one_layer(level):
    assert objects(maps_of(np.full(SIZE, level)), 4).max() == 0


def test_parts_of_a_support_are_all_kept():
    one, two, speck = box(30, 20, 120, 90), box(60, 140, 170, 230), box(5, 240, 12, 250)
    support = one | two | speck
    labels = objects(maps_of(support, outline(support, 1)), 4, support)
    assert labels.max() == 1
    assert iou(labels >= 0, support) > 0.9


@pytest.fixture
def flat(monkeypatch):
    """Maps without anything in them, whatever the picture is."""

    def none(rgb: np.ndarray, jobs: int = 1) -> Maps:
        plane = np.zeros(rgb.shape[:2], np.float32)
        return Maps(plane, plane, np.zeros((*plane.shape, 2), np.float32))

    monkeypatch.setattr(figures, "find_maps", none)


@pytest.mark.parametrize("shape", [(1, 1), (1, 301), (37, 2), (64, 65)])
@pytest.mark.usefixtures("flat")
def test_any_size_is_a_partition(shape):
    rgb = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    assert [r.name for r in segment(rgb)] == ["back"]
    support = np.zeros(shape, np.bool_)
    assert segment(rgb, 4, support) == []
    support[-1, -1] = True
    (only,) = segment(rgb, 4, support)
    np.testing.assert_array_equal(only.mask, support)


def test_a_large_picture_is_segmented_in_a_copy(monkeypatch):
    """Of the same objects, at the size of the picture; each pixel is in one."""
    y, x = np.mgrid[:223, :301]
    disc = (x - 150) ** 2 + (y - 110) ** 2 < 60**2
    rgb = np.where(disc[..., None], (230, 60, 40), (40, 90, 60)).astype(np.uint8)
    monkeypatch.setattr(figures, "LARGEST", 144)
    found = segment(rgb, 3)
    assert [region.mask.shape for region in found] == [(223, 301)] * 2
    assert iou(found[1].mask, disc) > 0.95
    assert (found[0].mask | found[1].mask).all()
