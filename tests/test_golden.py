"""Files of earlier versions of the format, kept for ever, and the pictures they always were."""

from pathlib import Path

import numpy as np
import pytest

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
    image = from_bytes(data)
    at = 0.37 if image.timeline else None
    peak, rms = judge.difference(image.render(t=at, dtype=np.uint16), expected)
    assert peak < 0.05
    assert rms < 0.01


@pytest.mark.parametrize(
    "name",
    [
        "0.1/alpha",
        "0.2/all-displaced",
        "0.2/edited",
        "0.3/edited",
        "0.3/moves-loop",
        "0.9/edited",
        "0.9/moves-loop",
        "0.10/edited",
        "0.10/moves-loop",
        "0.10/cuts-moved",
        "0.11/edited",
        "0.11/cuts-filled",
        "0.11/copies-many",
    ],
)
def test_old_files_are_saved_as_new_ones_with_the_same_pixels(name):
    image = from_bytes((GOLDEN / f"{name}.pxi").read_bytes())
    saved = image.to_bytes()
    assert (saved[8], saved[9]) == VERSION
    again = from_bytes(saved)
    np.testing.assert_array_equal(again.render(), image.render())
    assert again.history == image.history


@pytest.mark.parametrize(
    ("edited", "edits", "start"),
    [
        ("0.2/edited", 6, "0.1/layers"),
        ("0.3/edited", 3, "0.3/start"),
        ("0.9/edited", 2, "0.9/start"),
        ("0.10/edited", 2, "0.10/start"),
        ("0.11/edited", 2, "0.11/start"),
    ],
)
def test_old_histories_lead_back(edited, edits, start):
    """The edits of these files, made by earlier versions, began with others."""
    image = from_bytes((GOLDEN / f"{edited}.pxi").read_bytes())
    assert len(image.history) == edits
    first = from_bytes((GOLDEN / f"{start}.pxi").read_bytes())
    for found in (image, from_bytes(image.to_bytes())):
        assert found.undone(edits).to_bytes() == first.to_bytes()


def test_no_version_is_forgotten():
    kept = {file.parent.name for file in FILES}
    assert kept == {f"{a}.{b}" for a, b in READABLE if (a, b) != VERSION}
