"""The same on a Dask cluster of two workers, one of which is killed in the middle."""

import shutil
import socket
from pathlib import Path

import pytest

from tests.cli.batch.test_batch import FIVE, outputs, states
from tests.support.files import SMALL

distributed = pytest.importorskip("distributed", reason="distributed is not installed")


@pytest.fixture(scope="module")
def cluster():
    """Address of a cluster of two processes."""
    options = {"dashboard_address": ":0", "host": "127.0.0.1", "scheduler_port": 0}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as found:
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


def test_a_cluster_without_workers_is_named(texts, copy, monkeypatch):
    from proxyimg_codec.cli.batch import on_dask

    monkeypatch.setattr(on_dask, "PATIENCE", 1)
    options = {"dashboard_address": ":0", "host": "127.0.0.1", "scheduler_port": 0}
    texts(a="one", b="two")
    with distributed.LocalCluster(n_workers=0, **options) as found:
        err, _ = copy("in", "-o", "out/", "--dask", found.scheduler_address, code=3)
    assert "has no workers" in err
