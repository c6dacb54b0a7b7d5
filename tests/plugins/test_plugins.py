import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec import plugins
from tests.support.pictures import smooth


def left_half(rgb, max_layers, support):
    """A segmenter from elsewhere."""
    half = np.zeros(rgb.shape[:2], bool)
    half[:, : rgb.shape[1] // 2] = True
    return [pxi.Region("right", ~half), pxi.Region("left", half)]


@pytest.fixture
def added(monkeypatch):
    entry = EntryPoint("halves", f"{__name__}:left_half", "proxyimg_codec.segmenters")

    offer(monkeypatch, entry)


def offer(monkeypatch, entry):
    """Makes an entry point known as if its package were installed."""

    def entry_points(group, name=None):
        return [entry] if group == entry.group and name in (None, entry.name) else []

    monkeypatch.setattr("importlib.metadata.entry_points", entry_points)


@pytest.mark.encoder
def test_prompters_and_depth_are_kinds():
    assert "sam" in plugins.names("prompters")
    assert plugins.names("depth") == []
    assert plugins.find("prompters", "sam").__name__ == "prompted"
    with pytest.raises(pxi.UsageError, match="depth: 'x' is unknown"):
        plugins.find("depth", "x")


@pytest.mark.encoder
def test_added_segmenters_are_used(added):
    assert plugins.names("segmenters") == ["figures", "regions", "halves"]
    image = pxi.encode(smooth(40, 30), segmenter="halves", effort=1, jobs=1)
    assert [v.name for v in image.layers] == ["right", "left"]


@pytest.mark.encoder
def test_unknown_names_are_refused_with_the_known_ones():
    with pytest.raises(pxi.UsageError, match="regions"):
        pxi.encode(smooth(40, 30), segmenter="magic", effort=1)


def fails_to_import(tmp_path, monkeypatch, text):
    (tmp_path / "elsewhere.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "elsewhere", raising=False)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import nowhere_to_be_found", "needs nowhere_to_be_found"),
        ("from math import no_such_thing", "cannot be loaded"),
        ("", "cannot be loaded"),
    ],
)
@pytest.mark.parametrize("kind", ["engines", "segmenters", "meshers"])
def test_a_plugin_that_cannot_be_loaded_names_its_package(kind, text, said, tmp_path, monkeypatch):
    fails_to_import(tmp_path, monkeypatch, text)
    offer(monkeypatch, EntryPoint("mine", "elsewhere:run", f"proxyimg_codec.{kind}"))
    with pytest.raises(pxi.UnsupportedError, match=f"{kind}: 'mine' of package elsewhere {said}"):
        plugins.find(kind, "mine")


def test_rendering_says_so_too(small_pxi, tmp_path, monkeypatch):
    fails_to_import(tmp_path, monkeypatch, "import nowhere_to_be_found")
    offer(monkeypatch, EntryPoint("mine", "elsewhere:run", "proxyimg_codec.engines"))
    with pytest.raises(pxi.UnsupportedError, match="nowhere_to_be_found"):
        pxi.open(small_pxi).render(engine="mine")


def test_built_in_plugins_name_what_is_missing(monkeypatch):
    monkeypatch.setitem(plugins.BUILT_IN, "engines", {"far": "nowhere_to_be_found.at:all"})
    with pytest.raises(pxi.UnsupportedError, match="engines: far needs nowhere_to_be_found"):
        plugins.find("engines", "far")
