"""Tests of crack tracing and of both boundary fits."""

import itertools
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.encoder.shapes.chamfer import fit_paths_chamfer
from proxyimg_codec.encoder.shapes.contours import fit_paths, trace
from proxyimg_codec.encoder.shapes.paths import faults, flatten

Y, X = np.mgrid[:96, :128]


def area(loop):
    x, y = np.asarray(loop, float).T
    return (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2


def polygon(path, step=0.25, n=16):
    """Sample a path by the Bernstein formula, independently of the code under test."""
    quads = np.asarray(path, float).reshape(-1, 3, 2) * step
    p, a, b, q = quads[:, 0], quads[:, 1], quads[:, 2], np.roll(quads[:, 0], -1, 0)
    t = (np.arange(n) / n)[:, None, None]
    points = p * (1 - t) ** 3 + 3 * a * t * (1 - t) ** 2 + 3 * b * t * t * (1 - t) + q * t**3
    return points.swapaxes(0, 1).reshape(-1, 2)


def fill(loops, shape):
    """Nonzero fill, judged at the centres of the pixels."""
    a = np.concatenate([np.zeros((0, 2)), *loops])
    b = np.concatenate([np.zeros((0, 2)), *(np.roll(p, -1, 0) for p in loops)])
    winding = np.zeros((shape[0], shape[1] + 1), int)
    for row in range(shape[0]):
        y = row + 0.5
        cut = (a[:, 1] < y) != (b[:, 1] < y)
        (x0, y0), (x1, y1) = a[cut].T, b[cut].T
        x = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        columns = np.clip(np.ceil(x - 0.5).astype(int), 0, shape[1])
        np.add.at(winding[row], columns, np.where(y1 < y0, 1, -1))
    return np.cumsum(winding, 1)[:, :-1] != 0


def iou(mask, paths):
    drawn = fill([polygon(p) for p in paths], mask.shape)
    return (drawn & mask).sum() / (drawn | mask).sum()


def crossings(paths):
    """Proper crossings between any two edges, by brute force."""
    a = np.concatenate([polygon(p) for p in paths])
    b = np.concatenate([np.roll(polygon(p), -1, 0) for p in paths])
    d, count = b - a, 0
    for i in range(len(a)):
        to_a, to_b = a - a[i], b - a[i]
        side = (d[i, 0] * to_a[:, 1] - d[i, 1] * to_a[:, 0]) * (
            d[i, 0] * to_b[:, 1] - d[i, 1] * to_b[:, 0]
        )
        back, front = -to_a, b[i] - a
        other = (d[:, 0] * back[:, 1] - d[:, 1] * back[:, 0]) * (
            d[:, 0] * front[:, 1] - d[:, 1] * front[:, 0]
        )
        count += int(((side < 0) & (other < 0)).sum())
    return count


def check(mask, paths):
    """What holds for every result: type, canvas, orientation, no crossing, loop for loop."""
    loops = trace(mask)
    assert len(paths) == len(loops)
    for path, loop in zip(paths, loops, strict=True):
        assert path.dtype == np.int64
        assert path.shape[0] % 3 == 0
        assert path.shape[0] >= 6
        assert area(polygon(path)) * area(loop) > 0
        assert (path >= 0).all()
        assert (path * 0.25 <= mask.shape[::-1]).all()
    assert crossings(paths) == 0


def blob(seed, sigma, shape=(40, 56)):
    """Blurred noise above its median."""
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal(shape))
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])
    smooth = np.fft.irfft2(noise * np.exp(-((fx**2 + fy**2) * (2 * np.pi * sigma) ** 2) / 2), shape)
    return smooth > np.median(smooth)


RING = np.abs(np.hypot(X - 60, Y - 48) - 30) < 9
STAR = np.hypot(X - 64, Y - 48) < 28 + 14 * np.cos(5 * np.arctan2(Y - 48, X - 64))


