"""Folders and patterns as inputs."""

import os
from pathlib import Path

import pytest

from proxyimg_codec.cli import decode, encode
from proxyimg_codec.cli.batch.inputs import is_pattern, pairs
from proxyimg_codec.errors import InputError, UsageError


@pytest.fixture(autouse=True)
def texts(tmp_path, monkeypatch):
    """Texts in folders."""
    monkeypatch.chdir(tmp_path)
    for name in ("in/b.txt", "in/a10.txt", "in/a9.txt", "in/sub/deep/a.txt", "in/sub/b.txt",
                 "in/other.png", "in/.hidden.txt", "in/.git/c.txt", "in/out/old.txt", "[1].txt",
                 "c.txt"):  # fmt: skip
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(name)


def found(*files, out="out/", stacks=False):
    got = pairs(list(files), out, ".out", lambda name: name.endswith(".txt"), stacks)
    return [tuple(str(v).replace(os.sep, "/") for v in pair) for pair in got]


def test_a_folder_is_mirrored_in_natural_order():
    want = ["a9", "a10", "b", "out/old", "sub/b", "sub/deep/a"]
    # Digits come before letters, and files where they stand among folders.
    assert found("in") == [(f"in/{v}.txt", f"out/{v}.txt.out") for v in want]
    assert found("in/") == [(f"in/{v}.txt", f"out/{v}.txt.out") for v in want]


def test_outputs_are_no_inputs():
    names = [source for source, _ in found("in", out="in/out/")]
    assert "in/out/old.txt" not in names
    assert "in/b.txt" in names


def test_patterns():
    assert found("in/a*.txt") == [(f"in/{v}.txt", f"out/{v}.txt.out") for v in ("a9", "a10")]
    deep = ["out/old", "sub/b", "sub/deep/a"]
    both = [v for v in found("in/**/*.txt") if v[0].count("/") > 1]
    assert both == [(f"in/{v}.txt", f"out/{v}.txt.out") for v in deep]
    assert found("*.txt", out="in") == [(v, f"in/{v}.out") for v in ("[1].txt", "c.txt")]
    absolute = found(f"{os.getcwd()}/in/s*/*.txt")
    assert absolute == [(f"{os.getcwd()}/in/sub/b.txt", "out/sub/b.txt.out")]


def test_a_name_with_brackets_is_a_name_if_it_is_there():
    assert not is_pattern("[1].txt")
    assert found("[1].txt") == [("[1].txt", "out/[1].txt.out")]
    assert not is_pattern("none*.txt")
    assert found("none*.txt") == [("none*.txt", "out/none*.txt.out")]


@pytest.mark.parametrize(
    ("files", "out", "error", "told"),
    [
        (["in/*.txt"], None, UsageError, "several files"),
        (["c.txt", "in/*.txt"], None, UsageError, "several files"),
        (["in"], "out.png", UsageError, "write -o out.png/"),
        (["in/.git", "in/sub/.."], "out/", InputError, "no picture"),
        (["in", "in/b.txt"], "out/", UsageError, "would both become"),
        (["in", "-"], "out/", UsageError, "standard input"),
    ],
)
def test_what_cannot_be(files, out, error, told):
    if "no picture" in told:
        os.remove("in/.git/c.txt")
    with pytest.raises(error, match=told):
        found(*files, out=out)


def test_a_folder_is_one_input_where_it_is_a_stack():
    assert found("in/sub", stacks=True) == [("in/sub", "out/sub.out")]
    assert found("in/*", stacks=True)[-1] == ("in/sub", "out/sub.out")


def test_what_tools_take_of_a_folder():
    names = ["a.png", "a.JPG", "a.ora", "a.psd", "a.pxi", "a.svg", "a.txt", "Thumbs.db", "a"]
    assert [v for v in names if encode.takes(v)] == ["a.png", "a.JPG", "a.ora", "a.psd"]
    assert [v for v in names if decode.takes(v)] == ["a.pxi"]
