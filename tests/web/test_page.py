"""The viewer in a real browser shows what the package's decoder makes of a file."""

import base64
import functools
import http.server
import json
import shutil
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import proxyimg_codec as pxi
from conformance.cases import find
from proxyimg_codec.cli import decode
from proxyimg_codec.codec.write import to_bytes
from proxyimg_codec.io import raster
from proxyimg_codec.io.color import profile_of, to_srgb
from tests.support.paths import ROOT

HERE = Path(__file__).parent
NODE = shutil.which("node")
MODULES = HERE / "node_modules"
SCREEN = (480, 640)

needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")
needs_browser = pytest.mark.skipif(
    NODE is None or not MODULES.exists(), reason="no browser: npm install --prefix tests/web"
)


@needs_node
def test_viewport() -> None:
    command = [str(NODE), "--test", str(HERE / "viewport.test.mjs")]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves the repository as `python -m http.server` does, without a log."""

    extensions_map = http.server.SimpleHTTPRequestHandler.extensions_map | {
        ".js": "text/javascript",
    }

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def address() -> Iterator[str]:
    handler = functools.partial(Quiet, directory=str(ROOT))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/web/index.html"
        server.shutdown()
        thread.join()


def browse(address: str, *steps: tuple[str, Any]) -> list[dict[str, Any]]:
    """What the page shows after each step."""
    command = [str(NODE), str(HERE / "browser.mjs"), address, json.dumps(steps)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    answer = json.loads(ran.stdout)
    assert answer["problems"] == []
    return answer["found"]


def pixels(shown: dict[str, Any]) -> np.ndarray:
    """float [480, 640, 3 or 4]: premultiplied RGBA of the screen in 8-bit levels."""
    data = np.frombuffer(base64.b64decode(shown["pixels"]), np.uint8)
    picture = data.reshape(shown["height"], shown["width"], 4).astype(float)
    picture[..., :3] *= picture[..., 3:] / 255
    return picture


def expected(case: str, shown: dict[str, Any], tmp_path: Path, *flags: str) -> np.ndarray:
    """What the package makes of the region that the page asked for, likewise."""
    request = shown["request"]
    out = tmp_path / "out.npy"
    region = ",".join(map(str, request["region"]))
    size = ["--width", str(request["width"]), "--height", str(request["height"])]
    source = str(find(case).input)
    words = [source, str(out), "--quiet", "-f", "--bit-depth", "32", "--region", region]
    assert decode.main([*words, *size, *flags]) == 0
    picture = np.load(out).astype(float)
    result = np.full((*picture.shape[:2], 4), 255.0)
    result[..., : picture.shape[2]] = picture * 255
    result[..., :3] *= result[..., 3:] / 255
    return result


def assert_shows(shown: dict[str, Any], wanted: np.ndarray) -> None:
    """Screens store premultiplied bytes, so low alpha costs up to a level more."""
    got = pixels(shown)
    assert got.shape[:2] == SCREEN
    height, width = min(SCREEN[0], wanted.shape[0]), min(SCREEN[1], wanted.shape[1])
    error = np.abs(got[:height, :width] - wanted[:height, :width])
    assert error.max() < 1.6
    assert got[height:].max(initial=0) == 0
    assert got[:, width:].max(initial=0) == 0


@needs_browser
def test_drop_zoom_pan_and_hide(address: str, tmp_path: Path) -> None:
    name = "layers"
    source = str(find(name).input)
    twofold = -np.log(2) / 0.002
    opened, zoomed, moved, hidden = browse(
        address,
        ("drop", source),
        ("wheel", [0, 0, twofold]),
        ("drag", [300, 300, -160, -80]),
        ("toggle", "disc"),
    )
    assert opened["layers"] == ["triangle", "disc", "back"]
    assert opened["request"] == {"region": [0, 0, 32, 24], "width": 640, "height": 480}
    assert_shows(opened, expected(name, opened, tmp_path))
    assert zoomed["request"]["region"][:2] == [0, 0]
    assert 640 <= zoomed["request"]["width"] < 700
    assert_shows(zoomed, expected(name, zoomed, tmp_path))
    assert moved["request"]["region"][:2] == [4, 2]
    assert_shows(moved, expected(name, moved, tmp_path))
    others = ("--layer", "back", "--layer", "triangle")
    assert_shows(hidden, expected(name, hidden, tmp_path, *others))
    assert np.abs(pixels(hidden) - pixels(moved)).max() > 20


@needs_browser
def test_refused_file_then_pyramid(address: str, tmp_path: Path) -> None:
    bad, good = (str(find(name).input) for name in ("invalid-crc-tail", "pyramid"))
    refused, shown = browse(address, ("drop", bad), ("drop", good))
    assert refused["error"].startswith("invalid: ")
    assert "TAIL" in refused["error"]
    assert shown["error"] == ""
    assert shown["request"]["region"] == [0, 0, 24, 18]
    assert_shows(shown, expected("pyramid", shown, tmp_path))


@needs_browser
def test_motion(address: str, tmp_path: Path) -> None:
    name = "moves-loop"
    source = str(find(name).input)
    still, later, played = browse(address, ("drop", source), ("time", 0.25), ("play", None))
    assert_shows(still, expected(name, still, tmp_path))
    assert_shows(later, expected(name, later, tmp_path, "--time", "0.25"))
    assert np.abs(pixels(later) - pixels(still)).max() > 20
    assert_shows(played, expected(name, played, tmp_path, "--time", str(played["time"])))
    assert played["time"] != 0.25


@needs_browser
def test_colours_are_those_of_profiles(address: str, tmp_path: Path) -> None:
    wide = bytes([12, 13, 0, 1])  # Display P3
    pytest.importorskip("imagecodecs")
    icc = profile_of(wide)
    assert icc is not None
    image, files = pxi.open(find("layers").input), []
    for name, blocks in (("icc", {"icc": icc}), ("cicp", {"cicp": wide})):
        files.append(tmp_path / f"{name}.pxi")
        files[-1].write_bytes(to_bytes(replace(image.picture, blocks=blocks)))
    for shown in browse(address, *(("drop", str(path)) for path in files)):
        wanted = expected("layers", shown, tmp_path)
        right = 255 * to_srgb(wanted[..., :3].astype(np.float32) / 255, {"cicp": wide})
        assert np.abs(right - wanted[..., :3]).mean() > 1
        error = np.abs(pixels(shown)[..., :3] - right)
        # Browsers are less exact in the dark.
        assert error.mean() < 0.5
        assert error.max() < 7


@needs_browser
def test_fingers_keys_and_saving(address: str, tmp_path: Path) -> None:
    name = "layers"
    pinch = [[[200, 240], [440, 240]], [[80, 240], [560, 240]]]
    opened, pinched, moved, whole, saved = browse(
        address,
        ("drop", str(find(name).input)),
        ("pinch", pinch),
        ("key", "ArrowRight"),
        ("key", "0"),
        ("save", None),
    )
    assert pinched["request"]["region"] == [8, 6, 16, 12]
    assert_shows(pinched, expected(name, pinched, tmp_path))
    assert moved["request"]["region"][0] > pinched["request"]["region"][0]
    assert whole["request"] == opened["request"]
    assert saved["saved"] is not None
    (tmp_path / "saved.png").write_bytes(base64.b64decode(saved["saved"]))
    picture = raster.read(tmp_path / "saved.png").pixels.astype(float)
    wanted = expected(name, saved, tmp_path)[..., : picture.shape[2]]
    assert np.abs(picture - wanted).max() <= 1


@needs_browser
def test_element(address: str, tmp_path: Path) -> None:
    source = str(find("moves-loop").input)
    attributes = {"style": "width: 20px", "time": "0.25", "layers": "0,-1"}
    # The page waits for a file of its own before it is asked what it shows.
    _, shown = browse(address, ("drop", source), ("element", [source, attributes]))
    (tmp_path / "element.png").write_bytes(base64.b64decode(shown["saved"]))
    picture = raster.read(tmp_path / "element.png").pixels
    expected = pxi.open(source).render(width=20, t=0.25, layers=[0, -1])
    assert picture.shape[:2] == expected.shape[:2]
    assert np.abs(picture[..., :3] - expected[..., :3].astype(float)).max() <= 1
