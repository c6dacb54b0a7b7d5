"""Hidden parts that copy what is around them, chosen from what a file has."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.codec.write import state
from proxyimg_codec.errors import UsageError
from tests.support.pyramids import cut_picture

pytestmark = pytest.mark.encoder

SIZE = (97, 131)


@pytest.fixture(scope="module")
def striped():
    """A picture of one layer with stripes of 6 pixels, and its middle cut out of it."""
    rows, columns = np.indices(SIZE)
    pixels = np.repeat(((columns // 6 % 2) * 140 + 60)[..., None], 3, 2).astype(np.uint8)
    middle = (rows - 48) ** 2 + (columns - 65) ** 2 < 20**2
    pixels[middle] = (200, 40, 40)
    masks = {"ball": middle.astype(np.uint8)}
    return pxi.encode(pixels, masks=masks, background="smooth", effort=1), middle


def energy(pixels, where):
    grey = pixels.astype(np.float64).mean(2)
    return float((np.diff(grey, axis=1, prepend=grey[:, :1])[where] ** 2).mean())


def test_what_was_filled_smoothly_goes_on_and_nothing_else_changes(striped):
    image, middle = striped
    completed = image.layers["back"].completed()
    assert np.array_equal(completed.render(), image.render())
    before, after = (v.layers["ball"].removed().render() for v in (image, completed))
    stripes = energy(after, ~middle)
    assert energy(before, middle) < stripes / 4
    assert stripes / 2 < energy(after, middle) < 2 * stripes
    kinds = [(old.type, old.payload == new.payload)
             for old, new in zip(state(image), state(completed), strict=True)]  # fmt: skip
    assert [kind for kind, same in kinds if not same] == ["TEXR"]
    assert completed.undone().to_bytes() == image.to_bytes()
    smooth = completed.layers["back"].completed("smooth").layers["ball"].removed()
    np.testing.assert_array_equal(smooth.render(), before)


def test_layers_that_hide_nothing_are_refused(striped):
    image, _ = striped
    with pytest.raises(UsageError, match="all of it shows"):
        image.layers["ball"].completed()


def test_implicit_layers_are_refused(small_pxi):
    with pytest.raises(UsageError, match="implicit"):
        pxi.open(small_pxi).layers["back"].completed()


def test_parts_of_masks_are_completed():
    image = cut_picture()
    moved = image.layers["back"].completed().layers["disc"].moved(9, 4)
    assert moved.render().shape == image.render().shape
