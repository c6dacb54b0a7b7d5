"""The same on a Ray cluster of two cores, one of whose processes is killed in the middle."""

import os
from pathlib import Path

import pytest

from tests.cli.batch.test_batch import FIVE, outputs, states
from tests.support.paths import ROOT

ray = pytest.importorskip("ray", reason="ray is not installed")
cluster_utils = pytest.importorskip("ray.cluster_utils")

OF_RAY = ("ignore::ResourceWarning", "ignore:Tip. In future versions of Ray:FutureWarning")
"""Warnings about what Ray itself does."""

pytestmark = [pytest.mark.slow, *(pytest.mark.filterwarnings(v) for v in OF_RAY)]


@pytest.fixture(scope="module")
def cluster():
    """Address of a cluster of two nodes with a core each."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    found = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    found.add_node(num_cpus=1)
    yield found.address
    found.shutdown()


@pytest.fixture
def on_ray(cluster, monkeypatch):
    """Flags that use it."""
    monkeypatch.setenv("RAY_ADDRESS", cluster)
    return ("--trace", str(Path("trace").absolute()), "--ray")


def test_a_killed_worker_loses_nothing_and_repeats_nothing_finished(here, on_ray, texts, copy,
                                                                    traced):  # fmt: skip
    texts(**{**FIVE, "sub_c": "kills once"})
    _, lines = copy("in", "-o", "out/", *on_ray)
    assert outputs() == {"a": "ONE", "b": "TWO", "c": "KILLS ONCE", "d": "FOUR", "e": "FIVE"}
    assert states(lines) == [(v, "made") for v in "abecd"]
    assert traced("begin").count("c.txt") == 2
    assert traced("end") == [f"{v}.txt" for v in "abcde"]
    _, lines = copy("in", "-o", "out/", "--resume", *on_ray)
    assert {v["state"] for v in lines} == {"same"}


def test_a_picture_that_kills_every_worker_is_named_and_the_others_are_made(
    here, on_ray, texts, copy, traced
):
    texts(**{**FIVE, "b": "always kills"})
    err, _ = copy("in", "-o", "out/", *on_ray, code=6)
    assert "in/b.txt" in err
    assert traced("end") == [f"{v}.txt" for v in "acde"]


def test_a_cluster_that_is_not_there_is_named(texts, copy, monkeypatch):
    texts(a="one", b="two")
    monkeypatch.setenv("RAY_ADDRESS", "nowhere")
    err, _ = copy("in", "-o", "out/", "--ray", code=3)
    assert "--ray: there is no cluster at 'nowhere'" in err
