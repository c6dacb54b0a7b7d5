"""Files of earlier versions of the format, kept for ever, and the pictures they always were."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from conformance import judge, pixels
from proxyimg_codec import from_bytes
from proxyimg_codec.container.chunks import READABLE, VERSION

GOLDEN = Path(__file__).with_name("golden")
FILES = sorted(GOLDEN.glob("*/*.pxi"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f"{f.parent.name}-{f.stem}")
def test_old_files_decode_as_ever(file):
    data = file.read_bytes()
    assert f"{data[8]}.{data[9]}" == file.parent.name
    expected = pixels.read(file.with_suffix(".png").read_bytes())
    peak, rms = judge.difference(from_bytes(data).render(dtype=np.uint16), expected)
    assert peak < 0.05
    assert rms < 0.01


def test_old_files_are_saved_as_new_ones_with_the_same_pixels():
    image = from_bytes((GOLDEN / "0.1" / "alpha.pxi").read_bytes())
    saved = image.to_bytes()
    assert (saved[8], saved[9]) == VERSION
    np.testing.assert_array_equal(from_bytes(saved).render(), image.render())


def test_no_version_is_forgotten():
    kept = {file.parent.name for file in FILES}
    assert kept == {f"{a}.{b}" for a, b in READABLE if (a, b) != VERSION}
