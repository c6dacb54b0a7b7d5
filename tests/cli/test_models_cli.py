"""pxi-models; downloads come from a server on this machine."""

import hashlib
import http.server
import json
import threading

import pytest

from proxyimg_codec.encoder.shapes.external_models import catalogue
from proxyimg_codec.encoder.shapes.external_models.catalogue import Entry, File
from proxyimg_codec.io import raster
from tests.support import onnx_models
from tests.support.pictures import smooth

DATA = onnx_models.figures()
SUM = hashlib.sha256(DATA).hexdigest()


class Server(http.server.ThreadingHTTPServer):
    """Gives `data` as any file; `cut` bytes of it if that is set, and remembers what was asked."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.data, self.cut, self.tag, self.asked = DATA, None, '"1"', []


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        server = self.server
        server.asked.append((self.path, self.headers.get("Range")))
        if self.path == "/missing.onnx":
            self.send_error(404)
            return
        begin, data = 0, server.data
        ranged = self.headers.get("Range")
        if ranged and self.headers.get("If-Range") == server.tag:
            begin = int(ranged.removeprefix("bytes=").removesuffix("-"))
            if begin >= len(data):
                self.send_error(416)
                return
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {begin}-{len(data) - 1}/{len(data)}")
        else:
            self.send_response(200)
        self.send_header("ETag", server.tag)
        self.send_header("Content-Length", str(len(data) - begin))
        self.end_headers()
        self.wfile.write(data[begin : server.cut])

    def log_message(self, *args):
        pass


@pytest.fixture
def server():
    with Server() as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


@pytest.fixture
def cache(tmp_path, monkeypatch, server):
    """The cache folder, and a catalogue of models of the server."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("PXI_MODELS", raising=False)
    monkeypatch.setenv("no_proxy", "*")
    at = f"http://127.0.0.1:{server.server_port}"

    def known(name, sha256, purpose="saliency"):
        file = File(f"{name}.onnx", f"{at}/{name}.onnx", len(DATA), sha256)
        return Entry(name, purpose, "a test", "CC0-1.0", "https://example.org", (file,))

    models = (
        known("good", SUM),
        known("bad", "0" * 64),
        known("free", None),
        known("missing", SUM),
    )
    monkeypatch.setattr(catalogue, "ENTRIES", models)
    return tmp_path / "cache" / "proxyimg" / "models"


def test_known_models_are_listed_and_nothing_is_downloaded(tool, cache, server):
    onnx_models.write(cache / "good.onnx", DATA)
    onnx_models.write(cache / "bad.onnx", DATA)
    onnx_models.write(cache / "free.onnx", DATA)
    lines = tool("models").out.decode().splitlines()
    states = {line.split()[0]: line for line in lines if "CC0-1.0" in line}
    assert states["good"].endswith("yes, its SHA-256 is right")
    assert states["bad"].endswith("yes, but its SHA-256 is another")
    assert states["free"].endswith("yes; its SHA-256 is not known")
    assert states["missing"].endswith("no")
    facts = json.loads(tool("models", "list", "--json").out)
    assert facts == json.loads(tool("models", "--json").out)
    assert facts["folders"] == [str(cache)]
    good = facts["models"][0]
    assert good["here"] is True
    assert good["licence"] == "CC0-1.0"
    assert good["files"][0]["sha256_found"] == SUM
    assert server.asked == []


def test_downloads_are_checked(tool, cache, server):
    ran = tool("models", "get", "good")
    assert (cache / "good.onnx").read_bytes() == DATA
    assert [p.name for p in cache.iterdir()] == ["good.onnx"]
    assert f"SHA-256 {SUM}, as it should be" in ran.err
    assert "was there already" in tool("models", "get", "good").err
    assert len(server.asked) == 1
    tool("models", "get", "good", "--force", "--quiet")
    assert len(server.asked) == 2


def test_a_wrong_checksum_keeps_nothing(tool, cache):
    ran = tool("models", "get", "bad", "--quiet", code=3)
    assert f"its SHA-256 is {SUM}, not {'0' * 64}" in ran.err
    assert list(cache.iterdir()) == []


def test_an_unknown_checksum_is_shown(tool, cache, tmp_path):
    ran = tool("models", "get", "free", "--to", tmp_path / "here", "--json")
    path = tmp_path / "here" / "free.onnx"
    (file,) = json.loads(ran.out)["files"]
    assert file == {"path": str(path), "sha256": SUM, "checked": False}
    assert path.read_bytes() == DATA
    assert f"{SUM}, none is known" in tool("models", "get", "free").err


