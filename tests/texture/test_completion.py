"""Hidden samples that come from planes behind, or copy others, against rules done one by one."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.container import texr
from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel
from proxyimg_codec.texture import completion
from proxyimg_codec.texture.completion import DRIFT, FILL_ONE, Copies, completed, unpack
from proxyimg_codec.texture.diffusion import diffused
from proxyimg_codec.texture.lifts import APART, LIFT, LIFT_MOST, RIM_WEIGHT, TURNS
from tests.support.pyramids import planes, view

ENGINES = ("numpy", "auto")

PART = 7, 4, 21, 18
"""Of planes of 40x30."""


def copies(seed, shape, grain, offsets=3, reach=9):
    """References of random cells to random places."""
    rng = np.random.default_rng(seed)
    cells = tuple(-(-n >> grain) for n in shape)
    sources = rng.integers(0, offsets + 1, cells).astype(np.uint8)
    sources.flat[0] = 1
    return Copies(grain, rng.integers(-reach, reach + 1, (offsets, 2)).astype(np.int32), sources)


def copy_of(values, known, references, cell, j, i):
    """What a cell copies to a sample of the part: a list of components, or None."""
    n = int(references.sources[cell])
    if not n or not (0 <= j < known.shape[0] and 0 <= i < known.shape[1]):
        return None
    dx, dy = (int(v) for v in references.offsets[n - 1])
    y, x = j + dy, i + dx
    if 0 <= y < known.shape[0] and 0 <= x < known.shape[1] and known[y, x]:
        return [int(v) for v in values[:, y, x]]
    return None


def nearest(a, n):
    """a / n, halves rounded up."""
    return math.floor(Fraction(int(a), int(n)) + Fraction(1, 2))


def mean_of(pairs):
    """Mean differences of pairs of lists; None if there are none, or one is too large."""
    if not pairs:
        return None
    sums = [sum(int(a[c]) - int(b[c]) for a, b in pairs) for c in range(len(pairs[0][0]))]
    means = [nearest(v, len(pairs)) for v in sums]
    apart = any(abs(v) > APART for v in means)
    return None if apart else [min(max(v, -LIFT), LIFT) for v in means]


def lifts_by_the_rule(values, known, references):
    """Lifts of cells, as Python integers, by cell."""
    side, (rows, columns) = 1 << references.grain, references.sources.shape
    cells = [(k, m) for k in range(rows) for m in range(columns) if references.sources[k, m]]

    def pairs(one, other, top, left, size):
        places = [(j, i) for j in range(top, top + size) for i in range(left, left + size)]
        both = [(one(j, i), other(j, i)) for j, i in places]
        return [(a, b) for a, b in both if a is not None and b is not None]

    def copies(cell):
        return lambda j, i: copy_of(values, known, references, cell, j, i)

    def there(j, i):
        inside = 0 <= j < known.shape[0] and 0 <= i < known.shape[1]
        return list(values[:, j, i]) if inside and known[j, i] else None

    links, aims = {cell: [] for cell in cells}, {}
    for k, m in cells:
        for j, i in ((0, 1), (1, 0)):
            other = k + j, m + i
            if other not in links:
                continue
            start = k * side + j * (side // 2), m * side + i * (side // 2)
            found = mean_of(pairs(copies((k, m)), copies(other), *start, side))
            if found:
                links[k, m].append((other, [-v for v in found]))
                links[other].append(((k, m), found))
        start = k * side - side // 2, m * side - side // 2
        rim = pairs(there, copies((k, m)), *start, side + 2 * (side // 2))
        weight = math.ceil(Fraction(RIM_WEIGHT * min(len(rim), side * side), side * side))
        aim = mean_of(rim)
        aims[k, m] = weight if aim else 0, aim or [0] * len(values)
    lifts = {cell: [0] * len(values) for cell in cells}
    for turn in range(2 * TURNS):
        for cell in cells:
            weight, aim = aims[cell]
            n = weight + len(links[cell])
            if sum(cell) % 2 != turn % 2 or not n:
                continue
            for c, own in enumerate(lifts[cell]):
                wanted = weight * aim[c] + sum(lifts[b][c] + more[c] for b, more in links[cell])
                own += nearest(7 * (wanted - n * own), 4 * n)
                lifts[cell][c] = min(max(own, -LIFT_MOST), LIFT_MOST)
    return lifts


def base_of(values, known, references, lifts, j, i):
    """The lifted base of one sample, or None: with fractions of cells, in plain Python."""
    side = 1 << references.grain
    rows, columns = references.sources.shape
    total, lifted, weight = [0] * len(values), [0] * len(values), 0
    for k in range(rows):
        for m in range(columns):
            down = 2 * side - abs(2 * j + 1 - (2 * k + 1) * side)
            across = 2 * side - abs(2 * i + 1 - (2 * m + 1) * side)
            found = copy_of(values, known, references, (k, m), j, i)
            if down <= 0 or across <= 0 or found is None:
                continue
            weight += down * across
            total = [t + down * across * v for t, v in zip(total, found, strict=True)]
            more = lifts[k, m]
            lifted = [t + down * across * v for t, v in zip(lifted, more, strict=True)]
    if not weight:
        return None
    both = zip(total, lifted, strict=True)
    return [nearest(t, weight) + nearest(g, weight) for t, g in both]


def by_the_rule(values, known, references):
    """What `completed` does, sample by sample."""
    out, now = values.copy(), known.copy()
    places = [(j, i) for j in range(known.shape[0]) for i in range(known.shape[1])]
    lifts = lifts_by_the_rule(values, known, references)
    bases = {p: base_of(values, known, references, lifts, *p) for p in places}
    bases = {p: b for p, b in bases.items() if b is not None}
    rim = np.zeros_like(known)
    residual = np.zeros_like(values)
    for p, b in bases.items():
        if known[p]:
            rim[p] = True
            residual[:, *p] = np.clip(values[:, *p] - b, -DRIFT, DRIFT)
    drift = diffused(residual, rim) if rim.any() else np.zeros_like(values)
    for p, b in bases.items():
        if not known[p]:
            out[:, *p] = np.clip(np.array(b) + drift[:, *p], 0, FILL_ONE)
            now[p] = True
    return out, now


@settings(deadline=None)
@given(st.integers(0, 1000), st.integers(0, 4), st.integers(1, 13), st.integers(1, 17))
def test_samples_are_copied_by_the_rule(seed, grain, height, width):
    rng = np.random.default_rng(seed)
    values = rng.integers(0, FILL_ONE + 1, (2, height, width)).astype(np.int32)
    known = rng.random((height, width)) < rng.choice([0.3, 0.9])
    known[0, 0] = True
    references = copies(seed, (height, width), grain)
    expected, then = by_the_rule(values, known, references)
    for engine in ENGINES:
        with kernel.for_engine(engine):
            found, now = completed(values, known, references)
        np.testing.assert_array_equal(now, then)
        np.testing.assert_array_equal(found[:, now], expected[:, now])


@pytest.mark.skipif(not kernel.available(), reason="the kernel was not compiled")
@pytest.mark.parametrize("grain", range(texr.GRAIN_MAX + 1))
def test_the_kernel_completes_as_numpy_does(grain):
    rng = np.random.default_rng(grain)
    height, width = (int(v) for v in rng.integers(131, 301, 2))
    values = rng.integers(0, FILL_ONE + 1, (1 + grain % 4, height, width)).astype(np.int32)
    known = rng.random((height, width)) < 0.97
    known[40:93, 50:121] = known[:31, 71:] = False
    references = copies(grain, known.shape, grain, offsets=1 + 40 * grain, reach=150)
    for empty in (False, True):
        if empty:  # cells in one corner only
            references.sources[2:], references.sources[:, 2:] = 0, 0
        found, now = completed(values, known, references)
        with kernel.for_engine("numpy"):
            expected, then = completed(values, known, references)
        np.testing.assert_array_equal(now, then)
        np.testing.assert_array_equal(found[:, now], expected[:, now])


def test_bands_and_tiles_make_no_difference(monkeypatch):
    """Many tiles of the diffusion, of which most have nothing to copy."""
    rng = np.random.default_rng(4)
    values = rng.integers(0, FILL_ONE + 1, (1, 290, 301)).astype(np.int32)
    known = np.ones((290, 301), bool)
    known[40:60, 50:90] = known[200:203, 127:131] = False
    references = copies(4, known.shape, 3, reach=60)
    references.sources[:3] = 0
    with kernel.for_engine("numpy"):
        whole = completed(values, known, references)
        monkeypatch.setattr(completion, "BAND", 4000)
        for one, other in zip(completed(values, known, references), whole, strict=True):
            np.testing.assert_array_equal(one, other)
    whole[0][:, ~whole[1]] = 0
    residuals = completed(values, known, replace(references, offsets=references.offsets * 0))
    np.testing.assert_array_equal(residuals[0], values, "no reference to a known sample")


def test_the_heaviest_samples_fit_32_bits():
    """White samples, all four cells, the coarsest grain; black ones below the darkest rim."""
    size = 150
    known = np.ones((size, size), bool)
    known[60:90, 60:90] = False
    values = np.full((1, size, size), FILL_ONE, np.int32)
    cells = -(-size >> texr.GRAIN_MAX)
    shift = np.array([[-40, 0]], np.int32)
    references = Copies(texr.GRAIN_MAX, shift, np.ones((cells, cells), np.uint8))
    found, now = completed(values, known, references)
    assert now.all()
    assert (found == FILL_ONE).all()


def test_a_stripe_goes_on_behind_what_hides_it():
    """An offset along a line continues the line, where the fill makes fog of it."""
    stripes = np.repeat((np.arange(40) % 7 < 3) * FILL_ONE, 60).reshape(1, 40, 60).astype(np.int32)
    known = np.ones((40, 60), bool)
    known[10:31, 22:43] = False
    references = Copies(2, np.array([[-22, 0], [22, 0]], np.int32), np.ones((10, 15), np.uint8))
    found, now = completed(np.where(known, stripes, 777), known, references)
    assert now.all()
    np.testing.assert_array_equal(found, stripes)


@pytest.mark.parametrize("count", [1, 3, 4, 15, 16, 255])
def test_references_come_back(count):
    made = copies(count, (37, 50), 2, count)
    made.sources.flat[-1] = count
    fields = {**made.fields, "part": [3, 2, 50, 37]}
    again = unpack(fields, "chunk TEXR")
    for one, other in zip(again.arrays, made.arrays, strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype
    assert again.fields == made.fields


@pytest.mark.parametrize("source", [0, 3, 4])
def test_sources_name_offsets(source):
    made = copies(1, (8, 8), 2, 2)
    made.sources[:] = source
    wide = replace(made, offsets=np.zeros((3, 2), np.int32))
    fields = {**made.fields, "sources": wide.coded, "part": [0, 0, 8, 8]}
    if source < 3:
        fields["sources"] = made.coded
    with pytest.raises(FormatError, match="all 0, or name an offset") as error:
        unpack(fields, "chunk TEXR 2")
    assert error.value.rule == "PYR-48"


def hidden_view(**fields):
    """A view of which a corner shows, with alpha."""
    source, alpha = planes("colour", (40, 30)), planes("soft", (40, 30), 1)
    mask = np.ones((9, 11), bool)
    mask[3:7, 2:8] = False
    return replace(view(source, alpha, PART, 1, mask), **fields)


def fixed(raster):
    return np.rint(np.moveaxis(raster, 2, 0) * np.float32(FILL_ONE)).astype(np.int32)


@pytest.mark.parametrize("components", [1, 3])
@pytest.mark.parametrize("soft", [False, True])
def test_samples_behind_are_those_of_their_own_planes(components, soft, monkeypatch):
    """Where they have latents; where not, and beside them, the fill goes on from them."""
    own = planes("own", PART[2:], 3)
    own_alpha = planes("own soft", PART[2:], 1) if soft else None
    support = np.zeros((9, 11), bool)
    support[2:6, 4:] = True
    own.__dict__["support"] = support
    own.packed["cell"] = 1
    source = planes("colour", (40, 30), components)
    made = hidden_view(planes=source, behind=own, behind_alpha=own_alpha)
    trusted = made.shown
    stored = support.repeat(2, 0).repeat(2, 1)[:18, :21] & ~trusted
    values = np.concatenate(
        [
            fixed(source.raster[4:22, 7:28].repeat(3 // components, 2)),
            fixed(made.alpha.raster[4:22, 7:28]),
        ]
    )
    values[:3, stored] = fixed(own.raster)[:, stored]
    values[3, stored] = fixed(own_alpha.raster)[0, stored] if soft else FILL_ONE
    expected = diffused(values, trusted | stored)
    np.testing.assert_array_equal(made.filled.reshape(18, 21, 4), np.moveaxis(expected, 0, 2))


def test_what_is_behind_is_drawn_only_where_the_view_does_not_show():
    own = planes("own", PART[2:], 3)
    made, plain = hidden_view(behind=own), hidden_view()
    one, other = (v.padded(((), ()))[1:-2, 1:-2] for v in (made, plain))
    np.testing.assert_array_equal(one[made.shown], other[made.shown])
    np.testing.assert_allclose(one[~made.shown][:, :3], own.raster[~made.shown], atol=1e-5)
    assert (one[~made.shown][:, 3] == 1).all()


def test_copies_come_from_what_is_behind_too():
    """Then the rest is filled from all of it."""
    own = planes("own", PART[2:], 3)
    support = np.zeros((9, 11), bool)
    support[4, 4] = True
    own.__dict__["support"] = support
    own.packed["cell"] = 1
    references = Copies(1, np.array([[-2, 0]], np.int32), np.zeros((9, 11), np.uint8))
    references.sources[4, 5] = 1
    made = hidden_view(behind=own, copies=references)
    values, known = made.known(made.shown)
    values, known = completed(values, known, references)
    assert known[8, 10]
    assert not made.shown[8, 10]
    expected = diffused(values, known)
    np.testing.assert_array_equal(made.filled.reshape(18, 21, 4), np.moveaxis(expected, 0, 2))
    assert (made.filled != hidden_view(behind=own).filled).any()
