"""What hidden samples copy: chosen so that textures and edges go on, and never the object."""

import numpy as np
import pytest

from proxyimg_codec import encode
from proxyimg_codec.encoder.completion.references import CELLS, references
from proxyimg_codec.texture.completion import FILL_ONE, completed
from proxyimg_codec.texture.diffusion import diffused

HIGH, WIDE = 93, 131
RED = (250, 10, 10)


def hole(high=HIGH, wide=WIDE, share=0.35):
    """A disc in the middle."""
    y, x = np.mgrid[:high, :wide]
    radius = share * min(high, wide)
    return (y - high / 2) ** 2 + (x - wide / 2) ** 2 < radius**2


def textured(seed=3, high=HIGH, wide=WIDE):
    """Grain, brown below a line and blue above it."""
    grain = np.random.default_rng(seed).normal(0, 18, (high, wide, 1))
    above = np.arange(high)[:, None, None] < 0.45 * high
    ground = np.where(above, (60, 100, 200), (150, 110, 60))
    return np.clip(ground + grain, 0, 255).astype(np.float32)


def filled(picture, known, copies):
    """uint8 [H, W, 3]: what a decoder makes of the hidden samples."""
    values = np.moveaxis(np.rint(picture / 255 * FILL_ONE).astype(np.int32), 2, 0)
    if copies is not None:
        values, known = completed(values, known, copies)
    return np.rint(np.moveaxis(diffused(values, known), 0, 2) / FILL_ONE * 255).astype(np.uint8)


def covered(picture, mask):
    """The picture with an object over the mask."""
    return np.where(mask[..., None], np.float32(RED), picture).astype(np.float32)


def test_textures_go_on_and_edges_meet():
    picture, mask = textured(), hole()
    copies = references(covered(picture, mask), ~mask, mask, 0)
    found = filled(covered(picture, mask), ~mask, copies)
    smooth = filled(covered(picture, mask), ~mask, None)

    def grain(pixels, where):
        fine = np.diff(pixels.astype(float).mean(2), axis=1)
        return fine[where[:, 1:]].std()

    assert grain(smooth, mask) < 0.3 * grain(picture, ~mask)
    assert 0.7 * grain(picture, ~mask) < grain(found, mask) < 1.3 * grain(picture, ~mask)
    blue = found[..., 2].astype(int) > found[..., 0]
    right = blue == (picture[..., 2] > picture[..., 0])
    assert right[mask].mean() > 0.93, "the line goes on"
    reddest = found[mask].astype(int)
    assert (reddest[:, 0] - reddest[:, 1]).max() < 110, "nothing of the object comes along"


def test_regular_patterns_are_continued_in_step():
    y, x = np.mgrid[:HIGH, :WIDE]
    picture = np.where((x + y) % 12 < 6, 210, 40)[..., None] * np.ones(3, np.float32)
    mask = hole(share=0.25)
    copies = references(covered(picture, mask), ~mask, mask, 0)
    found = filled(covered(picture, mask), ~mask, copies)
    off = np.abs(found.astype(float) - picture).mean(2)
    assert (off[mask] < 40).mean() > 0.8


@pytest.mark.parametrize("picture", ["flat", "graded"])
def test_smooth_surroundings_need_no_copies_unless_they_are_wanted(picture):
    ramp = np.linspace(20, 200, WIDE) if picture == "graded" else np.full(WIDE, 90.0)
    pixels = np.broadcast_to(ramp[None, :, None], (HIGH, WIDE, 3)).astype(np.float32)
    mask = hole()
    assert references(pixels, ~mask, mask, 0) is None
    assert references(pixels, ~mask, mask, 0, always=True) is not None


@pytest.mark.parametrize("size", [(1, 1), (5, 7), (9, 200)], ids=str)
@pytest.mark.parametrize("what", ["nothing hidden", "all hidden", "too little known"])
def test_where_nothing_can_be_copied_there_is_none(size, what):
    pixels = textured(1, *size)
    wanted = np.full(size, what != "nothing hidden")
    if what == "too little known":
        wanted[:, :3] = False
    assert references(pixels, ~wanted, wanted, 0, always=True) is None


def test_holes_that_touch_all_borders_are_completed_from_the_corners():
    picture = textured()
    y, x = np.mgrid[:HIGH, :WIDE]
    mask = (abs(x - WIDE // 2) < 12) | (abs(y - HIGH // 2) < 12)
    copies = references(covered(picture, mask), ~mask, mask, 0)
    found = filled(covered(picture, mask), ~mask, copies)
    assert found[mask].std() > 10
    assert (found[mask][:, 0] < 240).all()


def test_references_fit_their_view_and_are_the_same_for_the_same_seed():
    picture, mask = textured(5, 411, 613), hole(411, 613, 0.45)
    first, again = (references(picture, ~mask, mask, 7) for _ in range(2))
    assert first.sources.shape == tuple(-(-n // (1 << first.grain)) for n in mask.shape)
    assert first.grain > 2
    assert (first.sources > 0).sum() <= CELLS
    assert first.sources.max() == len(first.offsets)
    assert (first.sources == again.sources).all()
    assert (first.offsets == again.offsets).all()
    cells = np.kron(first.sources > 0, np.ones((1 << first.grain,) * 2, bool))[:411, :613]
    assert cells[mask].all(), "all that is hidden is completed"


def encoded(background, **masks):
    picture = covered(textured(), masks["object"]).astype(np.uint8)
    return encode(picture, masks=masks, background=background, effort=1, texture="pyramid")


def test_layers_copy_what_they_hide_by_default():
    image = encoded("auto", object=hole())
    assert image.layers[0].texture.copies is not None
    assert image.layers["object"].texture.copies is None, "nothing hides the object"
    for background in ("none", "smooth", "diffuse"):
        assert encoded(background, object=hole()).layers[0].texture.copies is None


def test_layers_before_others_are_completed_within_their_shape():
    square = np.zeros((HIGH, WIDE), bool)
    square[10:80, 20:110] = True
    image = encoded("auto", square=square, object=hole(share=0.2))
    texture = image.layers["square"].texture
    assert texture.copies is not None
    x, y, _, _ = texture.part
    rows, columns = np.nonzero(texture.copies.sources)
    side = 1 << texture.copies.grain
    hidden = np.argwhere(hole(share=0.2))
    assert (np.stack([rows, columns], 1) * side + (y + side, x + side) >= hidden.min(0) - 4).all()
    assert (np.stack([rows, columns], 1) * side + (y, x) <= hidden.max(0) + 4).all()