@given(st.integers(0, 10**6), st.sampled_from([0.4, 1.0, 3.0]), st.integers(1, 40))
@settings(max_examples=30, deadline=None)
def test_traced_cracks_fill_to_the_mask(seed, sigma, width):
    mask = blob(seed, sigma, (24, 40))[:, :width]
    loops = trace(mask, 0.0)
    assert (fill(loops, mask.shape) == mask).all()
    assert sum(map(area, loops)) == mask.sum()
    for loop in loops:
        legs = np.roll(loop, -1, 0) - loop
        assert ((legs == 0).sum(1) == 1).all()  # axis-aligned, nothing repeated
        assert ((legs * np.roll(legs, -1, 0)).sum(1) == 0).all()  # a turn at every point


def test_trace_orients_and_drops():
    outer, hole = sorted(trace(RING), key=area, reverse=True)
    assert area(outer) > 0 > area(hole)
    assert area(outer) + area(hole) == RING.sum()
    mask = np.zeros((9, 9), bool)
    mask[1, 1] = mask[3:5, 3:5] = True
    assert len(trace(mask)) == 1
    assert len(trace(mask, 1.0)) == 2


@pytest.mark.parametrize(
    ("mask", "most"),
    [(np.hypot(X - 60, Y - 48) < 40, 6), (RING, 10), (STAR, 16)],
    ids=["disc", "ring", "star"],
)
def test_shapes_take_few_segments(mask, most):
    paths = fit_paths(mask)
    check(mask, paths)
    assert iou(mask, paths) > 0.985
    assert sum(len(p) // 3 for p in paths) <= most


@given(st.integers(0, 10**6), st.sampled_from([0.8, 2.0, 5.0]), st.sampled_from([0.3, 0.6, 1.5]))
@settings(max_examples=12, deadline=None)
def test_blobs_keep_within_the_tolerance(seed, sigma, tolerance):
    mask = blob(seed, sigma)
    paths = fit_paths(mask, tolerance)
    check(mask, paths)
    for path, loop in zip(paths, trace(mask), strict=True):
        curve = polygon(path, n=64)
        legs = np.roll(loop, -1, 0) - loop
        for start, leg in zip(loop, legs, strict=True):
            middles = start + np.sign(leg) * (np.arange(np.abs(leg).sum()) + 0.5)[:, None]
            apart = np.hypot(*(middles[:, None] - curve).T).min(0)
            assert apart.max() < tolerance + 0.5
    if sigma == 5.0 and tolerance == 0.6:
        assert iou(mask, paths) > 0.95


@pytest.mark.parametrize("tolerance", [1e-3, 6.0])
@pytest.mark.parametrize("step", [0.125, 0.5])
def test_hopeless_tolerances_are_repaired(tolerance, step):
    mask = blob(5, 0.7, (16, 20))
    paths = fit_paths(mask, tolerance, step)
    positive = np.array([area(p) > 0 for p in trace(mask)])
    assert not np.concatenate(faults(paths, positive)).any()
    check(mask, fit_paths(mask, tolerance))


def test_smaller_tolerance_is_closer_and_longer():
    mask = blob(3, 6.0, (160, 200))
    loose, tight = fit_paths(mask, 1.2), fit_paths(mask, 0.4)
    assert iou(mask, loose) < iou(mask, tight)
    assert sum(map(len, loose)) < sum(map(len, tight))


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 5), st.integers(0, 5))
@settings(max_examples=40, deadline=None)
def test_rectangles_are_exact(height, width, top, left):
    mask = np.zeros((18, 20), bool)
    mask[top : top + height, left : left + width] = True
    (path,) = fit_paths(mask)
    x0, y0, x1, y1 = left * 4, top * 4, (left + width) * 4, (top + height) * 4
    assert {tuple(p) for p in path[::3]} == {(x0, y0), (x1, y0), (x1, y1), (x0, y1)}
    assert len(path) == 12
    assert area(polygon(path)) == pytest.approx(height * width)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (40, 60), (30000, 2)])