def test_an_interrupted_download_goes_on(tool, cache, server):
    server.cut = 100
    ran = tool("models", "get", "good", "--quiet", code=3)
    assert "run it again to go on" in ran.err
    assert not (cache / "good.onnx").exists()
    server.cut = None
    tool("models", "get", "good", "--quiet")
    assert server.asked[-1] == ("/good.onnx", "bytes=100-")
    assert (cache / "good.onnx").read_bytes() == DATA
    assert [p.name for p in cache.iterdir()] == ["good.onnx"]


def test_a_download_begins_again_if_the_file_has_changed(tool, cache, server):
    server.cut = 100
    tool("models", "get", "good", "--quiet", code=3)
    server.cut, server.tag = None, '"2"'
    (cache / "good.onnx.part").write_bytes(b"x" * 100)
    tool("models", "get", "good", "--quiet")
    assert (cache / "good.onnx").read_bytes() == DATA


def test_a_download_that_was_complete_is_not_stuck(tool, cache, server):
    server.cut = 100
    tool("models", "get", "good", "--quiet", code=3)
    server.cut = None
    (cache / "good.onnx.part").write_bytes(DATA)
    tool("models", "get", "good", "--quiet")
    assert (cache / "good.onnx").read_bytes() == DATA


def test_what_cannot_be_downloaded(tool, cache, server):
    assert "404" in tool("models", "get", "missing", "--quiet", code=3).err
    assert "there are good, bad" in tool("models", "get", "nobody", code=2).err
    server.shutdown()
    server.server_close()
    assert "cannot be downloaded" in tool("models", "get", "good", "--quiet", code=3).err


@pytest.mark.parametrize(
    ("made", "use"),
    [
        (onnx_models.figures, "segmenter"),
        (onnx_models.depth, "depth"),
        (onnx_models.inpainting, "background"),
    ],
)
def test_models_are_checked_by_running_them(tool, tmp_path, made, use):
    path = onnx_models.write(tmp_path / "m.onnx", made())
    out = tool("models", "check", path).out.decode()
    assert "it works" in out
    assert f"use it: pxi-encode --{use} {path}" in out
    assert hashlib.sha256(path.read_bytes()).hexdigest() in out


@pytest.mark.parametrize("name", onnx_models.SAMS)
def test_sams_are_checked(tool, tmp_path, name):
    path = onnx_models.write_sam(tmp_path, name)
    facts = json.loads(tool("models", "check", path, "--json").out)
    assert facts["purpose"] == "sam"
    assert facts["result"].startswith("a mask of 100 % of the picture, expected IoU 0.95")


def test_what_is_no_model_is_told(tool, tmp_path):
    path = onnx_models.write(tmp_path / "m.onnx", b"not a model")
    assert "is not an ONNX model" in tool("models", "check", path, code=3).err
    greedy = onnx_models.write(tmp_path / "g.onnx", onnx_models.greedy())
    assert "more memory than there is" in tool("models", "check", greedy, code=6).err
    assert "there is no model 'nobody'" in tool("models", "check", "nobody", code=2).err


def test_models_are_found_by_name_in_folders(tool, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    raster.write(tmp_path / "a.png", smooth(48, 40))
    encode = ("encode", tmp_path / "a.png", "-e", "1", "-f", "--segmenter")
    monkeypatch.setenv("PXI_MODELS", "")
    missing = tool(*encode, "u2netp", code=3)
    assert "the model u2netp (u2netp.onnx) is not here" in missing.err
    assert str(tmp_path / "cache" / "proxyimg" / "models") in missing.err
    assert "no model for sam is here" in tool(*encode, "sam", code=3).err
    onnx_models.write(tmp_path / "mine" / "u2netp.onnx", DATA)
    onnx_models.write(tmp_path / "mine" / "my_depth.onnx", onnx_models.depth())
    monkeypatch.setenv("PXI_MODELS", f"{tmp_path / 'none'}:{tmp_path / 'mine'}")
    tool(*encode, "u2netp", "--depth", "depth", "--quiet")
    tool(*encode, "saliency", "--quiet")
    contradiction = tool("encode", tmp_path / "a.png", "--layers", "1", "--depth", "depth", code=2)
    assert "--layers and --depth contradict" in contradiction.err


def test_the_real_catalogue_is_sound():
    names = [e.name for e in catalogue.ENTRIES]
    files = [f for e in catalogue.ENTRIES for f in e.files]
    assert len(set(names)) == len(names)
    assert len({f.name for f in files}) == len(files)
    for file in files:
        assert file.address.startswith("https://")
        assert file.address.endswith(f"/{file.name}")
        assert file.sha256 is None or len(bytes.fromhex(file.sha256)) == 32
    assert {e.purpose for e in catalogue.ENTRIES} == {"sam", "saliency", "depth", "inpainting"}
