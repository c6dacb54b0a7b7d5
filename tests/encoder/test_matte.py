"""Soft layers: which masks are soft, what is stored of them, and what edits make of it."""

import cv2
import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.encoder.completion.foreground import foreground
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.encoder.shapes.soft import is_soft
from proxyimg_codec.errors import UsageError

ROWS, COLUMNS = 93, 141
BY = 61, 7
"""Columns and rows by which the ball is moved."""


def scene(blur=4.0):
    """A striped ball with a soft rim on a ground: alpha, its colours, those of the ground."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    alpha = (np.hypot(y - 44, x - 40) < 21).astype(np.float32)
    alpha = cv2.GaussianBlur(alpha, (0, 0), blur) if blur else alpha
    alpha = np.where(alpha < 0.01, 0, np.where(alpha > 0.99, 1, alpha)).astype(np.float32)
    ball = np.stack([0.85 + 0 * x, 0.3 + 0.15 * np.sin(x / 5), 0.2 + 0.1 * np.cos(y / 4)], -1)
    ground = np.stack([0.2 + y / 300, 0.55 + 0.1 * np.sin(x / 17), 0.75 - y / 400], -1)
    return alpha, ball.astype(np.float32), ground.astype(np.float32)


def over(alpha, own, behind):
    return alpha[..., None] * own + (1 - alpha[..., None]) * behind


def encoded(matte="auto", blur=4.0, **options):
    alpha, ball, ground = scene(blur)
    pixels = np.rint(255 * over(alpha, ball, ground)).astype(np.uint8)
    masks = {"ball": np.rint(255 * alpha).astype(np.uint8)}
    options = {"effort": 1, "quality": 75, "masks": masks, **options}
    return pxi.encode(pixels, matte=matte, **options)


@pytest.fixture(scope="module")
def soft():
    return pxi.from_bytes(encoded().to_bytes())


def alone(image):
    """Premultiplied colour and alpha of the ball without the ground."""
    found = image.render(layers=["ball"], dtype=np.float32)
    return found[..., :3] * found[..., 3:], found[..., 3]


def test_rims_that_are_wider_than_antialiasing_are_soft():
    large = np.zeros((4 * ROWS, 4 * COLUMNS), np.float32)
    cv2.circle(large, (200, 180), 90, 1, -1)
    size = COLUMNS, ROWS
    assert not is_soft(cv2.resize(large, size, interpolation=cv2.INTER_AREA))
    assert not is_soft(cv2.resize(large, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR))
    assert is_soft(scene()[0])
    for k in range(9):  # hairs that are narrower than a pixel
        cv2.line(large, (200, 180), (320, 90 + 20 * k), 1, 2)
    assert is_soft(cv2.resize(large, size, interpolation=cv2.INTER_AREA))


def test_colours_of_a_layer_are_found_without_what_shines_through():
    alpha, ball, ground = scene(6.0)
    mixed = over(alpha, ball, ground)
    some = alpha > 0.1
    found = foreground(mixed, alpha, np.ones_like(alpha))
    assert np.abs(found - ball)[some].mean() < 0.03
    assert np.abs(mixed - ball)[some].mean() > 0.05
    covered = np.ones_like(alpha)
    covered[:, 30:36] = 0
    mixed[:, 30:36] = 1
    assert np.abs(foreground(mixed, alpha, covered) - ball)[some].mean() < 0.04


def test_hard_masks_are_as_without_mattes():
    hard = encoded("hard", blur=0).to_bytes()
    assert encoded("auto", blur=0).to_bytes() == hard
    assert encoded("auto", blur=0.6).to_bytes() == encoded("hard", blur=0.6).to_bytes()


def test_soft_layers_look_at_rest_as_hard_ones(soft):
    hard = encoded("hard")
    np.testing.assert_array_equal(soft.render(), hard.render())
    assert len(soft.to_bytes()) > len(hard.to_bytes())
    assert [v.texture.matte is not None for v in soft.layers] == [False, True]


@pytest.mark.parametrize("quality", [50, 90])
def test_a_moved_layer_takes_nothing_along(quality):
    image = encoded(quality=quality)
    alpha, ball, ground = scene()
    colour, found = alone(image)
    rim = (alpha > 0.02) & (alpha < 0.98)
    assert np.abs(found - alpha)[rim].mean() < (0.02 if quality == 50 else 0.006)
    assert np.abs(colour - alpha[..., None] * ball)[rim].mean() < 0.02
    assert found[alpha == 0].max() < 0.03
    moved = image.layers["ball"].moved(*BY).render(dtype=np.float32)
    alpha, ball = (np.roll(v, BY, (1, 0)) for v in (alpha, ball))
    true, rim = over(alpha, ball, ground), (alpha > 0.02) & (alpha < 0.98)
    error = np.abs(moved - true)[rim].mean()
    assert error < 0.016
    hard = encoded("hard", quality=quality).layers["ball"].moved(*BY).render(dtype=np.float32)
    assert np.abs(hard - true)[rim].mean() > 2.5 * error


def test_no_halo_on_a_chequerboard(soft):
    alpha, ball, _ = scene()
    board = np.repeat(((np.indices(alpha.shape) // 6).sum(0) % 2)[..., None], 3, 2)
    colour, found = alone(soft)
    seen = colour + (1 - found[..., None]) * board
    assert np.abs(seen - over(alpha, ball, board)).max() < 0.12
    assert np.abs(seen - over(alpha, ball, board)).mean() < 0.006


def test_edits_keep_the_matte(soft):
    alpha = alone(soft)[1]
    there = soft.layers["ball"].moved(*BY)
    assert there.layers["ball"].moved(-BY[0], -BY[1]).baked().to_bytes() == soft.to_bytes()
    np.testing.assert_allclose(alone(there)[1], np.roll(alpha, BY, (1, 0)), atol=1e-6)
    again = pxi.from_bytes(there.to_bytes())
    np.testing.assert_array_equal(again.render(), there.render())
    recoloured = soft.layers["ball"].recoloured(hue=120)
    np.testing.assert_allclose(alone(recoloured)[1], alpha, atol=1e-6)
    scaled = alone(soft.layers["ball"].scaled(0.5))[1]
    assert abs(scaled.sum() / alpha.sum() - 0.25) < 0.01
    shown = soft.layers["ball"].with_opacity(0.5)
    np.testing.assert_allclose(alone(shown)[1], alpha / 2, atol=1e-3)
    removed = soft.layers["ball"].removed().render(dtype=np.float32)
    assert np.abs(removed - scene()[2]).mean() < 0.02
    purged = soft.layers["ball"].removed().purged()
    assert len(purged.planes) == 1


def test_where_nothing_has_changed_behind_a_rim_it_stays(soft):
    """A layer behind one side of the ball is hidden; the other side is as before."""
    alpha, ball, ground = scene()
    spot = np.hypot(*(np.mgrid[:ROWS, :COLUMNS] - np.array([44, 74])[:, None, None])) < 11
    ground = np.where(spot[..., None], np.float32(0.9), ground)
    pixels = np.rint(255 * over(alpha, ball, ground)).astype(np.uint8)
    image = pxi.encode(pixels, masks={"spot": spot, "ball": alpha}, effort=1, quality=75)
    before, after = image.render(), image.layers["spot"].hidden().render()
    far = np.ones(alpha.shape, bool)
    far[30:] = False
    far[:, :45] = True
    np.testing.assert_array_equal(after[far], before[far])
    assert (after[36:52, 62:68] != before[36:52, 62:68]).any()


def test_textures_that_change_hands(soft, tmp_path):
    alpha = alone(soft)[1]
    file = str(tmp_path / "plain.png")
    paint = np.full((50, 83, 3), (40, 200, 90), np.uint8)
    paint[25:] += 4
    cv2.imwrite(file, paint)
    green = pxi.from_bytes(soft.layers["ball"].textured(file).to_bytes())
    colour, found = alone(green)
    assert np.abs(found - alpha).mean() < 0.006
    assert np.abs(colour - alpha[..., None] * np.float32([90, 200, 40]) / 255).mean() < 0.02
    two = soft.layers["ball"].duplicated("two").layers["two"].textured(file)
    lent = two.edited({"op": "texture", "layer": "back", "source": "ball"})
    seen = lent.render(layers=["back"], dtype=np.float32)
    assert seen.shape[2] == 3 or seen[..., 3].min() == 1
    assert (seen[..., 0] > seen[..., 2]).all()  # as red as the ball, without the blue ground


def test_what_was_removed_leaves_nothing_in_a_rim():
    alpha, ball, ground = scene()
    spot = np.hypot(*(np.mgrid[:ROWS, :COLUMNS] - np.array([44, 74])[:, None, None])) < 14
    mixed = np.where(spot[..., None], np.float32([1, 1, 0.1]), ground)
    pixels = np.rint(255 * over(alpha, ball, mixed)).astype(np.uint8)
    image = pxi.encode(pixels, masks={"spot": spot, "ball": alpha}, effort=1, quality=75)
    rim = spot & (alpha > 0.02) & (alpha < 0.6)
    for gone in (image.layers["spot"].hidden(), image.layers["spot"].removed()):
        seen = pxi.from_bytes(gone.to_bytes()).render(dtype=np.float32)
        assert np.abs(seen - over(alpha, ball, ground))[rim].mean() < 0.04
    assert np.abs(over(alpha, ball, mixed) - over(alpha, ball, ground))[rim].mean() > 0.15


def test_what_comes_to_lie_behind_a_rim_shines_through(soft):
    """A copy of the ball is moved behind it; and what was there is removed."""
    alpha = alone(soft)[1]
    both = soft.layers["ball"].duplicated("two").layers["two"].moved(25, 0)
    both = both.layers["two"].reordered(1)
    colour, behind = alone(soft)[0], np.roll(alpha, 25, 1)
    ground = over(behind, np.roll(scene()[1], 25, 1), scene()[2])
    seen = both.render(dtype=np.float32)
    wanted = colour + (1 - alpha[..., None]) * ground
    assert np.abs(seen - wanted)[(alpha > 0.02) & (alpha < 0.98)].mean() < 0.02


def test_the_matte_of_hard_masks_is_found():
    alpha, _, _ = scene()
    image = encoded("soft", masks={"ball": alpha > 0.5})
    found = alone(image)[1]
    rim = (alpha > 0.02) & (alpha < 0.98)
    assert np.abs(found - alpha)[rim].mean() < 0.75 * np.abs((alpha > 0.5) - alpha)[rim].mean()


def test_regions_of_segmenters_may_be_soft(monkeypatch):
    from proxyimg_codec.encoder.shapes import layers

    alpha = scene()[0]
    found = [Region("back", alpha < 0.5), Region("ball", alpha >= 0.5, alpha)]
    monkeypatch.setattr(layers, "find_segmenter", lambda *_: lambda *_: found)
    image = encoded(masks=None)
    np.testing.assert_allclose(alone(image)[1], alpha, atol=0.06)


def test_where_there_are_no_mattes(caplog):
    with pytest.raises(UsageError, match="matte soft needs texture pyramid"):
        encoded("soft", texture="implicit")
    with pytest.raises(UsageError, match="matte is fuzzy"):
        encoded("fuzzy")
    alpha, ball, _ = scene()
    clear = np.dstack([ball, np.where(np.arange(COLUMNS) < 90, 1, 0) * np.ones_like(alpha)])
    with pytest.raises(UsageError, match="needs an opaque picture"):
        pxi.encode(clear, masks={"ball": alpha}, matte="soft", effort=1)
    image = pxi.encode(clear, masks={"ball": alpha}, effort=1)
    assert all(v.texture.matte is None for v in image.layers)
    assert "soft masks are cut at one half: ball" in caplog.text