def test_full_canvas_is_its_rectangle(shape):
    (path,) = fit_paths(np.ones(shape, bool))
    width, height = shape[1] * 4, shape[0] * 4
    corners = {(0, 0), (width, 0), (width, height), (0, height)}
    assert {tuple(p) for p in path[::3]} == corners
    assert area(path[::3]) == 16 * shape[0] * shape[1]
    assert (path[:, 0] % width == 0)[:4].sum() + (path[:, 1] % height == 0)[:4].sum() >= 4


def test_canvas_border_is_kept():
    mask = (np.hypot(X - 20, Y - 90) < 50) & (Y < 96)  # cut by the left and the bottom border
    (path,) = fit_paths(mask)
    check(mask, [path])
    joints = {tuple(p) for p in path[::3]}
    left, right = np.flatnonzero(mask[-1])[[0, -1]]
    top = np.flatnonzero(mask[:, 0])[0]
    assert {(0, 96 * 4), ((right + 1) * 4, 96 * 4), (0, top * 4)} <= joints
    assert left == 0
    back = fit_paths(~mask)
    assert {(0, 0), (128 * 4, 0), (128 * 4, 96 * 4)} <= {tuple(p) for p in back[0][::3]}


def test_nothing_and_next_to_nothing():
    assert fit_paths(np.zeros((5, 7), bool)) == []
    assert fit_paths_chamfer(np.zeros((5, 7), bool)) == []
    dot = np.zeros((5, 7), bool)
    dot[2, 3] = True
    (path,) = fit_paths(dot)  # kept although it is smaller than min_area
    assert iou(dot, [path]) == 1


def test_touching_corners_stay_apart():
    mask = np.zeros((30, 30), bool)
    mask[3:12, 3:12] = mask[12:20, 12:22] = True
    paths = fit_paths(mask)
    check(mask, paths)
    assert len(paths) == 2
    assert not np.concatenate(faults(paths, np.array([True, True]))).any()
    assert iou(mask, paths) > 0.98


