"""The plain JavaScript decoder passes the conformance suite: pyramids and their views."""

import pytest

from tests.support.js import KINDS, Batch, check, needs_node

pytestmark = needs_node


@pytest.mark.parametrize("kind", KINDS["pyramids"])
def test_cases(batch: Batch, kind: str) -> None:
    check(batch, kind)
