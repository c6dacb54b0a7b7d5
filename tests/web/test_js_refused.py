"""The plain JavaScript decoder passes the conformance suite: files that must be refused."""

import pytest

from conformance.cases import load
from tests.support.js import ALL_KINDS, KINDS, Batch, check, needs_node

pytestmark = needs_node


@pytest.mark.parametrize("kind", KINDS["refused"])
def test_cases(batch: Batch, kind: str) -> None:
    check(batch, kind)


def test_all_kinds_are_tried() -> None:
    assert sorted(ALL_KINDS) == sorted({case.kind for case in load()})
