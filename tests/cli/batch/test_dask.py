"""The same on a Dask cluster of two workers, one of which is killed in the middle."""

import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.batch.test_batch import FIVE, environment, outputs, started, states, until
from tests.support.files import SMALL

dask = pytest.importorskip("dask", reason="dask is not installed")
distributed = pytest.importorskip("distributed", reason="distributed is not installed")


CLUSTER = """
import time
from distributed import LocalCluster
options = {"dashboard_address": ":0", "host": "127.0.0.1", "threads_per_worker": 1}
if __name__ == "__main__":
    with LocalCluster(n_workers=1, **options) as found:
        print(found.scheduler_address, flush=True)
        time.sleep(600)
"""


@pytest.fixture(scope="module")
def cluster():
    """Address of a cluster of two processes."""
    options = {"dashboard_address": ":0", "host": "127.0.0.1", "scheduler_port": 0}
    patience = {"distributed.scheduler.allowed-failures": 1}
    with (
        dask.config.set(patience),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as found,
    ):
        yield found.scheduler_address


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_repeats_nothing_finished(cluster, texts, copy, traced):
    texts(**{**FIVE, "sub_c": "kills once"})
    trace = ("--trace", str(Path("trace").absolute()), "--dask", cluster)
    _, lines = copy("in", "-o", "out/", *trace)
    assert outputs() == {"a": "ONE", "b": "TWO", "c": "KILLS ONCE", "d": "FOUR", "e": "FIVE"}
    assert states(lines) == [(v, "made") for v in "abecd"]
    assert traced("begin").count("c.txt") == 2
    assert traced("end") == [f"{v}.txt" for v in "abcde"]
    _, lines = copy("in", "-o", "out/", "--resume", *trace)
    assert {v["state"] for v in lines} == {"same"}
    assert len(traced("end")) == 5


@pytest.mark.slow
def test_a_picture_that_kills_every_worker_is_named_and_the_others_are_made(
    cluster, texts, copy, traced
):
    texts(**{**FIVE, "b": "always kills"})
    trace = ("--trace", str(Path("trace").absolute()), "--dask", cluster)
    err, _ = copy("in", "-o", "out/", *trace, code=6)
    assert "in/b.txt" in err
    assert traced("end") == [f"{v}.txt" for v in "acde"]


@pytest.mark.slow
def test_tools_use_it(cluster, tool, here):
    (here / "in").mkdir()
    for name in ("a", "b", "c"):
        shutil.copy(SMALL, f"in/{name}.pxi")
    (here / "in" / "d.pxi").write_bytes(b"nothing")
    words = ("in", "-o", "out/", "--width", "16", "--quiet", "--dask", cluster)
    assert "in/d.pxi" in tool("decode", *words, code=4).err
    want = tool("decode", "in/a.pxi", "-", "--width", "16").out
    assert {Path(f"out/{name}.png").read_bytes() for name in "abc"} == {want}


@pytest.mark.slow
def test_a_cluster_that_goes_is_named_and_what_is_made_stays(texts, copy, traced):
    # Without a supervisor its workers end with the scheduler.
    Path("cluster.py").write_text(CLUSTER)
    command = [sys.executable, "cluster.py"]
    texts(a="one", b="waits")
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment(), text=True) as found:
        try:
            trace = ("--trace", str(Path("trace").absolute()))
            process = started("in", "-o", "out/", "--dask", found.stdout.readline().strip(), *trace)
            until(lambda: traced("begin") == ["a.txt", "b.txt"])
        finally:
            found.kill()
    err = process.communicate(timeout=60)[1]
    assert process.returncode == 3
    assert "Traceback" not in err
    assert "pxi-test: the cluster is gone" in err.splitlines()[-1]
    Path("trace.go").touch()
    _, lines = copy("in", "-o", "out/", "--resume", *trace)
    assert states(lines) == [("a", "same"), ("b", "made")]


def test_a_cluster_that_is_not_there_is_named(texts, copy, monkeypatch):
    from proxyimg_codec.cli.batch import on_dask

    monkeypatch.setattr(on_dask, "PATIENCE", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    texts(a="one", b="two")
    for address in (f"tcp://127.0.0.1:{port}", "nothing://there", "tcp://"):
        err, _ = copy("in", "-o", "out/", "--dask", address, code=3)
        assert f"--dask {address}: there is no scheduler" in err
    assert not outputs()


@pytest.mark.slow
def test_a_cluster_without_workers_is_named(cluster, texts, copy, monkeypatch):
    def nobody(client, count, timeout):
        raise TimeoutError

    monkeypatch.setattr(distributed.Client, "wait_for_workers", nobody)
    texts(a="one", b="two")
    err, _ = copy("in", "-o", "out/", "--dask", cluster, code=3)
    assert "has no workers" in err