@pytest.mark.parametrize("cell", [1, 2, 8])
def test_checkerboards_end_soon(cell):
    mask = (np.indices((128, 128)) // cell).sum(0) % 2 == 0
    began = time.process_time()
    paths = fit_paths(mask)
    assert time.process_time() - began < 5
    assert len(paths) == (1 if cell == 1 else (128 // cell) ** 2 // 2)
    assert cell == 1 or iou(mask, paths) > 0.99


def test_eighty_holes():
    mask = np.ones((200, 210), bool)
    for i, j in itertools.product(range(8), range(10)):
        mask[5 + 24 * i : 9 + 25 * i, 5 + 20 * j : 8 + 21 * j] = False
    paths = fit_paths(mask)
    check(mask, paths)
    assert len(paths) == 81
    assert iou(mask, paths) > 0.999


def test_faults_finds_what_is_wrong():
    square = np.array([[0, 0], [10, 0], [20, 0], [30, 0], [30, 10], [30, 20],
                       [30, 30], [20, 30], [10, 30], [0, 30], [0, 20], [0, 10]])  # fmt: skip
    yes, two = np.array([True]), np.array([True, True])
    assert not faults([square], yes)[0].any()
    assert faults([square], ~yes)[0].all()
    assert faults([square[[0, 1, 2, 9, 10, 11, 3, 4, 5, 6, 7, 8]]], yes)[0].any()  # a bow tie
    assert not np.concatenate(faults([square, square + 40], two)).any()
    first, second = faults([square, square + 15], two)
    assert first.tolist() == [False, True, True, False]
    assert second.tolist() == [True, False, False, True]
    assert faults([square, square + np.array([30, 0])], two)[0].any()  # touching counts
    loop = np.array([[0, 0], [60, 40], [-30, 40], [30, 0], [20, -20], [10, -20]])
    assert faults([loop], yes)[0][0]  # crosses itself within one segment
    spike = np.array([[0, 0], [0, 0], [40, 0], [40, 0], [40, 0], [20, 0],
                      [20, 0], [20, 0], [0, 30], [0, 30], [0, 30], [0, 0]])  # fmt: skip
    assert faults([spike], yes)[0].any()


def test_five_thousand_segments_are_checked_within_a_second():
    mask = (np.indices((100, 100)) // 2).sum(0) % 2 == 0
    paths = fit_paths(mask)
    assert sum(len(p) // 3 for p in paths) > 2500
    began = time.process_time()
    faults(paths * 2, np.ones(2 * len(paths), bool))
    assert time.process_time() - began < 1


def test_flatten_is_exact():
    control = np.random.default_rng(0).integers(-999, 999, (5, 4, 2))
    points = flatten(control)
    assert (points[:, 0] == 4096 * control[:, 0]).all()
    assert (points[:, 16] == 4096 * control[:, 3]).all()
    assert (points[:, 8] == 512 * (control * [[1], [3], [3], [1]]).sum(1)).all()


def test_results_repeat_and_step_scales():
    first, second = fit_paths(STAR), fit_paths(STAR)
    assert all((a == b).all() for a, b in zip(first, second, strict=True))
    coarse = fit_paths(STAR, step=0.5)
    assert np.abs(coarse[0][::3]).max() * 2 == pytest.approx(np.abs(first[0][::3]).max(), abs=3)
    for step in (0.3, 1.0, 0.0, -0.25):
        with pytest.raises(ValueError, match="step"):
            fit_paths(STAR, step=step)
    with pytest.raises(ValueError, match="tolerance"):
        fit_paths(STAR, tolerance=0)


def test_joints_are_smooth_on_a_disc():
    (path,) = fit_paths(np.hypot(X - 60, Y - 48) < 40)
    before, after = path[::3] - np.roll(path, 1, 0)[::3], np.roll(path, -1, 0)[::3] - path[::3]
    cosine = (before * after).sum(1) / np.hypot(*before.T) / np.hypot(*after.T)
    assert cosine.min() > 0.99


def test_chamfer_reaches_a_blob():
    mask = np.hypot(X - 64, Y - 48) < 28 + 6 * np.cos(3 * np.arctan2(Y - 48, X - 64))
    paths = fit_paths_chamfer(mask, iterations=200, split_every=100)
    check(mask, paths)
    assert iou(mask, paths) > 0.95
    assert all(
        (a == b).all()
        for a, b in zip(
            paths, fit_paths_chamfer(mask, iterations=200, split_every=100), strict=True
        )
    )
    assert iou(mask, fit_paths_chamfer(mask, iterations=1)) < iou(mask, paths)


def test_chamfer_splits_where_it_is_far_off():
    few = fit_paths_chamfer(STAR, iterations=120, split_every=60, tau=1.0)
    assert len(few[0]) == 12
    assert len(fit_paths_chamfer(STAR, iterations=120, split_every=60, tau=1e-9)[0]) > 12


@pytest.mark.parametrize("radius", [13, 25.5, 31])
def test_chamfer_goes_back_to_before_the_split_that_crossed(radius):
    """With so small a `tau` all segments of a disc are split until they are shorter than a step."""
    mask = np.hypot(X - 60, Y - 48) < radius
    paths = fit_paths_chamfer(mask, iterations=700, split_every=100, tau=1e-9)
    check(mask, paths)
    assert iou(mask, paths) > 0.97
    assert len(paths[0]) > len(fit_paths(mask)[0])


def test_chamfer_is_repaired():
    mask = blob(1, 1.0, (32, 40))
    check(mask, fit_paths_chamfer(mask, iterations=3))


@pytest.mark.parametrize("name", ["kodim05", "kodim23"])
def test_real_masks(data_dir, name):
    import cv2

    labels = cv2.imread(str(data_dir / "kodak_masks" / f"{name}.png"), cv2.IMREAD_UNCHANGED)
    paths = fit_paths(labels == 1)
    assert len(paths) == len(trace(labels == 1))
    assert iou(labels == 1, paths) > 0.995
    assert sum(len(p) // 3 for p in paths) < {"kodim05": 360, "kodim23": 45}[name]
    if name == "kodim23":
        check(labels == 1, paths)
