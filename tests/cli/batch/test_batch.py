"""Batches: nothing is lost, nothing is done twice, whatever fails in between."""

import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path

import pytest

from proxyimg_codec.cli.batch import records
from proxyimg_codec.cli.batch.run import outcomes
from proxyimg_codec.cli.batch.work import Outcome
from tests.support.files import SMALL
from tests.support.paths import ROOT

FIVE = {"a": "one", "b": "two", "sub_c": "three", "sub_d": "four", "e": "five"}


def outputs(folder="out"):
    """Text of each output, by its name."""
    found = (v for v in Path(folder).rglob("*.out") if records.FOLDER not in v.parts)
    return {v.name.removesuffix(".txt.out"): v.read_text() for v in found}


def states(lines):
    return [(Path(v["input"]).stem, v["state"]) for v in lines]


@pytest.mark.parametrize("jobs", [1, 2])
def test_all_are_made_and_told_in_order(texts, copy, jobs):
    texts(**FIVE)
    err, lines = copy("in", "-o", "out/", jobs=jobs)
    assert outputs() == {"a": "ONE", "b": "TWO", "c": "THREE", "d": "FOUR", "e": "FIVE"}
    assert states(lines) == [(v, "made") for v in "abecd"]
    said = [Path(line.split(": ")[0]).name for line in err.splitlines()]
    assert said[:-1] == [f"{v}.txt.out" for v in "abecd"]
    assert err.splitlines()[-1].startswith("out/: 5 made, 0 up to date, 0 failed, ")
    assert lines[0]["length"] == 3
    assert {(v["error"], v["exit_code"], *v["warnings"]) for v in lines} == {("", 0)}


@pytest.mark.parametrize("jobs", [1, 2])
def test_failures_are_collected_and_the_others_are_made(texts, copy, jobs):
    texts(**{**FIVE, "b": "fails", "sub_c": "a bug"})
    words = ("none.txt", "in", "-o", "out/")
    err, lines = copy(*words, code=3, lines=3, jobs=jobs)
    assert set(outputs()) == {"a", "d", "e"}
    names = [Path(v.split(": ")[1]).as_posix() for v in err.splitlines()]
    assert names == ["none.txt", "in/b.txt", "in/sub/c.txt"]
    assert [v["exit_code"] for v in lines] == [3, 0, 3, 0, 1, 0]
    assert "ZeroDivisionError" in lines[4]["error"]
    texts(b="mended", sub_c="mended")
    _, lines = copy("in", "-o", "out/", "--resume", jobs=jobs)
    assert states(lines) == [
        ("a", "same"), ("b", "made"), ("e", "same"), ("c", "made"), ("d", "same")
    ]  # fmt: skip


def test_resuming_makes_what_is_new_changed_or_gone(texts, copy, traced):
    texts(**FIVE)
    copy("in", "-o", "out/")
    os.remove("trace")
    texts(b="changed", f="new")
    os.remove("out/sub/c.txt.out")
    os.utime("in/a.txt", (1, 1))
    _, lines = copy("in", "-o", "out/", "--resume")
    assert traced("end") == ["b.txt", "c.txt", "f.txt"]
    assert states(lines) == [("a", "same"), ("b", "made"), ("e", "same"), ("f", "made"),
                             ("c", "made"), ("d", "same")]  # fmt: skip
    assert outputs()["b"] == "CHANGED"
    assert lines[0]["length"] == 3
    _, lines = copy("in", "-o", "out/", "--resume", "--ending", "x")
    assert {v["state"] for v in lines} == {"made"}
    assert outputs()["a"] == "xONE"


def test_resuming_replaces_nothing_that_is_not_its_own(texts, copy):
    texts(a="one", b="two", c="three")
    os.mkdir("out")
    Path("out/a.txt.out").write_text("of somebody")
    copy("in", "-o", "out/", "--resume", code=3)
    Path("out/b.txt.out").write_text("changed by hand")
    texts(b="two too", c="three too")
    err, _ = copy("in", "-o", "out/", "--resume", code=3, lines=2)
    assert all("exists already" in line for line in err.splitlines())
    assert outputs() == {"a": "of somebody", "b": "changed by hand", "c": "THREE TOO"}
    copy("in", "-o", "out/", "--resume", "--force")
    assert outputs() == {"a": "ONE", "b": "TWO TOO", "c": "THREE TOO"}


def test_without_resume_nothing_is_replaced(texts, copy, traced):
    texts(a="one", b="two")
    copy("in", "-o", "out/")
    err, _ = copy("in", "-o", "out/", code=3, lines=2)
    assert "--resume" in err
    assert len(traced("end")) == 2
    copy("in", "-o", "out/", "--force")
    assert len(traced("end")) == 4


def test_records_that_cannot_be_read_count_as_none(texts, copy):
    texts(a="one", b="two")
    copy("in", "-o", "out/")
    for path in Path("out", records.FOLDER).glob("*.json"):
        path.write_text(path.read_text()[:-9])
    copy("in", "-o", "out/", "--resume", code=3, lines=2)


