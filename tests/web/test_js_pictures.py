"""The plain JavaScript decoder passes the conformance suite: pictures of all sorts but pyramids."""

import pytest

from tests.support.js import KINDS, Batch, check, needs_node

pytestmark = needs_node


@pytest.mark.parametrize("kind", KINDS["pictures"])
def test_cases(batch: Batch, kind: str) -> None:
    check(batch, kind)
