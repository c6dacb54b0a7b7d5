"""A small data folder, and runs of `pxi-bench paper` in this process."""

import pytest

from proxyimg_codec.bench import workers
from proxyimg_codec.bench.paper import items
from proxyimg_codec.io import raster
from tests.support.paper import TINY
from tests.support.pictures import smooth


@pytest.fixture
def data(tmp_path):
    folder = tmp_path / "data"
    (folder / "kodak").mkdir(parents=True)
    for name, (width, height) in (("a", (37, 41)), ("b c", (50, 45))):
        raster.write(folder / "kodak" / f"{name}.png", smooth(width, height))
    return folder


@pytest.fixture
def here(monkeypatch):
    """Measures in this process, with little effort."""
    monkeypatch.setattr(workers, "run", lambda work, tasks, jobs, finished: [
        finished(work(task)) for task in tasks])  # fmt: skip
    monkeypatch.setattr(items, "QUICK", TINY)
