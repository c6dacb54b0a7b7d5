"""Whole files are written at once or not at all."""

import errno
import os
import stat
from concurrent.futures import ThreadPoolExecutor

import pytest

from proxyimg_codec.errors import InputError
from proxyimg_codec.io import files
from proxyimg_codec.io.files import read_bytes, write_atomically


def full(*args, **kwargs):
    raise OSError(errno.ENOSPC, "No space left on device")


def mode(path):
    return stat.S_IMODE(os.stat(path).st_mode)


@pytest.mark.parametrize("step", ["fsync", "chmod", "replace"])
def test_a_failed_write_keeps_the_old_file_and_leaves_nothing_else(tmp_path, monkeypatch, step):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with monkeypatch.context() as patch:
        patch.setattr(files.os, step, full)
        with pytest.raises(InputError, match=r"a\.bin: cannot be written: No space left"):
            write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.bin"]
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["a.bin"]


def test_an_interrupt_leaves_nothing_either(tmp_path, monkeypatch):
    def interrupt(fd):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "a.bin", b"new")
    assert os.listdir(tmp_path) == []


def test_places_that_take_no_file(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    for path in (tmp_path / "missing" / "a.bin", tmp_path / "file" / "a.bin", tmp_path):
        with pytest.raises(InputError, match="cannot be written"):
            write_atomically(path, b"new")
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match=r"a\.bin: cannot be written: Permission denied"):
            write_atomically(path, b"new")
    finally:
        tmp_path.chmod(0o700)
    assert path.read_bytes() == b"old"


@pytest.fixture(params=[0o000, 0o022, 0o027, 0o077], ids=oct)
def umask(request):
    """A umask that is set, after which nobody may set any: it belongs to all threads."""
    old = os.umask(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.delattr(os, "umask")
        yield request.param
    os.umask(old)


def test_permissions_follow_the_umask(tmp_path, umask):
    write_atomically(tmp_path / "a.bin", b"")
    assert mode(tmp_path / "a.bin") == 0o666 & ~umask


@pytest.mark.parametrize("old", [0o400, 0o604, 0o666])
def test_a_replaced_file_keeps_its_permissions(tmp_path, monkeypatch, umask, old):
    path, seen, fsync = tmp_path / "a.bin", [], os.fsync
    path.write_bytes(b"old")
    path.chmod(old)

    def noted(fd):
        seen.append(mode(fd))
        fsync(fd)

    monkeypatch.setattr(files.os, "fsync", noted)
    write_atomically(path, b"new")
    assert mode(path) == old
    assert seen[0] & ~old == 0  # nobody else could read it meanwhile
    assert path.read_bytes() == b"new"


def test_many_threads_write_at_once(tmp_path, umask):
    texts = [bytes([k]) * 70_001 for k in range(8)]

    def work(k):
        for n in range(9):
            write_atomically(tmp_path / f"{k}-{n}", texts[k])
            write_atomically(tmp_path / "one", texts[k])

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))
    assert len(os.listdir(tmp_path)) == 73
    assert {mode(p) for p in tmp_path.iterdir()} == {0o666 & ~umask}
    assert all(p.read_bytes() == texts[int(p.name[0])] for p in tmp_path.glob("?-?"))
    assert read_bytes(tmp_path / "one") in texts


def test_the_longest_names_work(tmp_path):
    path = tmp_path / ("x" * 255)
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_a_link_stays_a_link(tmp_path):
    real, link = tmp_path / "real", tmp_path / "link"
    real.write_bytes(b"old")
    link.symlink_to("real")
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"


def test_a_device_is_not_replaced_by_a_file():
    write_atomically(os.devnull, b"new")
    assert not os.path.isfile(os.devnull)


def test_standard_streams(monkeypatch, capsysbinary):
    write_atomically("-", b"\0\xff")
    assert capsysbinary.readouterr().out == b"\0\xff"
    for name in ("stdin", "stdout"):
        monkeypatch.setattr(files.sys, name, None)
    with pytest.raises(InputError, match="standard output: cannot be written"):
        write_atomically("-", b"")
    with pytest.raises(InputError, match="standard input: cannot be read"):
        read_bytes("-")


def test_unreadable_files_are_named(tmp_path):
    for path, why in [(tmp_path / "missing", "No such file"), (tmp_path, "Is a directory")]:
        with pytest.raises(InputError, match=f"{path}: cannot be read: {why}"):
            read_bytes(path)
