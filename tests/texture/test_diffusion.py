import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proxyimg_codec.native import kernel
from proxyimg_codec.texture import diffusion
from proxyimg_codec.texture.diffusion import FRACTION_BITS, diffused, fill

ONE = 1 << FRACTION_BITS


@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_stored_codes_stay_and_others_lie_between(height, width, seed):
    rng = np.random.default_rng(seed)
    codes = rng.integers(-8, 8, (3, height, width))
    stored = rng.random((height, width)) < 0.3
    stored[rng.integers(height), rng.integers(width)] = True
    out = fill(codes, stored)
    assert (out[:, stored] == codes[:, stored] * ONE).all()
    kept = codes[:, stored]
    assert (out >= kept.min(1)[:, None, None] * ONE).all()
    assert (out <= kept.max(1)[:, None, None] * ONE).all()


def test_a_hole_in_a_ramp_is_bridged_smoothly():
    codes = np.tile(np.arange(-8, 8), (16, 1))[None]
    stored = np.ones((16, 16), bool)
    stored[:, 5:11] = False
    row = fill(codes, stored)[0, 8] / ONE
    assert (np.diff(row) > 0).all()
    assert np.abs(row - codes[0, 8]).max() < 1.5


def test_known_values():
    """The fill is normative: these numbers are part of the format."""
    codes = np.zeros((1, 4, 5), np.int64)
    codes[0, 0, 0], codes[0, 3, 4] = 7, -8
    stored = codes[0] != 0
    assert fill(codes, stored)[0].tolist() == KNOWN


KNOWN = [
    [1792, 1014, 435, -26, -304],
    [1146, 760, 275, -199, -527],
    [811, 525, 54, -515, -1037],
    [654, 383, -130, -890, -2048],
]


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1)])
def test_thin_planes(shape):
    stored = np.zeros(shape, bool)
    stored[0, 0] = True
    assert (fill(np.full((2, *shape), 3), stored) == 3 * ONE).all()


def plainly(value, known):
    """The same for one channel, as the specification says it, cell by cell."""
    if known.all():
        return value
    h, w = known.shape
    coarse = np.zeros(((h + 1) // 2, (w + 1) // 2), np.int64)
    some = np.zeros(coarse.shape, bool)
    for y, x in np.ndindex(coarse.shape):
        children = value[2 * y : 2 * y + 2, 2 * x : 2 * x + 2]
        seen = children[known[2 * y : 2 * y + 2, 2 * x : 2 * x + 2]]
        if len(seen):
            coarse[y, x] = np.floor(seen.sum() / len(seen) + 0.5)
            some[y, x] = True
    coarse = plainly(coarse, some)
    out = np.array([[value[y, x] if known[y, x] else coarse[y // 2, x // 2] for x in range(w)]
                    for y in range(h)])  # fmt: skip
    for _ in range(8):
        p = np.pad(out, 1, mode="edge")
        mean = (p[:-2, 1:-1] + p[2:, 1:-1] + p[1:-1, :-2] + p[1:-1, 2:] + 2) >> 2
        out = np.where(known, out, mean)
    return out


@pytest.mark.parametrize("tile", [3, 16, diffusion.TILE])
def test_tiles_do_not_show(tile, monkeypatch):
    monkeypatch.setattr(diffusion, "TILE", tile)
    rng = np.random.default_rng(2)
    value = rng.integers(-(1 << 24), 1 << 24, (2, 45, 150)).astype(np.int32)
    known = np.ones((45, 150), bool)
    known[5:40, 11:60], known[3, 149] = False, False
    known[20:, 128:] = rng.random((25, 22)) < 0.2
    for engine in ("numpy", "auto"):
        with kernel.for_engine(engine):
            out = diffused(value, known)
        for channel, got in zip(value, out, strict=True):
            np.testing.assert_array_equal(got, plainly(channel.astype(np.int64), known))


@pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")
@pytest.mark.parametrize("share", [0.001, 0.3, 0.999])
@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 1, 300), (2, 257, 129), (4, 131, 401)])
def test_the_kernel_fills_as_numpy_does(shape, share):
    rng = np.random.default_rng(shape[2])
    value = rng.integers(-(1 << 24), 1 << 24, shape).astype(np.int32)
    known = rng.random(shape[1:]) < share
    known[-1, -1] = True
    wanted = np.zeros(known.shape, bool)
    wanted[: shape[1] // 3 + 1, : shape[2] // 3 + 1] = True
    found = [diffused(value, known), diffused(value, known, wanted)]
    with kernel.for_engine("numpy"):
        expected = diffused(value, known)
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(found[1][:, wanted], expected[:, wanted])
