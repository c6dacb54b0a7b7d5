"""Pictures, files and a way to call the tools, shared by all tests."""

import importlib.util
import io
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.support import files
from tests.support.paths import DATA, ROOT, TESTS
from tests.support.pictures import disc, smooth
from tests.support.tools import Ran, one_line

# Threads of torch that wait must not spin: where other programs run too that took 7 times as long.
# Programs that tests start inherit it.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

ENCODE = ("cv2", "imagecodecs", "OpenImageIO", "onnx", "onnxruntime", "PIL", "torch", "tqdm")
"""What the extra ``encode`` installs."""

KINDS = {
    "encoder": ("encoder", ENCODE),
    "generate": ("encoder", ENCODE),
    "training": ("encoder", ENCODE),
    "benchmarks": ("encoder", ENCODE),
    "bench": ("encoder", (*ENCODE, "matplotlib")),
    "cli/test_behind_cli.py": ("encoder", ENCODE),
    "cli/test_colour_cli.py": ("encoder", ENCODE),
    "cli/test_encode_cli.py": ("encoder", ENCODE),
    "cli/test_models_cli.py": ("encoder", ENCODE),
    "cli/test_layers_cli.py": ("encoder", ENCODE),
    "studio/test_arap.py": ("browser", ()),
    "studio": ("encoder", (*ENCODE, "httpx2", "starlette", "uvicorn")),
    "test_docs.py": ("encoder", ENCODE),
    "web": ("browser", ()),
}
"""The marker of the tests of a folder or module, and the packages without which it is skipped."""

LONGEST = (
    "studio/test_clicks.py",
    "test_docs.py",
    "test_spec.py",
    "texture/test_decoding.py",
    "encoder/test_threads.py",
    "conformance/test_make.py",
    "native/test_wheel.py",
    "libpxi/test_programs.py",
    "conformance/test_faults.py",
    "generate/test_mixture.py",
    "conformance/test_package_numpy.py",
    "web/test_wasm.py",
    "web/test_js_pyramids.py",
    "web/test_js_pictures.py",
    "encoder/shapes/test_layers.py",
)
"""Modules that go first, so that in the end no worker waits for another that has one of them."""


def kind_of(path: Path) -> tuple[str | None, tuple[str, ...]]:
    """The marker and the packages of a module."""
    place = path.relative_to(TESTS)
    found = (KINDS.get(str(v)) for v in (place, *place.parents))
    return next((kind for kind in found if kind), (None, ()))


def lacking(packages: Sequence[str]) -> str | None:
    """Why tests that need some packages are skipped, or None if all are here."""
    absent = [name for name in packages if importlib.util.find_spec(name) is None]
    return f"not installed: {', '.join(absent)}" if absent else None


class Skipped(pytest.Module):
    """A module that is not even imported."""

    def collect(self):
        pytest.skip(lacking(kind_of(self.path)[1]))


def pytest_pycollect_makemodule(module_path, parent):
    if lacking(kind_of(module_path)[1]):
        return Skipped.from_parent(parent, path=module_path)
    return None


def pytest_collection_modifyitems(items):
    """Marks tests by where they lie and what they use, and puts the longest modules first."""
    places = {str(TESTS / place): number for number, place in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(str(item.path), len(places)))
    reason = lacking(ENCODE)
    for item in items:
        marker = kind_of(item.path)[0]
        if marker:
            item.add_marker(marker)
        if "data_dir" in item.fixturenames:
            item.add_marker("data")
        if reason and item.get_closest_marker("encoder"):
            item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture
def photo() -> np.ndarray:
    """uint8 [40, 48, 3]: a smooth picture with an object."""
    return smooth(48, 40)


@pytest.fixture
def rgba_photo() -> np.ndarray:
    """uint8 [40, 48, 4]: the object alone, with hard alpha."""
    return np.dstack([smooth(48, 40), 255 * disc(48, 40).astype(np.uint8)])


@pytest.fixture(scope="session")
def small_masks() -> dict[str, np.ndarray]:
    """bool [48, 64]: two masks that do not touch."""
    return files.masks()


@pytest.fixture(scope="session")
def small_pxi(tmp_path_factory) -> Path:
    """A copy of a file of 64x48 pixels with the layers back, bar and disc."""
    return Path(shutil.copy(files.SMALL, tmp_path_factory.mktemp("small")))


@pytest.fixture(scope="session")
def moving_pxi(tmp_path_factory) -> Path:
    """A copy of a file of the same size and layers, of which the last two move."""
    return Path(shutil.copy(files.MOVING, tmp_path_factory.mktemp("moving")))


@pytest.fixture
def made_up_planes(monkeypatch) -> None:
    """Planes of files have the samples that `tests.pyramids` makes up, whatever they hold."""
    from proxyimg_codec.texture import planes
    from tests.support import pyramids

    monkeypatch.setattr(planes, "unpack", pyramids.unpacked)


@pytest.fixture
def pyramid(made_up_planes):
    """A picture of 64x48 pixels with the layers back, bar and disc, all views of one raster."""
    from tests.support import pyramids

    return pyramids.picture()


@pytest.fixture
def plain_maps(monkeypatch) -> None:
    """Maps of pictures are those of `tests.support.maps`, not of the network."""
    from proxyimg_codec.encoder.shapes import pointing
    from tests.support import maps

    monkeypatch.setattr(pointing, "find_maps", maps.plain)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of shared test pictures next to the checkout."""
    if not DATA.is_dir():
        pytest.skip("the shared pictures are not here")
    return DATA


@pytest.fixture
def tool(capsysbinary, monkeypatch):
    """Calls a tool in this process: tool("decode", "a.pxi", "-", code=0, stdin=b"") -> `Ran`.

    Whatever happens there is no traceback, and an error is one line that starts with the program;
    `lines` of them if several inputs fail.
    """

    def call(name: str, *args, code: int = 0, stdin: bytes = b"", lines: int = 1) -> Ran:
        main = importlib.import_module(f"proxyimg_codec.cli.{name}").main
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin)))
        capsysbinary.readouterr()
        try:
            got = main([str(a) for a in args])
        except SystemExit as stop:  # argparse
            got = stop.code
        out, err = capsysbinary.readouterr()
        text = err.decode()
        assert got == code, text
        if code:
            one_line(f"pxi-{name}", text, lines)
        return Ran(got, out, text)

    return call


@pytest.fixture
def launch():
    """Runs a launcher of bin/ in a process of its own: launch("info", "a.pxi", code=0) -> `Ran`.

    `first` are commands of the shell that starts it, such as ``ulimit``; `options` go to `run`.
    """

    def call(name: str, *args, code: int | tuple[int, ...] = 0, first: str = ":", **options) -> Ran:
        command = [
            "sh",
            "-c",
            f'{first}; exec "$@"',
            "sh",
            sys.executable,
            ROOT / "bin" / f"pxi-{name}",
            *map(str, args),
        ]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
        ran = subprocess.run(command, timeout=60, **pipes)
        text = ran.stderr.decode()
        assert ran.returncode in (code if isinstance(code, tuple) else (code,)), text
        if ran.returncode:
            one_line(f"pxi-{name}", text)
        return Ran(ran.returncode, ran.stdout, text)

    return call


@pytest.fixture
def check_error():
    """`one_line`, for tests that start a tool by themselves."""
    return one_line
