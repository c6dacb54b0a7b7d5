"""Files that are open, buffers and URLs, in place of paths."""

import io
import mmap
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import proxyimg_codec as pxi
from tests.support.files import SMALL
from tests.support.paths import ROOT

DATA = SMALL.read_bytes()


class Failing(io.BytesIO):
    """A file whose first `good` bytes can be read or written, in pieces."""

    name = "far/away.pxi"

    def __init__(self, data=b"", good=100):
        super().__init__(data)
        self.good = good

    def read(self, size=-1):
        if size is None or size < 0 or self.tell() + size > self.good:
            raise OSError(5, "Input/output error")
        return super().read(size)

    def write(self, data):
        left = self.good - self.tell()
        if left <= 0:
            raise OSError(28, "No space left on device")
        return super().write(bytes(data)[:left])


class Unbuffered(io.BytesIO):
    """A file that takes 7 bytes at a time, as pipes and sockets do."""

    def write(self, data):
        return super().write(bytes(data)[:7])


class Wrapped:
    """A file that says nothing about how much it took."""

    def __init__(self):
        self.got = b""

    def write(self, data):
        self.got += data


BUFFERS = {
    "bytes": bytes,
    "bytearray": bytearray,
    "memoryview": memoryview,
    "part of a buffer": lambda data: memoryview(b"before" + data)[6:],
    "array": lambda data: np.frombuffer(data, np.uint8),
    "signed bytes": lambda data: memoryview(data).cast("b"),
}


