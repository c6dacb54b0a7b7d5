"""Wheels: reproducible, for all versions of Python, and enough to decode with what it names."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from conformance import pixels
from proxyimg_codec.native import levels
from tests.support.paths import ROOT

NEEDED = ("numpy", "zstandard", "msgpack")
FILE = ROOT / "tests" / "golden" / "0.10" / "cuts-moved.pxi"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (ROOT / ".git").exists(), reason="no checkout"),
    pytest.mark.skipif(importlib.util.find_spec("setuptools") is None, reason="no setuptools"),
    pytest.mark.skipif(levels.chosen().library is None, reason="the core was not compiled"),
]


def setup(folder, *command):
    """Runs setup.py, with the baseline alone, which is compiled sooner."""
    environment = os.environ | {"PROXYIMG_LEVELS": "baseline"}
    environment.pop("PYTHONPATH", None)
    subprocess.run(
        [sys.executable, "setup.py", "-q", *command],
        cwd=folder, env=environment, check=True, capture_output=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """An archive of the sources, unpacked."""
    checkout, to = tmp_path_factory.mktemp("checkout"), tmp_path_factory.mktemp("source")
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    for name in listed.stdout.decode().split("\0")[:-1]:
        if (ROOT / name).exists():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, checkout / name)
    setup(checkout, "sdist")
    [archive] = (checkout / "dist").iterdir()
    with tarfile.open(archive) as tar:
        tar.extractall(to, filter="data")
    [folder] = to.iterdir()
    return folder


@pytest.fixture(scope="module")
def wheel(source):
    """The wheel that the sources make."""
    setup(source, "bdist_wheel")
    [made] = (source / "dist").iterdir()
    return made


@pytest.fixture
def empty(wheel, tmp_path):
    """A Python that has nothing but the wheel and what it needs, as a function of its arguments."""
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    for name in NEEDED:
        [found] = importlib.util.find_spec(name).submodule_search_locations
        for place in (Path(found), Path(found).with_name(f"{name}.libs")):
            if place.exists():
                (site / place.name).symlink_to(place)

    def run(tool, *arguments):
        code = (
            f"import sys; sys.path.append({str(site)!r}); "
            f"from proxyimg_codec.cli.{tool} import main; sys.exit(main())"
        )
        return subprocess.run(
            [sys.executable, "-I", "-S", "-c", code, *map(str, arguments)],
            cwd=tmp_path, capture_output=True, text=True,
        )  # fmt: skip

    return run, site


def test_sources_hold_their_tests(source):
    names = (
        "tests/golden/0.1/alpha.pxi",
        "tests/conftest.py",
        "conformance/README.md",
        "web/decode.mjs",
    )
    for name in names:
        assert (source / name).read_bytes() == (ROOT / name).read_bytes()


def test_wheel_is_for_all_versions_of_python(wheel):
    name = wheel.name.removesuffix(".whl").split("-")
    assert name[2:4] == ["py3", "none"]
    assert name[4] != "any"
    with zipfile.ZipFile(wheel) as archive:
        [core] = [n for n in archive.namelist() if "_kernel" in n]
        data = archive.read(core)
    assert core == "proxyimg_codec/native/_kernel.so"
    assert b".debug_info" not in data
    assert b".symtab" not in data


def test_wheel_has_the_same_bytes_from_another_folder(wheel, source, tmp_path):
    other = tmp_path / "another" / "folder"
    shutil.copytree(source, other, ignore=shutil.ignore_patterns("dist", "build", "*.egg-info"))
    setup(other, "bdist_wheel")
    assert (other / "dist" / wheel.name).read_bytes() == wheel.read_bytes()


def test_wheel_decodes_with_what_it_needs_alone(empty, tool, tmp_path):
    run, site = empty
    assert run("info", "--version").stdout.splitlines()[1] == "core: baseline"
    ran = run("decode", FILE, "own.png", "--bit-depth", 16)
    assert ran.returncode == 0, ran.stderr
    tool("decode", FILE, tmp_path / "ours.png", "--bit-depth", "16")
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "ours.png").read_bytes()

    (site / "proxyimg_codec" / "native" / "_kernel.so").unlink()
    assert "core: numpy (the compiled core is not installed" in run("info", "--version").stdout
    ran = run("decode", FILE, "numpy.png", "--bit-depth", 16)
    assert ran.returncode == 0, ran.stderr
    own, numpy = (
        pixels.read((tmp_path / n).read_bytes()).astype(int) for n in ("own.png", "numpy.png")
    )
    assert np.abs(own - numpy).max() <= 257
