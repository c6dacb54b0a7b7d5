import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.entropy import laplace
from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel
from proxyimg_codec.texture import context, planes, registered_model
from proxyimg_codec.texture.grid import Grid, by_channel, mirrored_indices
from proxyimg_codec.texture.latents import Encoder, Latents
from proxyimg_codec.texture.planes import Planes
from tests.support.pyramids import synthesized

needs_kernel = pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")
ENGINES = ["numpy", pytest.param("kernel", marks=needs_kernel)]


@contextlib.contextmanager
def engine(name):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "available", lambda: name == "kernel")
        yield


@pytest.fixture(params=ENGINES)
def each(request):
    with engine(request.param):
        yield


def grid_of(size, levels, model):
    return Grid(size, levels, registered_model.registration(model).padded)


def made(rng, grid, spread, grey=0):
    """Latents with Laplace statistics, wider at coarser levels, a few of them far off."""
    found, levels = [], grid.levels
    for k, (h, w) in enumerate(grid.at(k) for k in (*range(1, levels + 1), levels)):
        y = rng.laplace(0, spread * 1.5**k, (3 if k == levels else 9, h, w))
        y[rng.random(y.shape) < 0.01] *= 30
        y = np.clip(np.rint(y), 1 - context.LIMIT, context.LIMIT - 1)
        if k < grey:
            y[3:] = 0
        found.append(y.astype(np.int32))
    return Latents(tuple(found[:-1]), found[-1])


def random_cells(rng, size, cell):
    """Some cells, neither none nor all; None where there is only one."""
    cells = rng.random(planes.cells_of(size, cell)) < 0.6
    if cells.size == 1:
        return None
    cells.ravel()[:2] = True, False
    return cells


