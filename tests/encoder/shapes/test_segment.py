"""The built-in decomposition: partition, order, limits, and plain pictures done right."""

import cv2
import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.segment import segment


def disc(height: int, width: int, y: float, x: float, radius: float) -> np.ndarray:
    rows, cols = np.indices((height, width))
    return (rows - y) ** 2 + (cols - x) ** 2 <= radius**2


def noisy(rgb: np.ndarray, sigma: float) -> np.ndarray:
    noise = np.random.default_rng(1).normal(0, sigma, rgb.shape)
    return np.clip(rgb + noise, 0, 255).astype(np.uint8)


def painted(height: int, width: int, *parts: tuple[np.ndarray, tuple[int, int, int]]) -> np.ndarray:
    rgb = np.full((height, width, 3), (60, 90, 160), np.uint8)
    for mask, colour in parts:
        rgb[mask] = colour
    return rgb


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def assert_partition(regions, support):
    counts = sum(r.mask.astype(int) for r in regions)
    np.testing.assert_array_equal(counts, support.astype(int))
    assert all(r.mask.any() and r.mask.dtype == np.bool_ for r in regions)
    assert len({r.name for r in regions}) == len(regions)


@pytest.mark.parametrize(("height", "width"), [(300, 420), (90, 120), (1100, 900)])
def test_a_disc_is_found(height, width):
    mask = disc(height, width, height * 0.55, width * 0.5, height * 0.25)
    regions = segment(noisy(painted(height, width, (mask, (210, 60, 40))), 8))
    assert [r.name for r in regions] == ["back", "red center"]
    assert iou(regions[1].mask, mask) > 0.97
    assert_partition(regions, np.ones((height, width)))


def test_three_discs_on_a_sky_are_ordered_and_named():
    a, b, c = (disc(256, 384, 130, x, 40) for x in (60, 190, 320))
    rgb = painted(256, 384, (a, (230, 210, 30)), (b, (200, 30, 30)), (c, (30, 150, 50)))
    regions = segment(rgb)
    assert regions[0].name == "back"
    found = {r.name: r.mask for r in regions}
    for name, mask in (("yellow left", a), ("red center", b), ("green right", c)):
        assert iou(found[name], mask) > 0.97


def test_nested_and_lower_regions_are_nearer():
    ground = np.indices((240, 320))[0] >= 150
    outer, inner = disc(240, 320, 120, 160, 70), disc(240, 320, 120, 160, 30)
    rgb = painted(
        240, 320, (ground, (60, 110, 40)), (outer, (240, 235, 220)), (inner, (180, 20, 20))
    )
    masks = [r.mask for r in segment(rgb)]
    truth = [~ground & ~outer, ground & ~outer, outer & ~inner, inner]
    assert len(masks) == 4
    assert all(iou(m, t) > 0.95 for m, t in zip(masks, truth, strict=True))


@pytest.mark.parametrize("max_layers", [1, 2, 3, 6])
def test_max_layers_is_obeyed_and_used(max_layers):
    rgb = np.zeros((160, 240, 3), np.uint8)
    colours = [
        (250, 250, 250),
        (200, 30, 30),
        (30, 160, 40),
        (40, 60, 200),
        (240, 220, 40),
        (0, 0, 0),
    ]
    for i, colour in enumerate(colours):
        rgb[80 * (i // 3) : 80 * (i // 3) + 80, 80 * (i % 3) : 80 * (i % 3) + 80] = colour
    regions = segment(rgb, max_layers)
    assert len(regions) == max_layers
    assert_partition(regions, np.ones((160, 240)))


def test_uniform_pictures_are_one_region():
    flat = np.full((200, 300, 3), (90, 120, 60), np.uint8)
    ramp = np.broadcast_to(np.linspace(100, 120, 300)[:, None], (200, 300, 3)).astype(np.uint8)
    for rgb in (flat, noisy(flat, 6), ramp):
        regions = segment(rgb)
        assert [r.name for r in regions] == ["back"]
        assert regions[0].mask.all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 30000), (30000, 2), (5, 7)])
def test_tiny_and_thin_pictures_are_one_region(shape):
    rgb = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    regions = segment(rgb)
    assert [r.name for r in regions] == ["back"]
    assert regions[0].mask.shape == shape
    assert regions[0].mask.all()


