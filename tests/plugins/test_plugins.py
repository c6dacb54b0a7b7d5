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

    def entry_points(group, name=None):
        return [entry] if group == entry.group and name in (None, "halves") else []

    monkeypatch.setattr("importlib.metadata.entry_points", entry_points)


@pytest.mark.encoder
def test_added_segmenters_are_used(added):
    assert plugins.names("segmenters") == ["regions", "halves"]
    image = pxi.encode(smooth(40, 30), segmenter="halves", effort=1, jobs=1)
    assert [v.name for v in image.layers] == ["right", "left"]


@pytest.mark.encoder
def test_unknown_names_are_refused_with_the_known_ones():
    with pytest.raises(pxi.UsageError, match="regions"):
        pxi.encode(smooth(40, 30), segmenter="magic", effort=1)
