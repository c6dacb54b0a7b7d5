import numpy as np
import pytest

from proxyimg_codec.encoder.shapes.external_models.inpainting import find_inpainter
from proxyimg_codec.errors import InputError
from tests.support import onnx_models

HEIGHT, WIDTH = 141, 203
Y, X = np.mgrid[:HEIGHT, :WIDTH]
SLOPE = np.stack([X / WIDTH, Y / HEIGHT, 0.5 + 0 * X], -1).astype(np.float32)
HOLES = {
    "middle": np.hypot(Y - 70, X - 101) < 15,
    "corner": (Y < 11) & (X < 13),
    "last row": (Y == HEIGHT - 1) & (X > 150),
    "last column": (X == WIDTH - 1) & (Y < 30),
    "several": (abs(Y - 40) < 9) & (X % 60 < 17),
    "one pixel": (Y == 3) & (X == 200),
}
SIDES = ["", "512, 512", "64, 64", "48, 96", "h, 96"]


def filled(tmp_path, picture, hole, *made):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.inpainting(*made))
    return find_inpainter(str(path))(picture, hole)


@pytest.mark.parametrize("hole", HOLES.values(), ids=HOLES)
@pytest.mark.parametrize(("side", "white"), list(zip(SIDES, [1, 255, 255, 1, 1], strict=True)))
def test_holes_get_what_is_around_them_and_all_else_stays(tmp_path, side, white, hole):
    """The model makes all else darker, so that what is pasted beyond the hole would be seen."""
    seen = np.where(hole[..., None], np.float32([1, 0, 1]), SLOPE)
    found = filled(tmp_path, seen, hole, side, white, 31)
    assert found.dtype == np.float32
    assert (found[~hole] == seen[~hole]).all()
    assert np.abs(found - SLOPE)[hole].max() < 0.2
    assert np.abs(found - SLOPE)[hole][:, 2].max() < 0.02


def test_what_is_in_the_hole_has_no_influence(tmp_path):
    hole = HOLES["middle"] | HOLES["corner"]
    pictures = [np.where(hole[..., None], np.float32(v), SLOPE) for v in (0, 0.3, 1)]
    for side in ("", "64, 64"):
        first, *others = (filled(tmp_path, p, hole, side, 1, 31) for p in pictures)
        assert all((first == other).all() for other in others)


def test_small_pictures(tmp_path):
    for height, width in ((1, 1), (1, 9), (3, 2), (8, 8)):
        hole = np.zeros((height, width), bool)
        hole[-1, -1] = True
        quarter = np.full((height, width, 3), 0.25, np.float32)
        for side in ("", "64, 64"):
            found = filled(tmp_path, quarter, hole, side, 1, 9)
            if height * width > 1:
                assert np.abs(found - 0.25).max() < 0.01


def test_large_holes_are_seen_at_a_smaller_size(tmp_path):
    picture = np.repeat(np.repeat(SLOPE, 5, 0), 7, 1)
    hole = np.zeros(picture.shape[:2], bool)
    hole[100:600, 300:1100] = True
    found = filled(tmp_path, picture, hole, "64, 128", 255, 31)
    assert (found[~hole] == picture[~hole]).all()
    inside = np.abs(found - picture)[hole]
    assert inside.mean() < 0.15
    rows = np.abs(found[100, 300:1100] - picture[100, 300:1100])
    assert rows.max() < 0.3  # where the hole begins


def test_a_model_that_gives_another_size_is_told(tmp_path):
    text = """agraph (float[1, 3, h, w] image, float[1, 1, h, w] mask) => (float[1, 3, H, W] y) {
        y = MaxPool<kernel_shape = [2, 2], strides = [2, 2]>(image) }"""
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.model(text))
    with pytest.raises(
        InputError, match=r"gives \[1, 3, 72, 104\] for a picture of \[1, 3, 144, 208\]"
    ):
        find_inpainter(str(path))(SLOPE, HOLES["middle"])


def test_inputs_may_stand_in_any_order(tmp_path):
    text = """agraph (float[1, n, h, w] mask, float[1, n, h, w] image) => (float[1, 3, h, w] y) {
        y = Add(image, mask) }"""
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.model(text))
    found = find_inpainter(str(path))(SLOPE, HOLES["middle"])
    assert (found[HOLES["middle"]] == 1).all()


def test_two_files_are_too_many(tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.inpainting())
    with pytest.raises(InputError, match="one file, not 2"):
        find_inpainter(f"{path}:{path}")
