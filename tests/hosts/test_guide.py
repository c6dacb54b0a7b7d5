"""The programs of the guide run in the programs that they are for."""

import http.client
import importlib.util
import io
import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.support.files import SMALL
from tests.support.paths import ROOT

PAGE = (ROOT / "docs/guide/hosts.md").read_text("utf-8")
PROGRAMS = dict(re.findall(r"```python title=\"(.*?)\"\n(.*?)```", PAGE, re.S))
MODULES = re.compile(r"^(?:import|from) (\w+)", re.M)


def program(name):
    """Text of a program; its test is skipped if a package is missing."""
    text = PROGRAMS[name]
    needed = {*MODULES.findall(text)} - {"proxyimg_codec"}
    needed |= {"fsspec"} if "memory://" in text else set()
    needed |= {"cv2", "torch"} if "effort" in text else set()
    absent = [module for module in sorted(needed) if importlib.util.find_spec(module) is None]
    if absent:
        pytest.skip(f"not installed: {', '.join(absent)}")
    return text


@pytest.fixture
def folder(tmp_path):
    """A folder with photo.pxi."""
    shutil.copy(SMALL, tmp_path / "photo.pxi")
    return tmp_path


def start(text, folder):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", text],
        cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("convert.py", "['back', 'bar', 'disc']\n"),
        ("resample.py", "(48, 64, 3) ['back', 'bar', 'disc']\n(36, 48, 3) (48, 64, 4)\n"),
        ("contact.py", "(24, 96, 3)\n"),
        ("files.py", "True\n"),
    ],
)
def test_programs(name, said, folder):
    process = start(program(name), folder)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert out == said
    if name == "convert.py":
        assert {"thumbnail.jpg", "again.pxi"} < set(os.listdir(folder))


def test_programs_are_short():
    assert set(PROGRAMS) == {
        "convert.py", "resample.py", "notebook", "thumbnails.py", "contact.py", "files.py"
    }  # fmt: skip
    for name, text in PROGRAMS.items():
        lines = [line for line in text.splitlines() if line.strip()]
        assert len(lines) <= (16 if name == "thumbnails.py" else 10), name


def test_the_server_serves(folder):
    image = pytest.importorskip("PIL.Image")
    text = program("thumbnails.py")
    address, run = '("127.0.0.1", 8000)', ".serve_forever()"
    assert address in text
    said = "print(server.server_port, flush=True)"
    text = text.replace(address, '("127.0.0.1", 0)').replace("\nThreading", "\nserver = Threading")
    text = text.replace(run, f"\n{said}\nserver{run}")
    process = start(text, folder)
    try:
        port = int(process.stdout.readline())
        for _ in range(3):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
            connection.request("GET", "/photo.pxi")
            answer = connection.getresponse()
            assert answer.status == 200
            with image.open(io.BytesIO(answer.read())) as jpeg:
                assert (jpeg.format, jpeg.size) == ("JPEG", (64, 48))
            connection.close()
    finally:
        process.kill()
        process.communicate()


def test_the_notebook_shows_the_picture_in_a_shell(folder, monkeypatch):
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    capture = pytest.importorskip("IPython.utils.capture")
    monkeypatch.chdir(folder)
    shell = interactive.InteractiveShell.instance()
    with capture.capture_output() as got:
        assert shell.run_cell(program("notebook")).success
    interactive.InteractiveShell.clear_instance()
    assert got.stdout.split("\n")[0].endswith("] back")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_the_notebook_shows_the_picture_in_a_notebook(folder, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    path = os.pathsep.join([str(ROOT), *sys.path])
    monkeypatch.setenv("PYTHONPATH", path)
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(program("notebook"))])
    nbclient.NotebookClient(book, resources={"metadata": {"path": str(folder)}}).execute()
    (shown,) = [v for v in book.cells[0].outputs if v.output_type == "execute_result"]
    assert set(shown.data) == {"image/png", "text/plain"}
    assert shown.metadata["image/png"] == {"width": 64, "height": 48}
