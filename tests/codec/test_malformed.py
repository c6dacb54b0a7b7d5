"""Files that once did harm: found by fuzzing, or made to be expensive (see fuzz/README.md).

A file is called CLASS-WHAT.pxi, after the class of the error that it ends in.
"""

import tracemalloc

import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.errors import FormatError, LimitError, UnsupportedError
from proxyimg_codec.validation.validate import validate
from proxyimg_codec.validation.warnings import ERROR
from tests.support.paths import TESTS

FILES = sorted((TESTS / "malformed").glob("*.pxi"))
CLASSES = {"format": FormatError, "unsupported": UnsupportedError, "limit": LimitError}
PEAK = 300 << 20


def shown(data):
    image = from_bytes(data)
    return image.render(width=min(image.width, 16), height=min(image.height, 16))


def measured(work):
    """What it returns, with no more memory than any file may take that is as small."""
    tracemalloc.start()
    try:
        found = work()
        assert tracemalloc.get_traced_memory()[1] < PEAK
    finally:
        tracemalloc.stop()
    return found


def test_there_are_some():
    assert {path.name.split("-")[0] for path in FILES} <= {*CLASSES, "valid"}
    assert FILES


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_malformed_files_are_refused(path):
    data = path.read_bytes()
    name = path.name.split("-")[0]
    errors = {v.exit_code for v in measured(lambda: validate(data)) if v.severity == ERROR}
    if name == "valid":
        measured(lambda: shown(data))
        assert not errors
        return

    def refused():
        with pytest.raises(CLASSES[name]):
            shown(data)

    measured(refused)
    assert errors == {CLASSES[name].exit_code}