def test_two_batches_into_one_folder(texts, copy):
    texts(a="one", b="two")
    with records.locked("out/"):
        err, lines = copy("in", "-o", "out/", "--resume", code=3)
    assert "another batch" in err
    assert not lines
    assert not outputs()
    copy("in", "-o", "out/")
    copy("in", "-o", "out/", "--resume")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("in/a.txt", "--resume"), "--resume: needs a folder"),
        (("in/a.txt", "-o", "b.out", "--dask", "tcp://x:1"), "--report: needs a folder"),
        (("in", "-o", "out/", "--dask", "tcp://x:1", "--ray"), "contradict"),
        (("in", "-o", "out/", "-j", "0"), "--jobs 0"),
        (("in", "-o", "out/", "--report", "in/a.txt", "-f"), "same file"),
    ],
)
def test_what_cannot_be_is_refused(texts, here, capsys, words, said):
    from tests.support import batches

    texts(a="one", b="two")
    more = ["--report", "r"] if "b.out" in words else []
    assert batches.main([*words, *more]) == 2
    assert said in capsys.readouterr().err
    assert Path("in/a.txt").read_text() == "one"


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_killed_process_takes_no_picture_with_it(texts, copy, traced):
    texts(**{**FIVE, "sub_d": "kills once"})
    _, lines = copy("in", "-o", "out/", jobs=2)
    assert states(lines) == [(v, "made") for v in "abecd"]
    ended = traced("end")
    assert set(ended) == {f"{v}.txt" for v in "abcde"}
    # One other may have been under way, which ends with the pool; none that was finished is here.
    assert len(ended) <= 6


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_picture_that_kills_its_process_is_named(texts, copy, traced):
    texts(**{**FIVE, "b": "always kills"})
    err, lines = copy("in", "-o", "out/", code=6, jobs=2)
    assert "in/b.txt: its process was killed" in err
    assert states(lines)[1] == ("b", "failed")
    assert set(traced("end")) == {f"{v}.txt" for v in "acde"}


def environment():
    """Variables for a process that imports what this one does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}


def started(*words):
    """A batch in a process of its own."""
    command = [sys.executable, "-m", "tests.support.batches", *words]
    return subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True)


def until(found):
    """Waits for something that another process does."""
    for _ in range(3000):
        if found():
            return
        time.sleep(0.02)
    raise AssertionError("it did not happen")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGKILL"])
def test_an_ended_batch_leaves_nothing_unfinished_and_goes_on(texts, copy, traced, name):
    texts(**{**FIVE, "b": "waits", "sub_c": "also waits"})
    process = started("in", "-o", "out/", "-j", "2", "--report", "r.jsonl")
    until(lambda: len(list(Path("out").rglob(".pxi-stage"))) == 2 and len(traced("end")) == 2)
    process.send_signal(getattr(signal, name))
    err = process.communicate(timeout=60)[1]
    code = {"SIGTERM": 143, "SIGINT": 130, "SIGKILL": -signal.SIGKILL}[name]
    assert process.returncode == code, err
    assert "Traceback" not in err
    until(lambda: not list(Path("out").rglob(".pxi-stage")))
    assert set(outputs()) == {"a", "e"}
    Path("trace.go").touch()

    _, lines = copy("in", "-o", "out/", "--resume")
    made = {"a": "same", "e": "same", "b": "made", "c": "made", "d": "made"}
    assert dict(states(lines)) == made
    assert traced("end") == [f"{v}.txt" for v in "abcde"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_ends_a_batch_of_one_process_and_nothing_half_found_counts(texts, copy, traced):
    texts(**{**FIVE, "b": "waits"})
    process = started("in", "-o", "out/", "-j", "1")
    until(lambda: list(Path("out").rglob(".pxi-stage")))
    process.send_signal(signal.SIGINT)
    err = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert err.splitlines()[-1] == "pxi-test: interrupted"
    assert set(outputs()) == {"a"}
    Path("trace.go").touch()
    copy("in", "-o", "out/", "--resume")
    assert outputs()["b"] == "WAITS"
    assert traced("end") == [f"{v}.txt" for v in "abcde"]


def test_no_more_jobs_are_out_than_the_pool_takes():
    out = []

    class Pool:
        width, lone_retry, closed = 3, False, None
        most = 0

        def submit(self, job):
            future = Future()
            out.append((job, future))
            Pool.most = max(Pool.most, len(out))
            if len(out) == self.width:  # the last that was handed out is done first
                place, done = out.pop()
                done.set_result(Outcome(place, "made"))
            return future

        def close(self, ended):
            Pool.closed = ended

    flow = outcomes(iter(range(9)), Pool())
    first = [next(flow).place for _ in range(5)]
    assert first == [2, 3, 4, 5, 6]
    assert Pool.most == 3
    flow.close()
    assert Pool.closed is True


def test_tools_take_folders(tool, here):
    os.makedirs("in/sub")
    for name in ("in/a.pxi", "in/sub/b.pxi"):
        shutil.copy(SMALL, name)
    Path("in/sub/c.pxi").write_bytes(SMALL.read_bytes()[:-9])
    words = ("in", "-o", "out/", "--width", "16", "--tolerant")
    tool("decode", *words, "--quiet", "-j", "2", code=7)
    assert {v.name for v in Path("out").rglob("*.png")} == {"a.png", "b.png", "c.png"}
    alone = tool("decode", "in/a.pxi", "-", "--width", "16").out
    assert Path("out/a.png").read_bytes() == alone
    tool("decode", *words, "--resume", "--quiet", "-j", "1", code=7, lines=0)


@pytest.mark.encoder
def test_pictures_are_encoded_alike_with_any_number_of_processes(tool, here):
    from proxyimg_codec.io.raster import write
    from tests.support.pictures import smooth

    os.mkdir("in")
    for name, width in (("a", 19), ("b", 23), ("c", 17)):
        write(f"in/{name}.png", smooth(width, 13))
    for jobs in ("1", "2"):
        words = ("in", "-o", f"out{jobs}/", "-e", "1", "--layers", "1", "-j", jobs, "--json")
        lines = tool("encode", *words).out.splitlines()
        assert len(lines) == 3
    for name in "abc":
        one, two = (Path(f"out{n}/{name}.pxi").read_bytes() for n in (1, 2))
        assert one == two
