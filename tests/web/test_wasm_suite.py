"""libpxi as WebAssembly passes the conformance suite."""

import pytest

from tests.support.js import ALL_KINDS, Batch, check, needs_node

pytestmark = [needs_node, pytest.mark.usefixtures("wasm")]


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_cases(batch: Batch, kind: str) -> None:
    check(batch, kind, "--wasm")
