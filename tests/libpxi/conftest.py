"""libpxi, built once and kept for the next run; tests are skipped where it cannot be."""

import fcntl
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

HEADER = '#include "zstd.h"'


def lacking():
    """What is missing to build libpxi, or None."""
    for program in ("cmake", "cc", "c++"):
        if shutil.which(program) is None:
            return f"{program} is not installed"
    words = ["cc", "-E", "-x", "c", "-"]
    if subprocess.run(words, input=HEADER, capture_output=True, text=True).returncode:
        return "the header of zstd is not installed"
    return None


def run(*words, **options):
    """Runs a program that must succeed; what it prints."""
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, timeout=900, **options
    )
    assert done.returncode == 0, (words, done.stdout[-3000:], done.stderr[-3000:])
    return done.stdout


def built(folder, *options):
    """Configures and builds libpxi in a folder, unless it is built there already."""
    ninja = ["-G", "Ninja"] if shutil.which("ninja") else []
    run("cmake", "-S", ROOT / "libpxi", "-B", folder, *ninja, *options)
    run("cmake", "--build", folder, "-j2")
    return folder


@pytest.fixture(scope="session")
def build(pytestconfig):
    """Folder of the build, of one level of processors to save time."""
    reason = lacking()
    if reason:
        pytest.skip(reason)
    folder = Path(pytestconfig.cache.mkdir("libpxi"))
    modules = ["pkg-config", "--exists", "gdk-pixbuf-2.0", "gmodule-no-export-2.0"]
    pixbuf = shutil.which("pkg-config") and not subprocess.run(modules).returncode
    options = ["-DPXI_LEVELS=OFF", f"-DPXI_PIXBUF={'ON' if pixbuf else 'OFF'}"]
    # Other workers wait for the first, and do not link anew what it already runs.
    run_of_all, stamp = os.environ.get("PYTEST_XDIST_TESTRUNUID"), folder / "stamp"
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if run_of_all is None or not stamp.exists() or stamp.read_text() != run_of_all:
            built(folder / "build", *options, "-DCMAKE_INSTALL_PREFIX=/opt/pxi")
            stamp.write_text(run_of_all or "")
    return folder / "build"


@pytest.fixture(scope="session")
def pxi_dec(build):
    """The program."""
    return build / "pxi-dec"
