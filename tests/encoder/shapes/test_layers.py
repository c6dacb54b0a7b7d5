"""Layers keep the whole of their masks, and pictures look as they do without hidden parts."""

import cv2
import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.settings import Settings
from proxyimg_codec.encoder.shapes.coverage import coverage_of
from proxyimg_codec.encoder.shapes.layers import plan_layers
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.errors import InputError
from proxyimg_codec.render.quality import psnr

WIDTH, HEIGHT = 109, 75
FAST = {"effort": 1, "jobs": 1}
PYRAMID = Settings(texture="pyramid", jobs=1)


def disc(x, y, radius):
    """bool [H, W]."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    return np.hypot(columns - x, rows - y) < radius


def box(x0, y0, x1, y1):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[y0:y1, x0:x1] = True
    return mask


LEFT, RIGHT = disc(44, 36, 25), disc(70, 40, 20)


def painted(kind="opaque"):
    """A red disc below a blue one; uint8 [H, W, 3 or 4]."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    picture = np.dstack([60 + x, 90 + y, 120 + 60 * np.sin((x + y) / 9)])
    picture[LEFT] = (220, 60, 40)
    picture[RIGHT] = (40, 90, 220)
    picture = picture.astype(np.uint8)
    alpha = {
        "opaque": None,
        "crisp": (LEFT | RIGHT) * 255,
        "soft": np.clip((LEFT | RIGHT) * (330 - 3 * np.abs(x - 60)), 0, 255),
        "soft front": np.where(RIGHT, 140, LEFT * 255),
    }[kind]
    return picture if alpha is None else np.dstack([picture, alpha.astype(np.uint8)])


def covered(masks, name, picture=None):
    """What the boundary of a layer covers by at least one half, bool [H, W]."""
    picture = painted() if picture is None else picture
    opaque = np.full((*picture.shape[:2], 1), 255)
    whole = (picture if picture.shape[2] == 4 else np.dstack([picture, opaque])) / np.float32(255)
    regions = [Region(n, m) for n, m in masks.items()]
    plan = plan_layers(whole.astype(np.float32), PYRAMID, regions)
    (boundary,) = [v.boundary for v in plan.layers if v.name == name]
    return coverage_of(boundary, WIDTH, HEIGHT).reshape(HEIGHT, WIDTH) >= 0.5


def iou(one, other):
    return (one & other).sum() / (one | other).sum()


def test_a_hidden_part_has_the_outline_that_was_given():
    for whole in (LEFT, LEFT | RIGHT):
        found = covered({"left": whole, "right": RIGHT}, "left")
        assert iou(found, whole) > 0.985
        # Not even where both outlines cross does it go beyond.
        beyond = found & ~whole
        assert beyond.sum() < 0.01 * whole.sum()
        assert not (beyond & ~grown(whole, 1)).any()


def grown(mask, radius):
    """Mask [H, W] with all pixels of a square around each."""
    padded = np.pad(mask, radius)
    shifts = [(i, j) for i in range(2 * radius + 1) for j in range(2 * radius + 1)]
    return np.any([padded[i : i + HEIGHT, j : j + WIDTH] for i, j in shifts], axis=0)


def test_layers_go_on_a_little_below_those_that_they_touch():
    """Also where they have a hidden part elsewhere."""
    front = box(40, 10, 80, 60)
    touching = box(10, 20, 40, 50)
    for rear in (touching, touching | box(40, 30, 60, 40)):
        found = covered({"rear": rear, "front": front}, "rear")
        # Corners of outlines are rounded.
        assert found[22:28, 41].all()
        assert found[42:48, 41].all()
        assert not found[20:28, 45:].any()
        assert iou(found & ~front, touching) > 0.97
    assert found[32:38, 42:58].all()


@pytest.mark.parametrize("kind", ["opaque", "crisp", "soft", "soft front"])
@pytest.mark.parametrize("whole", [LEFT, LEFT | RIGHT], ids=["crossing", "around"])
def test_hidden_parts_do_not_change_what_is_seen(kind, whole):
    picture = painted(kind)
    images = [
        pxi.encode(picture, masks={"left": left, "right": RIGHT}, quality=60, **FAST)
        for left in (LEFT & ~RIGHT, whole)
    ]
    plain, full = (image.render().astype(int) for image in images)
    assert psnr(picture, images[1]) > psnr(picture, images[0]) - 0.01
    if kind == "opaque":
        assert np.abs(full - plain).max() <= 2
    else:
        before, after = (np.abs(v - picture.astype(int))[..., 3].mean() for v in (plain, full))
        assert after < before + 0.01
    sizes = [len(image.to_bytes()) for image in images]
    assert sizes[1] < sizes[0] + 60


