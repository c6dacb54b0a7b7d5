"""Sheets of layers: what they show, at odd sizes and with odd names."""

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.export.sheet import DARK, LIGHT, TILE, Tile, draw_sheet, outline_bytes, sheet_of
from tests.support.files import SMALL
from tests.support.pictures import disc, smooth

pytest.importorskip("PIL")

LONG = "a very long name that somebody typed without thinking of how much room there would be"


def tiles(width, height, names):
    pixels = smooth(width, height)
    masks = [np.ones((height, width), bool)] + [disc(width, height)] * (len(names) - 1)
    return pixels, [
        Tile(name, np.dstack([pixels, mask * np.uint8(255)]), k)
        for k, (name, mask) in enumerate(zip(names, masks, strict=True))
    ]


def holds(sheet, picture):
    """Whether a picture is a part of a sheet, at any place."""
    h, w = picture.shape[:2]
    views = np.lib.stride_tricks.sliding_window_view(sheet[..., 0], (h, w))
    first = np.argwhere(views[..., h // 2, w // 2] == picture[h // 2, w // 2, 0])
    return any((sheet[y : y + h, x : x + w] == picture).all() for y, x in first)


def test_layers_are_shown_alone_on_a_checkerboard():
    picture, shown = tiles(61, 43, ["back", "disc"])
    sheet = draw_sheet(picture, shown)
    inside = disc(61, 43)
    y, x = np.indices(inside.shape) // 8
    checks = np.where((x + y) % 2, DARK, LIGHT)[..., None]
    assert holds(sheet, picture)
    assert holds(sheet, np.where(inside[..., None], picture, checks).astype(np.uint8))


@pytest.mark.parametrize(
    ("size", "names"),
    [
        ((1, 1), ["back"]),
        ((3, 301), ["back", "x"]),
        ((360, 7), ["back", LONG, LONG]),
        ((200, 101), ["back", "Größe é ñ", "кошка", "猫", "\u202e\x1b[2J", "x" * 200]),
        ((53, 37), [f"object {k}" for k in range(64)]),
    ],
)
def test_odd_sizes_and_names(size, names):
    picture, shown = tiles(*size, names)
    sheet = draw_sheet(picture, shown)
    assert sheet.dtype == np.uint8
    assert sheet.shape[0] * sheet.shape[1] < 1.7 * (len(names) + 1) * 400 * 420
    assert (draw_sheet(picture, shown) == sheet).all()


def test_names_and_costs_are_written():
    picture, shown = tiles(61, 43, ["back", "disc"])
    plain = draw_sheet(picture, shown)
    renamed = [shown[0], Tile("cat", shown[1].pixels, shown[1].outline)]
    dearer = [shown[0], Tile("disc", shown[1].pixels, 99)]
    assert (draw_sheet(picture, renamed) != plain).any()
    assert (draw_sheet(picture, dearer) != plain).any()


def test_a_file_has_a_tile_a_layer():
    image = pxi.open(SMALL)
    sheet = sheet_of(image)
    for layer in image.layers:
        alone = image.render(layers=[layer.name])
        if alone.shape[2] == 3:
            assert holds(sheet, alone)
    assert max(sheet.shape) < 4 * TILE
    assert outline_bytes(image.layers["disc"].boundary) > 5
    assert outline_bytes(image.layers["back"].boundary) == 0


def test_hidden_layers_are_shown_alone_but_not_in_the_picture():
    image = pxi.open(SMALL)
    hidden = image
    for layer in image.layers:
        hidden = hidden.layers[layer.name].hidden()
    assert sheet_of(hidden).shape == sheet_of(image).shape
    assert (sheet_of(image.layers["disc"].hidden()) != sheet_of(image)).any()
