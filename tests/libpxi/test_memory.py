"""Memory that runs out at any time: a clear error, and no crash."""

import os
import subprocess

import pytest

from tests.libpxi.conftest import run
from tests.support.paths import ROOT, TESTS

FILES = [
    "views/pyramid-cuts",
    "motion/moves-loop",
    "behind/copies-two",
    "refused-views/invalid-view-mask",
]


@pytest.fixture(scope="module")
def shim(build, tmp_path_factory):
    path = tmp_path_factory.mktemp("memory") / "shim.so"
    run("cc", "-shared", "-fPIC", "-O1", TESTS / "libpxi/failing_malloc.c", "-o", path, "-ldl")
    return path


@pytest.mark.parametrize("name", FILES)
def test_memory_that_ends_is_an_error(pxi_dec, shim, name, tmp_path):
    path, out = ROOT / "conformance/cases" / name / "input.pxi", tmp_path / "out.png"
    expected = 4 if "refused" in name else 0

    def ends(after):
        env = {**os.environ, "LD_PRELOAD": str(shim), "FAIL_AT": str(after)}
        done = subprocess.run([pxi_dec, path, out], env=env, capture_output=True, text=True)
        if done.returncode == 0:
            out.unlink()
        elif done.returncode not in (expected, 4):
            assert done.returncode in (3, 6), (after, done.returncode, done.stderr)
            assert "memory" in done.stderr, (after, done.stderr)
        assert not out.exists()
        return done.returncode == expected

    enough = 1
    while not ends(enough):
        enough *= 2
    for after in range(1, enough, max(enough // 50, 1)):
        ends(after)
