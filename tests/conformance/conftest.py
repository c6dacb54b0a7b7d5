"""What several tests of the conformance suite need."""

import pytest

from conformance.cases import FOLDER


@pytest.fixture
def at_root(monkeypatch):
    monkeypatch.chdir(FOLDER.parents[1])