@pytest.mark.parametrize("shape", [(12, 12), (13, 300), (16, 16), (31, 33)])
def test_small_noise_is_still_a_partition(shape):
    rgb = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    regions = segment(rgb)
    assert 1 <= len(regions) <= 4
    assert_partition(regions, np.ones(shape))


def test_deterministic():
    rgb = noisy(painted(200, 260, (disc(200, 260, 90, 130, 50), (200, 190, 60))), 25)
    first, second = segment(rgb), segment(rgb.copy())
    assert [r.name for r in first] == [r.name for r in second]
    assert all((a.mask == b.mask).all() for a, b in zip(first, second, strict=True))


def test_specks_are_absorbed():
    mask, speck = disc(240, 320, 120, 160, 60), np.zeros((240, 320), np.bool_)
    speck[20:40, 30:50] = True
    regions = segment(painted(240, 320, (mask, (210, 60, 40)), (speck, (250, 250, 250))))
    assert len(regions) == 2
    assert iou(regions[1].mask, mask) > 0.97


def test_borders_are_smooth_amid_noise():
    mask = disc(240, 320, 120, 160, 60)
    found = segment(noisy(painted(240, 320, (mask, (200, 60, 50))), 20))[1].mask
    assert iou(found, mask) > 0.97
    steps = (found[1:] != found[:-1]).sum() + (found[:, 1:] != found[:, :-1]).sum()
    # A digital circle has 8 r steps along its border.
    assert steps < 8 * 60 * 1.1


def test_support_alone_is_segmented():
    support, right = disc(200, 200, 100, 100, 80), np.indices((200, 200))[1] >= 110
    rgb = painted(200, 200, (right, (220, 40, 40)))
    hidden = np.random.default_rng(3).integers(0, 256, rgb.shape, np.uint8)
    rgb = np.where(support[..., None], rgb, hidden)
    regions = segment(rgb, support=support)
    assert_partition(regions, support)
    assert len(regions) == 2
    assert "back" not in {r.name for r in regions}
    found = {r.name.split()[0]: r.mask for r in regions}
    assert iou(found["red"], support & right) > 0.96


def test_colours_outside_the_support_do_not_matter():
    support = disc(700, 700, 350, 350, 260)
    rgb = painted(700, 700, (disc(700, 700, 300, 350, 120), (240, 220, 40)))
    first = segment(rgb, support=support)
    second = segment(np.where(support[..., None], rgb, np.uint8(255)), support=support)
    assert len(first) == 2
    assert all((a.mask == b.mask).all() for a, b in zip(first, second, strict=True))


def test_details_of_the_support_join_the_nearest_region():
    support, right = np.zeros((400, 1000), np.bool_), np.indices((400, 1000))[1] >= 500
    support[100:300, 300:700] = support[200, 20:980] = True
    regions = segment(painted(400, 1000, (right, (220, 40, 40))), support=support)
    assert len(regions) == 2
    for region in regions:
        side = right if region.name.startswith("red") else ~right
        assert region.mask[200, side[200] & support[200]].mean() > 0.98


def test_thin_and_empty_supports():
    rgb = np.full((400, 1000, 3), 80, np.uint8)
    line = np.zeros((400, 1000), np.bool_)
    assert segment(rgb, support=line) == []
    line[200] = True
    assert_partition(segment(rgb, support=line), line)
    line[50:60, 20:800] = True
    assert_partition(segment(rgb, support=line), line)


@pytest.mark.parametrize(("name", "least"), [("kodim02", 0.85), ("kodim15", 0.9), ("kodim12", 0.7)])
def test_objects_in_photographs(data_dir, name, least):
    bgr = cv2.imread(str(data_dir / "kodak" / f"{name}.png"))
    truth = cv2.imread(str(data_dir / "kodak_masks" / f"{name}.png"), cv2.IMREAD_UNCHANGED) > 0
    regions = segment(np.ascontiguousarray(bgr[..., ::-1]))
    assert_partition(regions, np.ones(truth.shape))
    inside = [r.mask for r in regions if (r.mask & truth).sum() * 2 > r.mask.sum()]
    assert iou(np.any(inside, axis=0), truth) > least