@st.composite
def cases(draw):
    """Arguments of `encoded`."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    side = st.integers(1, 40)
    size = draw(
        st.one_of(st.tuples(side, side), st.sampled_from([(1, 1), (3, 5), (300, 1), (2, 200)]))
    )
    levels = draw(st.integers(1, 6 if max(size) < 32 else 3))
    components = draw(st.sampled_from([1, 3]))
    spread = draw(st.sampled_from([0.05, 0.5, 4, 100, 30000]))
    grey = levels if components == 1 else draw(st.integers(0, levels))
    model = draw(st.sampled_from([1, 2]))
    latents = made(rng, grid_of(size, levels, model), spread, grey)
    if components == 1:
        latents.lowest[1:] = 0
    cell = draw(st.integers(1, 5))
    cells = random_cells(rng, size, cell) if draw(st.booleans()) else None
    shifts = tuple(rng.integers(-8, 8, 2 * levels).tolist())
    return latents, size, draw(st.integers(0, 640)), cells, cell, components, model, shifts


def same(a, b):
    return all((x == y).all() for x, y in zip((*a[0], a[1]), (*b[0], b[1]), strict=True))


@settings(max_examples=25, deadline=None)
@given(cases())
def test_latents_come_back(case):
    """By both engines, from the same bytes; but those that are certain, and outside, become 0."""
    latents, size, _, cells, cell, _, model, _ = case
    made_by, found_by = {}, {}
    for name in ("numpy", "kernel")[: 1 + kernel.available()]:
        with engine(name):
            made_by[name] = planes.encoded(*case)
            found_by[name] = made_by[name].latents
    coded, found = made_by["numpy"], found_by["numpy"]
    assert all(p.packed == coded.packed for p in made_by.values())
    assert all(same(found, other) for other in found_by.values())

    assert (found.lowest == latents.lowest).all()
    for level, (y, was) in enumerate(zip(found.levels, latents.levels, strict=True), 1):
        assert y.dtype == np.int32
        assert ((y == was) | (y == 0)).all()
        grid = grid_of(size, len(found.levels), model)
        stored = np.ones(planes.cells_of(size, cell), bool) if cells is None else cells
        assert not y[~by_channel(grid.bands(stored, cell, level))].any()
    # What was found has all of it in the stream.
    again = planes.encoded(found, *case[1:])
    assert same(again.latents, found)


def outcome(name, fields):
    """Latents that an engine finds, or its complaint."""
    with engine(name):
        try:
            return Planes(fields).latents
        except FormatError as error:
            return str(error)


def example(size=(21, 13), levels=2, spread=3.0, **more):
    rng = np.random.default_rng(5)
    return planes.encoded(made(rng, Grid(size, levels), spread), size, 293, **more)


@needs_kernel
@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from([0.3, 8, 3000]),
    st.lists(st.tuples(st.sampled_from(["data", "escapes"]), st.integers(0, 1 << 20),
                       st.integers(1, 255)), min_size=1, max_size=3),
)  # fmt: skip
def test_damaged_streams_have_the_same_outcome_in_both_engines(spread, flips):
    fields = dict(example(spread=spread).packed)
    for key, at, mask in flips:
        stream = bytearray(fields[key])
        if stream:
            stream[at % len(stream)] ^= mask
        fields[key] = bytes(stream)
    plain, fast = outcome("numpy", fields), outcome("kernel", fields)
    if isinstance(plain, str):
        assert fast == plain
    else:
        assert same(fast, plain)


@pytest.mark.usefixtures("each")
def test_truncation_is_found():
    fields = example(spread=40).packed
    assert len(fields["escapes"]) > 8
    for key in ("data", "escapes"):
        stream = fields[key]
        for cut in {0, 1, 2, len(stream) - 1, *range(3, len(stream), len(stream) // 12 + 1)}:
            with pytest.raises(FormatError):
                _ = Planes({**fields, key: stream[:cut]}).latents


def with_words(data, change):
    """A stream with other words, whose number is right."""
    head = 1 + 4 * (1 << data[0])
    words = change(data[head + 4 :])
    return data[:head] + (len(words) // 2).to_bytes(4, "little") + words


@pytest.mark.usefixtures("each")
@pytest.mark.parametrize("keep", [0, 2, 20, -2])
def test_missing_words_are_found(keep):
    fields = example().packed
    data = with_words(fields["data"], lambda words: words[:keep])
    with pytest.raises(FormatError, match="ends too early"):
        _ = Planes({**fields, "data": data}).latents


@pytest.mark.usefixtures("each")
def test_what_is_left_over_is_found():
    fields = example().packed
    more_words = with_words(fields["data"], lambda words: words + b"\1\2")
    for key, stream, message in [
        ("data", fields["data"] + b"\0", "left over"),
        ("escapes", fields["escapes"] + b"\0", "left over"),
        ("data", more_words, "does not end where its symbols do"),
    ]:
        with pytest.raises(FormatError, match=message):
            _ = Planes({**fields, key: stream}).latents


@pytest.mark.usefixtures("each")
def test_impossible_escapes_are_found():
    """Numbers of more than four bytes, and latents that no sum has room for."""
    latents = Latents((np.zeros((9, 4, 4), np.int32),), np.zeros((3, 4, 4), np.int32))
    # Neighbours that are not 0, whatever the weights: a latent that is certainly 0 has no symbol.
    latents.levels[0][:3] = np.random.default_rng(0).integers(-3, 4, (3, 4, 4))
    latents.levels[0][1, 3, 3] = 3000
    fields = planes.encoded(latents, (8, 8), 293).packed
    assert len(fields["escapes"]) >= 2
    with pytest.raises(FormatError, match="escapes"):
        _ = Planes({**fields, "escapes": b"\x80\x80\x80\x80\1"}).latents
    with pytest.raises(FormatError, match="latent"):
        _ = Planes({**fields, "escapes": b"\xff\xff\xff\x7f"}).latents


@pytest.mark.parametrize("where", ["levels", "lowest"])
@pytest.mark.parametrize("value", [context.LIMIT, -context.LIMIT])
def test_latents_out_of_range_are_not_encoded(where, value):
    latents = Latents((np.zeros((9, 4, 4), np.int32),), np.zeros((3, 4, 4), np.int32))
    (latents.lowest if where == "lowest" else latents.levels[0])[2, 1, 1] = value
    with pytest.raises(ValueError, match="latent"):
        planes.encoded(latents, (8, 8), 293)


@pytest.mark.usefixtures("each")
def test_the_largest_latents():
    """Of alternating sign, in the signs that add up: nothing overflows, features saturate."""
    sign = np.where(np.add.outer(np.arange(16), np.arange(16)) % 2, 1, -1)
    most = context.LIMIT - 1
    levels = [np.broadcast_to(most * sign[:n, :n], (9, n, n)) for n in (16, 8, 4)]
    latents = Latents(tuple(y.astype(np.int32) for y in levels), np.full((3, 4, 4), most, np.int32))
    assert same(planes.encoded(latents, (32, 32), 0).latents, latents)


def test_features_and_planes_stay_within_bounds():
    extremes = np.array([-(1 << 30), -70000, -1021, -5, 0, 5, 1021, 70000, 1 << 30], np.int32)
    for unit in (1, 144):
        got = context._squashed(extremes, unit)
        x = np.minimum(np.abs(extremes / unit), 508)
        expected = np.sign(extremes) * np.floor(32 * x / (1 + x / 4) + 0.5)
        np.testing.assert_array_equal(got, expected)
        assert np.abs(got).max() <= 127
    assert context.log_feature(extremes).max() == 127
    rng = np.random.default_rng(0)
    signs = rng.choice([-1, 1], (12, 6, 7)).astype(np.int32)
    low, high = signs[:3] * (context.LIMIT << 4), signs[3:] * (context.LIMIT - 4)
    plain = context.next_plain(low, high, (12, 13))
    exact = context.next_plain(low // 4, high // 4, (12, 13))  # far from any bound
    clipped = np.clip(4.0 * exact, -(context.LIMIT << 4), context.LIMIT << 4)
    assert np.abs(plain - clipped).max() < 16


@pytest.mark.usefixtures("each")
def test_certain_latents_take_no_symbol():
    """A plane of zeros is all certain where the scale is small, and costs next to nothing."""
    size, shifts = (64, 64), (-8, -8)
    zero = Latents((np.zeros((9, 32, 32), np.int32),), np.zeros((3, 32, 32), np.int32))
    coded = planes.encoded(zero, size, 293, shifts=shifts)
    assert same(coded.latents, zero)
    assert len(coded.packed["data"]) < 9 * 32 * 32 / 8 / 8


@pytest.mark.parametrize("size", [(1, 1), (2, 9), (9, 2), (23, 4), (5, 40)])
def test_waves(size):
    """All of a support once, by x + 3 y and y, no neighbour in the same wave or a later one."""
    w, h = size
    support = np.random.default_rng(1).random((h, w)) < 0.7
    support[0, 0] = True
    when = np.full((h, w), -1)
    last = -1
    for turn, (rows, columns) in enumerate(context.waves(support)):
        assert len(set(columns + 3 * rows)) == 1
        assert columns[0] + 3 * rows[0] > last
        assert (np.diff(rows) > 0).all()
        assert (when[rows, columns] == -1).all()
        when[rows, columns], last = turn, columns[0] + 3 * rows[0]
    assert ((when >= 0) == support).all()
    for y, x in np.argwhere(support):
        for dy, dx in registered_model.CAUSAL:
            if y + dy >= 0 and 0 <= x + dx < w and support[y + dy, x + dx]:
                assert when[y + dy, x + dx] < when[y, x]


@pytest.mark.usefixtures("each")
@pytest.mark.parametrize("model", [1, 2])
@pytest.mark.parametrize("components", [1, 3])
@pytest.mark.parametrize("size", [(1, 1), (21, 13), (32, 64)])
def test_rasters(size, components, model):
    """Of the size of the picture, whatever is padded; grey ones have the mean of all colours."""
    grid = grid_of(size, 3, model)
    latents = made(np.random.default_rng(2), grid, 2, 0 if components == 3 else 3)
    if components == 1:
        latents.lowest[1:] = 0
    coded = planes.encoded(latents, size, 293, components=components, number=model)
    got = coded.raster
    assert got.shape == (size[1], size[0], components)
    assert got.dtype == np.float32
    assert got.flags.c_contiguous
    found = coded.latents
    weights = registered_model.registered(model)
    whole = synthesized(weights, grid, found, 293)
    part = whole[: size[1], : size[0]]
    expected = part if components == 3 else part.mean(2, keepdims=True)
    np.testing.assert_allclose(got, np.clip(expected / 255, 0, 1), atol=1e-6)
    assert coded.raster is got


@needs_kernel
@settings(max_examples=15, deadline=None)
@given(cases())
def test_engines_synthesize_alike(case):
    latents, size, step, _, _, _, model, _ = case
    weights, grid = registered_model.registered(model), grid_of(size, len(latents.levels), model)
    found = {}
    for name in ("numpy", "kernel"):
        with engine(name):
            found[name] = synthesized(weights, grid, latents, step)
    scale = max(np.abs(found["numpy"]).max(), 255)
    np.testing.assert_allclose(found["kernel"], found["numpy"], atol=1e-5 * scale)


@needs_kernel
@pytest.mark.parametrize("rows", [1, 2, 3, 14, 21])
@pytest.mark.parametrize("columns", [1, 2, 9, 64])
def test_engines_make_the_same_plain_planes(rows, columns):
    rng = np.random.default_rng(rows)
    shape = -(-rows // 2), -(-columns // 2)
    most = context.LIMIT << 4
    low = rng.integers(-most, most + 1, (3, *shape)).astype(np.int32)
    high = rng.integers(1 - context.LIMIT, context.LIMIT, (9, *shape)).astype(np.int32)
    found = context.next_plain(low, high, (rows, columns))
    with engine("numpy"):
        np.testing.assert_array_equal(found, context.next_plain(low, high, (rows, columns)))


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 8, 9, 30, 31])
def test_bands_are_mirrored_as_the_line_is(size):
    """The halves of a line that is mirrored about its first and last value are what indices say."""
    period = max(2 * size - 2, 1)
    line = np.arange(size)
    for high in (False, True):
        index = mirrored_indices(size, high)
        assert len(index) == (size + 1) // 2 + 4
        wanted = (2 * np.arange(-2, (size + 1) // 2 + 2) + high) % period
        wanted = np.where(wanted < size, wanted, period - wanted)
        if size > 3:  # else they reach beyond the mirrored line, and are clamped
            np.testing.assert_array_equal(line[np.minimum(2 * index + high, size - 1)], wanted)
        assert index.min() >= 0
        assert index.max() < max(size // 2 if high else (size + 1) // 2, 1)


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (64, 48), (77, 50), (29, 130)])
def test_levels_have_as_many_latents_as_samples(size):
    """Critically sampled: the bands of all levels and the lowest planes replace the samples."""
    for levels in (1, 3, 6):
        grid = Grid(size, levels)
        cells = np.ones(planes.cells_of(size, 3), bool)
        coded = [by_channel(grid.bands(cells, 3, k)).sum() for k in range(1, levels + 1)]
        rows, columns = grid.at(levels)
        assert sum(coded) + 3 * rows * columns == 3 * size[0] * size[1]


def test_the_support_reaches_one_position_beyond_coarse_cells():
    cells = np.zeros((10, 12), bool)
    cells[4, 5] = True  # samples 32..39 down, 40..47 across
    for level, rows, columns in ((2, (8, 9), (10, 11)), (3, (3, 5), (4, 6)), (4, (1, 3), (1, 3))):
        there = Grid((96, 80), 5).bands(cells, 3, level) > 0
        i, j = np.nonzero(there)
        assert ((i.min(), i.max()), (j.min(), j.max())) == (rows, columns)
        assert there[rows[0] : rows[1] + 1, columns[0] : columns[1] + 1].all()


def test_strips_do_not_show(monkeypatch):
    """Of the convolutions, in numpy."""
    with engine("numpy"):
        coded = example((50, 64), 1)
        whole, raster = coded.latents, coded.raster
        monkeypatch.setattr("proxyimg_codec.texture.convolution.STRIP", 1)
        again = Planes(coded.packed)
        assert same(again.latents, whole)
        np.testing.assert_allclose(again.raster, raster, atol=1e-5)


def test_escapes_are_written_as_the_format_says():
    """Zigzag, 7 bits a byte, low first."""
    coder = Encoder()
    mean, scale = np.array([0, 0, 0, 160]), np.full(4, laplace.CERTAIN + 1)
    coder.code(np.array([100, -100, 8191, 11]), mean, scale)
    assert coder.escapes() == bytes([200 & 127 | 128, 1, 199 & 127 | 128, 1, 0xFE, 0x7F])


def test_certain_latents_become_0():
    coder = Encoder()
    scale = np.array([0, laplace.CERTAIN, laplace.CERTAIN + 1])
    got = coder.code(np.array([5, -7, 2]), np.array([4, -4, 4]), scale)
    assert got.tolist() == [0, 0, 2]
