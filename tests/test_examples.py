"""The examples in the docstrings of what people use most run as they stand."""

import doctest
import shutil

import pytest

from proxyimg_codec import api
from proxyimg_codec.edit import methods
from tests.support.files import SMALL

EXAMPLES = [
    test for module in (api, methods) for test in doctest.DocTestFinder().find(module)
    if test.examples
]  # fmt: skip


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda test: test.name)
def test_it_runs(example, tmp_path, monkeypatch):
    if "encode" in example.name:
        pytest.importorskip("cv2")
        pytest.importorskip("torch")
    shutil.copy(SMALL, tmp_path / "photo.pxi")
    monkeypatch.chdir(tmp_path)
    assert doctest.DocTestRunner().run(example).failed == 0


def test_what_people_use_most_has_one():
    names = {test.name.rpartition(".")[2] for test in EXAMPLES}
    most = {"open_image", "from_bytes", "encode", "render", "save", "edited", "undone", "animated"}
    assert names >= most | {"moved", "dragged", "recoloured"}
