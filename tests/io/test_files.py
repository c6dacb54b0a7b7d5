"""Whole files are written at once or not at all."""

import errno
import os
import stat

import pytest

from proxyimg_codec.errors import InputError
from proxyimg_codec.io import files
from proxyimg_codec.io.files import read_bytes, write_atomically


def full(*args, **kwargs):
    raise OSError(errno.ENOSPC, "No space left on device")


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


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_permissions_follow_the_umask(tmp_path, mask):
    old = os.umask(mask)
    try:
        write_atomically(tmp_path / "a.bin", b"")
        assert os.umask(mask) == mask
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "a.bin").stat().st_mode) == 0o666 & ~mask


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
