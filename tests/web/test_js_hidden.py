"""The plain JavaScript decoder passes the conformance suite: what lies behind, and mattes."""

import pytest

from tests.support.js import KINDS, Batch, check, needs_node

pytestmark = needs_node


@pytest.mark.parametrize("kind", KINDS["hidden"])
def test_cases(batch: Batch, kind: str) -> None:
    check(batch, kind)
