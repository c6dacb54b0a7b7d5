"""TEXR with cuts: all that is refused, and what counts."""

from dataclasses import replace

import pytest

import proxyimg_codec as pxi
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import LimitError
from proxyimg_codec.limits import Limits
from proxyimg_codec.model import Layers
from tests.support.containers import refused
from tests.support.images import changed
from tests.support.pyramids import cut_picture

CUTS = [
    (1, {"cuts": [0, 2]}, "TEXR: cuts do not ascend, lie behind, or do not exist"),
    (2, {"cuts": [1]}, "TEXR: cuts do not ascend"),
    (0, {"cuts": [2, 1]}, "TEXR: cuts do not ascend"),
    (0, {"cuts": [1, 1]}, "TEXR: cuts do not ascend"),
    (0, {"cuts": [1, 3]}, "TEXR: cuts do not ascend"),
    (0, {"cuts": [0, 1]}, "TEXR: a layer that cuts has no boundary"),
    (2, {"part": [16, 8, 31, 32]}, "TEXR: a part with cuts has not the size of the box"),
    (2, {"part": [16, 8, 32, 31]}, "TEXR: a part with cuts has not the size of the box"),
]


@pytest.mark.parametrize(("number", "values", "message"), CUTS)
def test_cuts_are_checked(made_up_planes, number, values, message):
    refused(cut_picture(), "textures", number, values, message)


def test_cuts_are_those_of_the_layer_that_has_the_texture(made_up_planes):
    """A layer that shares a view may lie elsewhere, and have no boundary."""
    image = cut_picture()
    disc = image.layers["disc"]
    image = changed(image, info=None, layers=Layers([*image.layers, changed(disc, name="twin")]))
    c = parse(image.to_bytes())
    other = {**c.layers[3], "box": [0, 0, 9, 9], "unit": 0, "segments": [], "classes": b"",
             "deltas": b""}  # fmt: skip
    data = serialize(replace(c, layers=(*c.layers[:3], other)))
    again = pxi.from_bytes(data)
    assert again.layers["twin"].texture is again.layers["disc"].texture
    assert again.to_bytes() == data
    refused(image, "layers", 2, {"box": [0, 0, 9, 9]}, "TEXR: a part with cuts")


def test_a_layer_without_a_boundary_cuts_nothing(made_up_planes):
    gone = {"unit": 0, "segments": [], "classes": b"", "deltas": b""}
    refused(cut_picture(), "layers", 2, gone, "TEXR: a layer that cuts has no boundary")


def test_cuts_count(made_up_planes):
    data = cut_picture().to_bytes()
    areas = 64 * 48, 60 * 20, 32 * 32
    # Layers that cut themselves may also lose what the one or two behind them touch.
    filled, covered = sum(areas), 2 * areas[0] + (2 + 1) * areas[1] + (1 + 2) * areas[2]
    parse(data, Limits(filled=filled, covered=covered))
    for name, value in (("filled", filled - 1), ("covered", covered - 1)):
        with pytest.raises(LimitError, match=name):
            parse(data, Limits(**{name: value}))