@pytest.mark.parametrize("texture", ["pyramid", "implicit"])
def test_without_the_front_the_whole_outline_shows(texture):
    masks = {"left": LEFT, "right": RIGHT}
    image = pxi.encode(painted(), masks=masks, texture=texture, quality=60, **FAST)
    bare = image.layers["right"].removed().render().astype(int)
    red = bare[..., 0] - bare[..., 1] > 110
    assert iou(red, LEFT) > (0.97 if texture == "pyramid" else 0.9)


def test_hidden_parts_keep_away_from_the_outline_of_a_transparent_picture():
    """There the coverage of both layers would add up."""
    found = covered({"left": LEFT | RIGHT, "right": RIGHT}, "left", painted("crisp"))
    rim = RIGHT & grown(~(LEFT | RIGHT), 1) & ~grown(LEFT, 4)
    assert rim.sum() > 40
    assert not (found & rim).any()
    assert (found & disc(70, 40, 14)).sum() > 0.98 * disc(70, 40, 14).sum()


def test_nothing_hides_below_what_is_translucent():
    picture = painted("soft front")
    found = covered({"left": LEFT, "right": RIGHT}, "left", picture)
    # Outlines may keep off from what shows: there, alpha tells.
    assert iou(found & (picture[..., 3] > 0), LEFT & ~RIGHT) > 0.97


def test_outlines_do_not_bound_the_quality_of_a_transparent_picture():
    """Thin lines, which outlines miss, and holes between them."""
    ink = np.zeros((HEIGHT, WIDTH), np.uint8)
    for k in range(9):
        cv2.line(ink, (8 + 11 * k, 5), (99 - 7 * k, 68), 255, 1, cv2.LINE_AA)
    for masks in (None, {"left": LEFT}):
        sprite = np.dstack([painted(), ink])
        coarse, fine = (
            psnr(sprite, pxi.encode(sprite, masks=masks, quality=q, **FAST)) for q in (40, 85)
        )
        assert fine > 40
        assert fine > coarse + 6


@pytest.mark.parametrize("texture", ["pyramid", "implicit"])
def test_parts_are_children_that_follow(texture):
    eye = disc(38, 30, 6)
    masks = {"cat": LEFT, "cat/eye": eye, "dog/nose": disc(90, 60, 5)}
    image = pxi.encode(painted(), masks=masks, texture=texture, **FAST)
    image = pxi.from_bytes(image.to_bytes())
    assert [v.data.parent for v in image.layers] == [None, None, "cat", "dog"]
    assert dict(image.picture.groups) == {"dog": None}
    moved = image.layers["cat"].moved(11, 7)
    alone = [i.render(layers=["cat/eye"])[..., 3] >= 128 for i in (image, moved)]
    assert iou(np.roll(alone[0], (7, 11), (0, 1)), alone[1]) > 0.97


def test_a_part_may_lie_outside():
    image = pxi.encode(painted(), masks={"cat": LEFT, "cat/ball": box(90, 4, 104, 18)}, **FAST)
    assert image.layers["cat/ball"].data.parent == "cat"


@pytest.mark.parametrize("alpha", [False, True])
def test_masks_of_one_pixel(alpha):
    dot = box(20, 30, 21, 31)
    picture = painted()
    if alpha:
        picture = np.dstack([picture, box(3, 3, 100, 70) * np.uint8(255)])
    image = pxi.encode(picture, masks={"dot": dot, "big": box(40, 30, 60, 50)}, **FAST)
    found = image.render(layers=["dot"])[..., 3] >= 128
    assert found[dot].all()
    assert not (found & ~grown(dot, 1)).any()
    # All but one pixel of a mask is hidden.
    big, hole = box(10, 20, 40, 50), box(10, 20, 40, 50) & ~dot
    image = pxi.encode(picture, masks={"big": big, "hole": hole}, **FAST)
    assert [v.name for v in image.layers][1:] == ["big", "hole"]


def test_too_many_layers_are_refused():
    dots = {f"dot {k}": box(3 * (k % 30), 3 * (k // 30), 3 * (k % 30) + 2, 3 * (k // 30) + 2)
            for k in range(65)}  # fmt: skip
    with pytest.raises(InputError, match="65 masks are too many; at most 64"):
        pxi.encode(painted(), masks=dots, **FAST)
    del dots["dot 0"]
    with pytest.raises(InputError, match="65 layers, with what no mask covers, are too many"):
        pxi.encode(painted(), masks=dots, **FAST)
    del dots["dot 1"]
    assert len(pxi.encode(painted(), masks=dots, **FAST).layers) == 64
