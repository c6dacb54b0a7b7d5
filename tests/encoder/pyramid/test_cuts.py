"""Views of encoded pictures are cut by the outlines that the file has anyway."""

import numpy as np
import pytest

from proxyimg_codec import encode, from_bytes
from proxyimg_codec.container.file import parse
from proxyimg_codec.encoder.pyramid.picture import _view
from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.io import raster
from tests.support.edits import grown
from tests.support.pictures import smooth
from tests.support.pyramids import filled

FAST = {"texture": "pyramid", "effort": 1, "jobs": 1}


def cuts_of(image):
    return [t["cuts"] for t in parse(image.to_bytes()).textures]


def test_layers_are_cut_by_what_is_in_front(small_masks):
    image = encode(
        smooth(64, 48), masks=[Region(n, m) for n, m in small_masks.items()], quality=40, **FAST
    )
    assert [v.name for v in image.layers] == ["back", "disc", "bar"]
    assert cuts_of(image) == [[1, 2], [1, 2], [2]]
    assert all(v.texture.mask is None for v in image.layers)
    data = image.to_bytes()
    again = from_bytes(data)
    assert again.to_bytes() == data
    np.testing.assert_array_equal(again.render(), image.render())
    assert not any(filled(v.texture) for v in again.layers)


def test_one_layer_needs_no_cuts(rgba_photo):
    assert cuts_of(encode(smooth(48, 40), max_layers=1, quality=40, **FAST)) == [[]]
    assert cuts_of(encode(rgba_photo, max_layers=1, quality=40, **FAST)) == [[]]


def test_transparent_pictures_are_cut_too(rgba_photo):
    half = np.zeros((40, 48), bool)
    half[:, :24] = True
    regions = [Region("right", ~half), Region("left", half)]
    image = encode(rgba_photo, masks=regions, quality=40, **FAST)
    assert [v.name for v in image.layers] == ["right", "left"]
    assert cuts_of(image) == [[0, 1], [1]]


def square(x0, y0, x1, y1):
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    after = np.roll(corners, -1, 0)
    return Boundary(0, (np.stack([corners, corners, after], 1).reshape(-1, 2),))


@pytest.mark.parametrize("tiny", [False, True])
def test_only_boundaries_that_meet_the_box_cut(tiny):
    """Its box reaches 2 px beyond the layer; one that covers no sample has the whole canvas."""
    covered = np.zeros((40, 60), np.float32)
    covered[10:20, 10:30] = not tiny
    boundaries = [
        square(0, 0, 5, 5), square(10, 10, 30, 20), square(32, 10, 40, 20), square(31, 10, 40, 20),
        None, square(10, 22, 20, 30), square(0, 0, 9, 9),
    ]  # fmt: skip
    box, cuts = _view(boundaries, 1, covered)
    assert box == ((0, 0, 60, 40) if tiny else (8, 8, 24, 14))
    assert cuts.box == box
    assert cuts.numbers(1, boundaries) == ([1, 2, 3, 5, 6] if tiny else [1, 3, 6])


def redness(picture):
    return picture[..., 0] - picture[..., 1:].mean(-1, dtype=np.float64)


def test_nothing_red_is_left_of_a_red_parrot(data_dir):
    """Nowhere in its place, but for a rim if it is only hidden, is it redder than around it."""
    path = data_dir / "kodak_masks" / "kodim23.png"
    if not path.is_file():
        pytest.skip("the shared masks are not here")
    picture = raster.read(data_dir / "kodak" / "kodim23.png").pixels
    head = np.s_[80:360, 360:720]
    whole = next(r.mask for r in load_masks(path, 768, 512) if r.name == "object 1")
    parrot = Region("parrot", whole[head])
    image = encode(picture[head], masks=[parrot], quality=60, **FAST)
    image.render()
    assert not any(filled(v.texture) for v in image.layers)
    inside = ~grown(~parrot.mask, 2)
    around = grown(parrot.mask, 20) & ~grown(parrot.mask, 3)
    before = redness(picture[head])
    most = before[around].max()
    assert (before[inside] > most + 30).mean() > 0.5
    gone, hidden = (redness(edit().render()) for edit in (
        image.layers["parrot"].removed, image.layers["parrot"].hidden))  # fmt: skip
    for left, place in ((gone, grown(parrot.mask, 3)), (hidden, inside)):
        assert (left[place] > most).mean() < 0.001
        assert left[place].max() < most + 20
        # What is copied may be of one part of what is around, such as the brown trunk.
        assert abs(left[place].mean() - before[around].mean()) < 8
    assert gone[parrot.mask].max() < most + 5
