"""Planes are decoded as far as is asked for, each part once, and as they are as a whole."""

import numpy as np
import pytest

from proxyimg_codec import progress
from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel
from proxyimg_codec.texture import decoding, planes, synthesis
from proxyimg_codec.texture.grid import Grid, Window
from proxyimg_codec.texture.latents import Decoder, Latents
from proxyimg_codec.texture.planes import Planes
from tests.texture.test_planes import each, grid_of, made, needs_kernel

__all__ = ["each"]
SIZE, LEVELS, TILE, STEP = (341, 283), 3, 6, 60


def coded(tile=TILE, size=SIZE, model=2, seed=3):
    found = made(np.random.default_rng(seed), grid_of(size, LEVELS, model), 2)
    return planes.encoded(found, size, 293, number=model, tile=tile)


def again(source):
    """The same planes, of which nothing is decoded."""
    return Planes(source.packed)


@pytest.mark.usefixtures("each")
@pytest.mark.parametrize("model", [1, 2])
@pytest.mark.parametrize("tile", [0, 6, 7])
def test_windows_are_parts_of_the_whole(tile, model):
    source = coded(tile, (147, 133), model)
    whole = source.raster
    for window in (
        Window(0, 1, 0, 1), Window(132, 133, 146, 147), Window(60, 90, 100, 140),
        Window(0, 133, 127, 129), Window(127, 129, 0, 147),
    ):  # fmt: skip
        fresh = again(source)
        # Products of numpy round by their place; those of the kernel do not.
        allowed = 0 if kernel.available() else 1e-5
        found = fresh.samples(window)[window.at]
        np.testing.assert_allclose(found, whole[window.at], rtol=0, atol=allowed)
    np.testing.assert_allclose(fresh.raster, whole, rtol=0, atol=allowed)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_windows_without_levels(level):
    source = coded()
    rows, columns = source.shape(level)
    whole = source.reduced(level, Window(0, rows, 0, columns))
    assert whole.shape == (rows, columns, 3)
    window = Window(rows // 3, rows // 3 + 9, columns // 2, columns // 2 + 5)
    np.testing.assert_array_equal(again(source).reduced(level, window), whole[window.at])


def test_even_planes_keep_their_colour_without_levels():
    grid = Grid((70, 58), 3)
    lowest = np.full((3, *grid.at(3)), 40, np.int32) * np.array([[[4]], [[1]], [[-2]]])
    levels = tuple(np.zeros((9, *grid.at(k)), np.int32) for k in (1, 2, 3))
    source = planes.encoded(Latents(levels, lowest.astype(np.int32)), grid.size, 200)
    full = source.raster[20:40, 20:40].mean((0, 1))
    for level in (1, 2, 3):
        window = Window(2, 4, 2, 4)
        found = source.reduced(level, window).mean((0, 1))
        np.testing.assert_allclose(found, full, atol=0.02)


def test_a_window_reads_the_tiles_over_it(monkeypatch):
    read, source = [], coded()
    monkeypatch.setattr(Decoder, "finish", lambda self, where: read.append(self))
    source.samples(Window(0, 40, 0, 40))
    few = len(read)
    source.samples(Window(0, 40, 0, 40))
    assert len(read) == few, "nothing is read twice"
    _ = source.raster
    grid = Grid.of(source.packed)
    count = 1 + sum(len(grid.tiles(level, TILE)) for level in (1, 2, 3))
    assert len(read) == count
    assert few < 0.7 * count


def test_nothing_is_made_twice(monkeypatch):
    source, areas = again(coded()), []
    finer = synthesis.finer

    def counted(model, level, low, *rest, **more):
        areas.append(low.shape[0] * low.shape[1])
        return finer(model, level, low, *rest, **more)

    monkeypatch.setattr(synthesis, "finer", counted)
    columns, rows = SIZE
    for top in range(0, rows, 50):
        source.samples(Window(top, min(top + 50, rows), 0, columns))
    assert sum(areas) < 1.25 * columns * rows / 3
    done = len(areas)
    _ = source.raster
    assert len(areas) == done


def test_a_damaged_tile_matters_only_where_it_is():
    source = coded()
    bad = Planes({**source.packed, "data": source.packed["data"][:-2] + b"\0\0"})
    window = Window(0, 30, 0, 30)
    np.testing.assert_array_equal(bad.samples(window)[window.at], source.samples(window)[window.at])
    with pytest.raises(FormatError):
        _ = bad.raster
    with pytest.raises(FormatError):
        bad.samples(Window(270, 283, 330, 341))


@pytest.mark.parametrize(
    "change", [lambda v: v + b"\0", lambda v: v[:-1], lambda v: v + b"\xff" * 6]
)
def test_tiles_that_do_not_fit(change):
    source = coded()
    bad = Planes({**source.packed, "data": change(source.packed["data"])})
    with pytest.raises(FormatError):
        _ = bad.latents


@pytest.mark.usefixtures("each")
@pytest.mark.parametrize("tile", [0, TILE])
def test_progress_is_told_and_what_it_raises_ends_the_work(tile):
    source, told = coded(tile, (150, 140)), []
    whole = source.raster
    with progress.heard(told.append):
        _ = again(source).raster
    assert len(told) > 8
    assert sum(told) >= 150 * 140 * 2 / 3 * 0.9

    for stop in (1, len(told) // 2, len(told) - 1):
        fresh, left = again(source), [stop]

        def tell(amount, left=left):
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt

        with progress.heard(tell), pytest.raises(KeyboardInterrupt):
            _ = fresh.raster
        np.testing.assert_allclose(
            fresh.raster, whole, rtol=0, atol=1e-6, err_msg="work goes on where it ended"
        )


@needs_kernel
def test_the_kernel_tells_within_a_level():
    source, told = coded(0, (301, 283)), []
    with progress.heard(told.append):
        source.samples(Window(0, 283, 0, 301))
    assert max(told) < 0.1 * sum(told)
    assert kernel.available()


def test_large_rasters_have_tiles_that_cost_little(monkeypatch):
    monkeypatch.setattr(planes, "LARGE", SIZE[0] * SIZE[1])
    monkeypatch.setattr(planes, "TILES", (6, 7))
    plain = coded(0)
    assert coded(None).packed["tile"] == 6
    assert len(coded(None).packed["data"]) < 1.03 * len(plain.packed["data"])
    monkeypatch.setattr(planes, "TILE_BYTES", len(plain.packed["data"]) // 2000)
    assert coded(None).packed["tile"] == 7
    monkeypatch.setattr(planes, "LARGE", SIZE[0] * SIZE[1] + 1)
    assert coded(None).packed["tile"] == 0


def test_details_are_what_levels_add():
    """About: wavelets are not quite orthogonal, and the network adds something."""
    source = coded(0)
    found = source.latents
    levels = tuple(y * (k == 0) for k, y in enumerate(found.levels))
    alone = planes.encoded(Latents(levels, found.lowest * 0), SIZE, STEP)
    weights, grid = decoding.registered_model.registered(2), Grid(SIZE, LEVELS)
    low = np.zeros((*grid.at(1), 3), np.float32)
    raw = synthesis.finer(weights, 1, low, alone.latents.levels[0], STEP, SIZE[::-1])
    added = synthesis.colours(weights, raw, STEP) - 128
    assert alone.details[0] == pytest.approx(np.sqrt(np.square(added).mean()), rel=0.25)
