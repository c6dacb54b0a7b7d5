"""libpxi as WebAssembly, built once; tests are skipped where it cannot be."""

import fcntl
import shutil
import subprocess
from collections.abc import Iterator

import pytest

from tests.support.js import Batch
from tests.support.paths import ROOT


def lacking() -> str | None:
    """What is missing to build and run the module, or None."""
    for program in ("node", "make", "clang++", "wasm-ld", "wasm-opt"):
        if shutil.which(program) is None:
            return f"{program} is not installed"
    words = ["clang++", "--target=wasm32-wasi", "-fsyntax-only", "-x", "c++", "-"]
    header = "#include <vector>"
    if subprocess.run(words, input=header, text=True, capture_output=True).returncode:
        return "the C++ library of wasm32-wasi is not installed"
    return None


@pytest.fixture(scope="module")
def batch() -> Iterator[Batch]:
    """A decoder under Node for all tests of a module."""
    started = Batch()
    yield started
    started.end()


@pytest.fixture(scope="session")
def wasm(pytestconfig: pytest.Config) -> None:
    """The module of these sources, in web/pxi-wasm/."""
    reason = lacking()
    if reason:
        pytest.skip(reason)
    folder = pytestconfig.cache.mkdir("wasm")  # type: ignore[union-attr]  # there always is one
    with open(folder / "lock", "w") as lock:  # other workers wait for the first
        fcntl.flock(lock, fcntl.LOCK_EX)
        words = ["make", "-j2", "-C", str(ROOT / "libpxi" / "wasm")]
        made = subprocess.run(words, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout[-3000:] + made.stderr[-3000:]
