"""Pictures with a layer that gets a texture, and a plug-in that is a mixture of Gaussians."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec import plugins
from tests.support.guides import Mixture, mixture_guide
from tests.support.pictures import disc, smooth

MODES = [[0.9, 0.2, 0.1], [0.1, 0.3, 0.8], [0.5, 0.9, 0.4]]
"""Colours of the modes of the mixture."""

COLUMNS, ROWS = 101, 75


@pytest.fixture(scope="session")
def pictures():
    """A picture of 101 x 75 pixels with the layers back and disc, with each coder."""
    masks = {"disc": disc(COLUMNS, ROWS)}
    return {
        coder: pxi.encode(smooth(COLUMNS, ROWS), masks=masks, effort=1, texture=coder)
        for coder in ("pyramid", "implicit")
    }


@pytest.fixture
def mixture(monkeypatch):
    """The guide ``mixture``, whose prompts are the numbers of its modes."""

    def guide(wishes):
        settings = wishes.settings
        guidance = 1.0 if settings.guidance is None else settings.guidance
        return mixture_guide(MODES, int(settings.prompt), guidance, settings.weighting)

    find = plugins.find
    monkeypatch.setattr(
        plugins, "find", lambda kind, name: guide if kind == "guides" else find(kind, name)
    )
    return Mixture


@pytest.fixture
def colour_of():
    """Mean colour [3] in 0..1 of the pixels of a layer that lie 3 pixels inside of its outline."""
    from tests.support.edits import covered, grown

    def mean(image, name):
        inside = ~grown(~covered(image, name), 3)
        return image.render(dtype=np.float32)[inside].mean(0)

    return mean
