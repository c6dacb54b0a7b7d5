"""Positions of layers in a row of edits are those of the picture before the first of them."""

import json

import pytest

import proxyimg_codec as pxi
from proxyimg_codec.edit.script import Row
from proxyimg_codec.errors import UsageError


@pytest.fixture
def image(small_pxi):
    return pxi.open(small_pxi)  # back, bar and disc


def names(image):
    return [layer.name for layer in image.layers]


def op(op, layer, **values):
    return {"op": op, "layer": layer, **values}


@pytest.mark.parametrize(
    ("before", "name"),
    [
        ([op("remove", 1)], "disc"),
        ([op("order", "disc", to=1)], "disc"),
        ([op("order", 2, to="back"), op("order", 1, to="front")], "disc"),
        ([op("duplicate", 1), op("duplicate", "back", name="a")], "disc"),
        ([op("rename", 2, name="sun")], "sun"),
        ([op("rename", 2, name="sun"), op("rename", 1, name="disc")], "sun"),
        ([op("rename", -1, name="x"), op("rename", 1, name="disc"), op("rename", 2, name="bar")],
         "bar"),
        ([{"op": "group", "layers": [1, 2], "name": "g"}], "disc"),
        ([op("parent", 2, to=1)], "disc"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("position", [2, -1])
def test_a_position_stays_with_its_layer(image, before, name, position):
    edited = image.edited(*before, op("move", position, by=[3, 4]))
    assert [v.name for v in edited.layers if v.pose.shift != (0, 0)] == [name]
    assert edited == image.edited(*before).edited(op("move", name, by=[3, 4]))


def test_history_has_names(image):
    edited = image.edited(
        op("texture", 2, source=1), op("parent", -1, to=0),
        {"op": "group", "layers": [0, "disc"], "name": "g"},
    )  # fmt: skip
    assert [json.loads(step.operation) for step in edited.history] == [
        {"op": "texture", "layer": "disc", "source": "bar"},
        {"op": "parent", "layer": "disc", "to": "back"},
        {"op": "group", "layers": ["back", "disc"], "name": "g"},
    ]


def test_a_layer_that_is_gone_is_not_another_of_its_name_or_place(image):
    gone = op("remove", 1), op("hide", 1)
    for edits in (gone, (gone[0], op("rename", 2, name="bar"), gone[1])):
        with pytest.raises(UsageError, match="layer 1, which was 'bar', is gone"):
            image.edited(*edits)


@pytest.mark.parametrize("position", [3, -4, 99])
def test_positions_that_there_were_not(image, position):
    with pytest.raises(UsageError, match=f"edit 2: there is no layer {position}; .*'disc'"):
        image.edited(op("duplicate", 1), op("hide", position))


def test_a_position_is_accepted_wherever_a_name_is(image):
    disc, bar = image.layers["disc"], image.layers["bar"]
    assert disc.textured(1) == disc.textured("bar")
    assert disc.with_parent(1) == disc.with_parent("bar")
    assert disc.with_parent(0).layers["disc"].parent == "back"
    assert bar.with_parent(None) == bar.with_parent("")
    with pytest.raises(UsageError, match="no layer 7"):
        disc.textured(7)


def test_undo_brings_a_position_back(image):
    row = Row(image.picture)
    row.apply(op("rename", 2, name="sun"))
    row.apply(op("remove", 1))
    row.undo(2)
    for position, name in ((1, "bar"), (2, "disc")):
        row.apply(op("move", position, by=[1, 1]))
        assert row.picture.layers[name].pose.shift == (1024, 1024)


def test_undo_of_earlier_edits_keeps_positions(image):
    row = Row(image.layers["bar"].removed().picture)
    row.undo(1)
    row.apply(op("hide", 1))
    assert [v.name for v in row.picture.layers if v.pose.hidden] == ["disc"]


def test_a_texture_of_a_name_with_a_nul(image):
    with pytest.raises(UsageError, match="neither a layer"):
        image.layers["disc"].textured("a\0b")