@pytest.mark.parametrize("kind", BUFFERS)
def test_buffers_are_files(kind):
    assert pxi.from_bytes(BUFFERS[kind](DATA)) == pxi.open(SMALL)
    half = BUFFERS[kind](DATA[: len(DATA) // 2])
    with pytest.raises(pxi.FormatError, match="truncated"):
        pxi.from_bytes(half)


def test_a_file_mapped_into_memory_is_read():
    with open(SMALL, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        assert pxi.from_bytes(mapped) == pxi.open(SMALL)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (DATA.decode("latin-1"), "str"),
        (None, "NoneType"),
        ([1, 2], "list"),
        (np.frombuffer(DATA, np.uint8)[::2], r"shape \(\d+,\)"),
        (np.frombuffer(DATA[:512], np.uint8).reshape(16, 32), r"\(16, 32\)"),
        (np.frombuffer(DATA[:512], np.uint16), "'H'"),
        (np.zeros((), np.uint8), r"\(\)"),
    ],
)
def test_other_buffers_are_refused(data, told):
    with pytest.raises(pxi.UsageError, match=told):
        pxi.from_bytes(data)


def test_open_files_are_read_from_where_they_are_and_stay_open():
    file = io.BytesIO(b"before" + DATA)
    file.seek(6)
    assert pxi.open(file) == pxi.open(SMALL)
    assert file.read() == b""
    with open(SMALL, "rb", buffering=0) as raw:
        assert pxi.open(raw) == pxi.open(SMALL)
        assert not raw.closed


def test_open_files_are_written_where_they_are_and_stay_open():
    image = pxi.open(SMALL)
    for file in (io.BytesIO(b"before"), Unbuffered(b"before")):
        file.seek(6)
        image.save(file)
        assert file.getvalue() == b"before" + image.to_bytes()
    wrapped = Wrapped()
    image.save(wrapped)
    assert wrapped.got == image.to_bytes()


def test_paths_that_can_be_read_are_paths_and_files_that_have_one_are_files(tmp_path):
    class Path(type(tmp_path)):
        def read(self):
            raise AssertionError("it is a path")

        write = read

    pxi.open(SMALL).save(Path(tmp_path / "a.pxi"))
    assert pxi.open(Path(tmp_path / "a.pxi")) == pxi.open(SMALL)
    local = pytest.importorskip("fsspec").filesystem("file")
    with local.open(str(tmp_path / "a.pxi")) as file:
        file.seek(3)
        with pytest.raises(pxi.FormatError, match="signature"):
            pxi.open(file)


def test_files_that_fail_say_which_and_how_far():
    with pytest.raises(pxi.InputError, match=r"far/away.pxi: cannot be read: Input/output error"):
        pxi.open(Failing(DATA))
    image = pxi.open(SMALL)
    told = rf"far/away.pxi: cannot be written: No space left.*\(100 of {len(DATA)} bytes were\)"
    with pytest.raises(pxi.InputError, match=told):
        image.save(Failing())
    closed = io.BytesIO(DATA)
    closed.close()
    with pytest.raises(pxi.InputError, match=r"<BytesIO>: cannot be read: .*closed"):
        pxi.open(closed)
    with pytest.raises(pxi.InputError, match=r"<BytesIO>: cannot be written: .*closed"):
        image.save(closed)
    with pytest.raises(pxi.FormatError, match="<BytesIO>: "):
        pxi.open(io.BytesIO(DATA[:100]))


def test_files_of_text_are_refused(tmp_path):
    (tmp_path / "a.pxi").write_bytes(b"text")
    with open(tmp_path / "a.pxi") as text:
        for file in (io.StringIO("text"), text):
            with pytest.raises(pxi.UsageError, match="binary"):
                pxi.open(file)
    with pytest.raises(pxi.UsageError, match="binary"):
        pxi.open(SMALL).save(io.StringIO())


def test_urls_are_read_and_written():
    fsspec = pytest.importorskip("fsspec")
    image = pxi.open(SMALL)
    image.save("memory://pictures/a.pxi")
    assert fsspec.filesystem("memory").cat_file("/pictures/a.pxi") == DATA
    assert pxi.open("memory://pictures/a.pxi") == image
    assert pxi.open("simplecache::memory://pictures/a.pxi") == image
    with pytest.raises(pxi.InputError, match=r"memory://none\.pxi: cannot be read"):
        pxi.open("memory://none.pxi")
    with pytest.raises(pxi.InputError, match=r"nothing://a.pxi: cannot be read: .*nothing"):
        pxi.open("nothing://a.pxi")
    fsspec.filesystem("memory").pipe_file("/half.pxi", DATA[:100])
    with pytest.raises(pxi.FormatError, match=r"memory://half\.pxi: "):
        pxi.open("memory://half.pxi")


def test_a_url_of_this_machine_is_replaced_in_one_step(tmp_path):
    pytest.importorskip("fsspec")
    shutil.copy(SMALL, tmp_path / "a.pxi")
    url = (tmp_path / "a.pxi").as_uri()
    before = os.stat(tmp_path / "a.pxi").st_ino
    pxi.open(url).layers["disc"].removed().save(url)
    assert os.stat(tmp_path / "a.pxi").st_ino != before
    assert [layer.name for layer in pxi.open(url).layers] == ["back", "bar"]
    with pytest.raises(pxi.InputError, match="cannot be written"):
        pxi.open(SMALL).save((tmp_path / "no" / "a.pxi").as_uri())


def test_tools_read_urls(tool, tmp_path):
    pytest.importorskip("fsspec")
    pxi.open(SMALL).save("memory://tool.pxi")
    tool("decode", "memory://tool.pxi", tmp_path / "a.png")
    assert b"64x48" in tool("info", "memory://tool.pxi").out


def test_without_fsspec_a_url_says_what_to_install():
    code = (
        "import sys; sys.modules['fsspec'] = None\n"
        "import proxyimg_codec as pxi\n"
        "try: pxi.open('s3://bucket/a.pxi')\n"
        "except pxi.UnsupportedError as error: print(error)"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert "proxyimg-codec[hosts]" in ran.stdout, ran.stderr


@pytest.mark.parametrize("name", ["a:b.pxi", "c:\\a.pxi", "a//b.pxi", "://a.pxi", "1://a.pxi"])
def test_paths_are_no_urls(name):
    with pytest.raises(pxi.InputError, match="No such file"):
        pxi.open(name)
