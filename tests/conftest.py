"""Pictures, files and a way to call the tools, shared by all tests."""

import importlib
import io
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Ran:
    """What a tool left behind: exit code, bytes on stdout and text on stderr."""

    code: int
    out: bytes
    err: str


def smooth(width: int, height: int) -> np.ndarray:
    """Smooth uint8 RGB with a red disc in the middle."""
    y, x = np.mgrid[0:height, 0:width]
    picture = np.stack(
        [60 + 100 * x / width, 80 + 120 * y / height, 120 + 60 * np.sin((x + y) / 12)], axis=2
    )
    picture[disc(width, height)] = (220, 60, 40)
    return picture.astype(np.uint8)


def disc(width: int, height: int) -> np.ndarray:
    """bool [H, W], a disc in the middle."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    return np.hypot(x - width / 2, y - height / 2) < 0.3 * min(width, height)


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
    bar = np.zeros((48, 64), bool)
    bar[38:, 4:60] = True
    return {"disc": disc(64, 48), "bar": bar}


@pytest.fixture(scope="session")
def small_pxi(tmp_path_factory, small_masks) -> Path:
    """A file of 64x48 pixels with the layers back, bar and disc."""
    pytest.importorskip("cv2")
    from proxyimg_codec import encode
    from proxyimg_codec.encoder.shapes.masks import Region

    picture = smooth(64, 48)
    picture[small_masks["bar"]] //= 2
    regions = [Region(name, small_masks[name]) for name in ("bar", "disc")]
    path = tmp_path_factory.mktemp("small") / "small.pxi"
    encode(picture, masks=regions, effort=1, jobs=1, texture="implicit").save(path)
    return path


@pytest.fixture(scope="session")
def moving_pxi(tmp_path_factory) -> Path:
    """A file of 64x48 pixels with the layers back, bar and disc, of which the last two move."""
    from tests import moving

    path = tmp_path_factory.mktemp("moving") / "moving.pxi"
    moving.picture().save(path)
    return path


@pytest.fixture
def made_up_planes(monkeypatch) -> None:
    """Planes of files have the samples that `tests.pyramids` makes up, whatever they hold."""
    from proxyimg_codec.texture import planes
    from tests import pyramids

    monkeypatch.setattr(planes, "unpack", pyramids.unpacked)


@pytest.fixture
def pyramid(made_up_planes):
    """A picture of 64x48 pixels with the layers back, bar and disc, all views of one raster."""
    from tests import pyramids

    return pyramids.picture()


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of shared test pictures next to the checkout."""
    path = Path(__file__).parents[2] / "shared" / "data"
    if not path.is_dir():
        pytest.skip("the shared pictures are not here")
    return path


def one_line(prog: str, text: str) -> None:
    """Asserts that stderr holds one line `prog: message`, after the usage if argparse refused."""
    lines = text.splitlines()
    if lines and lines[0].startswith("usage: "):
        lines = lines[-1:]
    assert len(lines) == 1, text
    assert lines[0].startswith(f"{prog}: ")
    assert len(lines[0]) > len(prog) + 10
    assert "Traceback" not in text


@pytest.fixture
def tool(capsysbinary, monkeypatch):
    """Calls a tool in this process: tool("decode", "a.pxi", "-", code=0, stdin=b"") -> `Ran`.

    Whatever happens there is no traceback, and an error is one line that starts with the program.
    """

    def call(name: str, *args, code: int = 0, stdin: bytes = b"") -> Ran:
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
            one_line(f"pxi-{name}", text)
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
