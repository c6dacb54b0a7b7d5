"""What boundaries at rest leave of views: the samples that show, and those that are trusted."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conformance.make.builders import ellipse, polygon
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.texture import occlusion as module
from proxyimg_codec.texture.diffusion import diffused
from proxyimg_codec.texture.occlusion import ALL_IN_PLACE, ALL_REMOVED, Moved, Occlusion
from proxyimg_codec.texture.pyramid import FILL_ONE
from tests.support.edits import near
from tests.support.pyramids import filled, planes, view

UNIT = 4
PART = 7, 4, 21, 18
"""Of planes of 40x30."""


def rectangle(x0, y0, x1, y1):
    """A boundary of edges in 1/16 px."""
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return Boundary(UNIT, (polygon(*((x / 16, y / 16) for x, y in corners)),))


def share(low, high, pixel):
    """How much of a pixel lies between two edges in 1/16 px."""
    return Fraction(max(min(high, 16 * pixel + 16) - max(low, 16 * pixel), 0), 16)


edges = st.tuples(*[st.integers(-60, 300)] * 4).map(
    lambda v: (min(v[0], v[1]), min(v[2], v[3]), max(v[0], v[1]) + 1, max(v[2], v[3]) + 1)
)


@given(st.none() | edges, st.lists(edges, max_size=3), st.integers(-5, 12), st.integers(-5, 12))
def test_the_rule_for_rectangles(own, fronts, x, y):
    """Their coverage is the product of how far they cover a pixel across and down."""
    box = (x, y, 9, 6)
    cuts = Occlusion(own and rectangle(*own), tuple(rectangle(*v) for v in fronts), box)

    def covered(edge):
        return np.array(
            [[share(edge[0], edge[2], x + i) * share(edge[1], edge[3], y + j) for i in range(9)]
             for j in range(6)]
        )  # fmt: skip

    lost = [covered(v) for v in fronts] + ([] if own is None else [1 - covered(own)])
    most = np.max(lost, axis=0, initial=Fraction(0)) if lost else np.zeros((6, 9))
    shown, trusted = most < 1, ~near(most > 0)
    shown = shown if shown.any() else ~shown
    np.testing.assert_array_equal(cuts.shown, shown)
    np.testing.assert_array_equal(cuts.trusted, trusted if trusted.any() else shown)
    assert not (cuts.trusted & ~cuts.shown).any()


def test_the_rule_for_curves():
    """Against ellipses a little smaller and larger, whose points in 32x32 squares a pixel count."""
    shapes = ((19, 16), (16, 14)), ((29, 12), (8, 8)), ((5, 17), (7, 6))
    own, *fronts = (Boundary(UNIT, (ellipse(*v),)) for v in shapes)
    cuts = Occlusion(own, tuple(fronts), (2, 1, 38, 32))
    y, x = np.mgrid[0 : 32 * 32 + 1, 0 : 38 * 32 + 1] / 32

    def covered(shape, larger):
        """Whether some of a pixel is inside, and whether all is."""
        (cx, cy), (rx, ry) = shape
        inside = np.hypot((x + 2 - cx) / (rx + larger), (y + 1 - cy) / (ry + larger)) < 1
        parts = [inside[j : j - 1 or None, i : i - 1 or None] for j in (0, 1) for i in (0, 1)]
        pixels = np.stack([p[:1024, :1216].reshape(32, 32, 38, 32) for p in parts])
        return pixels.any((0, 2, 4)), pixels.all((0, 2, 4))

    bounds = []
    for sign in (-1, 1):  # least and most of what is shown and trusted
        some, whole = covered(shapes[0], 0.1 * sign)
        others = [covered(v, -0.1 * sign) for v in shapes[1:]]
        bounds.append((some & ~others[0][1] & ~others[1][1],
                       ~near(~whole | others[0][0] | others[1][0])))  # fmt: skip
    for k, found in enumerate((cuts.shown, cuts.trusted)):
        least, most = bounds[0][k], bounds[1][k]
        assert not (least & ~found).any()
        assert not (found & ~most).any()
        assert (most & ~least).mean() < 0.1
        assert 100 < found.sum() < 1000
    rim = cuts.shown & ~cuts.trusted
    assert rim.sum() > 200


def test_bands_do_not_show(monkeypatch):
    shapes = tuple(Boundary(UNIT, (ellipse(*v),)) for v in (((14, 11), (13, 9)), ((20, 8), (7, 7))))
    whole = Occlusion(shapes[0], shapes[1:], PART)
    kept = whole.shown, whole.trusted
    monkeypatch.setattr(module, "BAND", 50)
    again = Occlusion(shapes[0], shapes[1:], PART)
    np.testing.assert_array_equal((again.shown, again.trusted), kept)


def test_if_none_would_show_all_do():
    everything = rectangle(-1000, -1000, 10000, 10000)
    for cuts in (
        Occlusion(None, (everything,), PART),
        Occlusion(rectangle(0, 0, 16, 16), (), PART),
    ):
        assert cuts.shown.all()
        assert cuts.trusted.all()
    assert (
        view(planes("a", (40, 30)), part=PART, cuts=Occlusion(None, (everything,), PART)).shown
        is None
    )


@pytest.mark.parametrize(("across", "columns"), [(4, [5, 6, 7, 8]), (5, [7]), (6, [7, 8])])
def test_if_none_can_be_trusted_all_that_show_are(across, columns):
    """The inner ones of 5 across are 3 away from what is not the layer's; of 4 across none are."""
    x, y, _, h = PART
    cuts = Occlusion(rectangle(*(16 * v for v in (x + 5, y, x + 5 + across, y + h))), (), PART)
    assert np.flatnonzero(cuts.shown.all(0)).tolist() == list(range(5, 5 + across))
    assert np.flatnonzero(cuts.trusted.all(0)).tolist() == columns
    assert cuts.trusted.any(0).sum() == len(columns)


@pytest.fixture
def cut():
    """A view from which a disc and what is beside a rectangle are cut."""
    own = rectangle(8 * 16 + 8, 5 * 16 + 3, 26 * 16, 21 * 16)
    disc = Boundary(UNIT, (ellipse((17, 12), (5, 4)),))
    return view(planes("a", (40, 30)), part=PART, cuts=Occlusion(own, (disc,), PART))


def centres(at):
    y, x = np.nonzero(at)
    return x + PART[0] + 0.5, y + PART[1] + 0.5


def test_others_are_filled_from_those_that_can_be_trusted(cut):
    x0, y0, w, h = PART
    crop = cut.planes.raster[y0 : y0 + h, x0 : x0 + w]
    shown, trusted = cut.cuts.shown, cut.cuts.trusted
    assert 0 < trusted.sum() < shown.sum() < shown.size
    fixed = np.where(trusted[..., None], np.rint(crop * FILL_ONE), 0).astype(np.int32)
    fill = np.moveaxis(diffused(np.moveaxis(fixed, 2, 0), trusted), 0, 2) / FILL_ONE
    got = cut.sample(*centres(shown | True), PART).reshape(h, w, 3)
    np.testing.assert_array_equal(got[shown], crop[shown])
    np.testing.assert_allclose(got[~shown], fill[~shown], atol=1e-6)
    assert np.abs(crop - fill)[shown & ~trusted].max() > 0.02


def test_filling_waits_until_it_is_needed(cut):
    shown = cut.cuts.shown
    cut.sample(*centres(shown), PART)
    assert not filled(cut)
    cut.sample(*(v[:1] for v in centres(~shown)), PART)
    assert filled(cut)


def test_what_is_kept(cut):
    """Near what is apart only trusted samples are, elsewhere all that show."""
    own, (disc,) = cut.cuts.own, cut.cuts.fronts
    inner, outer = Occlusion(own, (), PART), Occlusion(None, (disc,), PART)
    for moved, kept in [
        (cut.cuts.everything, cut.cuts.trusted),
        (Moved(frozenset([disc])), inner.shown & outer.trusted),
        (Moved(behind=ALL_REMOVED), inner.trusted & outer.shown),
        (ALL_IN_PLACE, cut.cuts.shown),
    ]:
        np.testing.assert_array_equal(cut.cuts.kept(moved), kept)
    small = Occlusion(rectangle(128, 96, 160, 128), (disc,), PART)
    assert 0 < small.shown.sum() < small.shown.size
    np.testing.assert_array_equal(small.kept(small.everything), small.shown)


@given(edges, st.lists(st.tuples(st.none() | edges, st.booleans()), max_size=3))
def test_own_samples_are_lost_beside_what_is_apart_behind(own, behind):
    """Where the first of what lies behind a sample that is not all the layer's is moved."""
    box = (3, 2, 14, 9)
    cuts = Occlusion(rectangle(*own), (), box)

    def covered(edge):
        return np.array(
            [[1 if edge is None else share(edge[0], edge[2], 3 + i) * share(edge[1], edge[3], 2 + j)
              for i in range(14)] for j in range(9)]
        )  # fmt: skip

    mine, *others = (covered(v) for v in (own, *(edge for edge, _ in behind)))
    bared = np.zeros((9, 14), bool)
    for at in np.argwhere(mine < 1):
        for below, (_, rests) in zip(others, behind, strict=True):
            if below[tuple(at)] and not rests:
                bared[tuple(at)] = True
            if below[tuple(at)] == 1 or bared[tuple(at)]:
                break
    kept = (mine > 0) & ~near(bared)
    moved = Moved(behind=tuple((e and rectangle(*e), rests) for e, rests in behind))
    np.testing.assert_array_equal(cuts.kept(moved), kept if kept.any() else cuts.shown)


def test_what_is_apart():
    """Those in front and behind that do not rest, and what is behind only if it is cut too."""
    a, b, c, d = (rectangle(0, 0, 16 * k, 16) for k in (1, 2, 3, 4))
    twin = rectangle(0, 0, 48, 16)
    cuts = Occlusion.of([2, 3, 4], 2, [None, a, b, c, d], PART)
    rest = [True] * 5
    stack = [None, a, b, c, d]
    assert cuts.moved(2, stack, rest) == ALL_IN_PLACE
    assert cuts.moved(2, [None, a, b, twin, d], rest) == ALL_IN_PLACE
    assert cuts.moved(2, stack, [*rest[:3], False, True]) == Moved(frozenset([c]))
    assert cuts.moved(2, stack[:4], rest[:4]) == Moved(frozenset([d]))
    behind = ((a, True), (None, False))
    assert cuts.moved(2, stack, [False, *rest[1:]]) == Moved(behind=behind)
    assert cuts.moved(2, [None, a, a, c, d], rest) == Moved(behind=ALL_REMOVED)
    fronts = Occlusion.of([3, 4], 2, stack, PART)
    assert fronts.moved(2, [None, a, a, c, d], [False, False, *rest[2:]]) == ALL_IN_PLACE


@pytest.mark.parametrize("size", [(21, 18), (1, 1), (1, 6), (7, 2), (5, 5)])
@pytest.mark.parametrize("there", [False, True])
def test_a_mask_instead_has_the_cells_that_are_kept_as_a_whole(size, there):
    box = (0, 0, *size)
    disc = Boundary(UNIT, (ellipse((2, 2), (2, 2)),))
    texture = view(planes("a", (40, 30)), part=box, cuts=Occlusion(None, (disc,), box))
    moved = ALL_IN_PLACE if there else texture.cuts.everything
    kept, masked = texture.cuts.kept(moved), texture.masked(moved)
    assert masked.cuts is None
    cells = np.array(
        [[kept[2 * j : 2 * j + 2, 2 * i : 2 * i + 2].all() for i in range(-(-size[0] // 2))]
         for j in range(-(-size[1] // 2))]
    )  # fmt: skip
    assert cells.all() if masked.mask is None else (masked.mask == cells).all()
    assert masked.cell == (masked.mask is not None)
    assert masked.masked(moved) is masked


def test_a_mask_instead_is_never_empty():
    """Without a whole cell, cells belong of which a part does; if these are all, there is none."""
    box = (0, 0, 6, 4)
    small = rectangle(16, 16, 32, 48)
    texture = view(planes("a", (40, 30)), part=box, cuts=Occlusion(small, (), box))
    assert texture.cuts.shown.sum() == 2
    for moved in (texture.cuts.everything, ALL_IN_PLACE):
        assert texture.masked(moved).mask.tolist() == [[True, False, False]] * 2
    line, box = rectangle(16, 0, 32, 64), (0, 0, 2, 4)
    thin = view(planes("a", (40, 30)), part=box, cuts=Occlusion(line, (), box))
    assert thin.cuts.shown.tolist() == [[False, True]] * 4
    masked = thin.masked(thin.cuts.everything)
    assert (masked.mask, masked.cell) == (None, 0)


def test_numbers():
    """Layers are found by what their boundaries are, the same object before an equal one."""
    a, b, c = (rectangle(0, 0, 16 * k, 16) for k in (1, 2, 3))
    twin = rectangle(0, 0, 32, 16)
    other = Boundary(UNIT + 1, tuple(2 * p for p in b.paths))
    cuts = Occlusion.of([1, 2, 3], 1, [None, a, b, c], PART)
    assert (cuts.own, cuts.fronts) == (a, (b, c))
    assert cuts.numbers(1, [None, a, b, c]) == [1, 2, 3]
    assert cuts.numbers(1, [None, a, c, b]) == [1, 2, 3]
    assert cuts.numbers(0, [a, None, c, None, b, b]) == [0, 2, 4]
    assert cuts.numbers(1, [None, a, twin, c]) == [1, 2, 3]
    assert cuts.numbers(1, [None, a, twin, b, c]) == [1, 3, 4]
    for gone in ([None, a, b], [None, b, a, c], [None, a, other, c], [b, a, c], [None, None, b, c]):
        assert cuts.numbers(1, gone) is None
    front = Occlusion.of([2], 0, [None, a, b], PART)
    assert (front.own, front.fronts) == (None, (b,))
    assert front.numbers(0, [None, b, b]) == [1]
    assert Occlusion.of([], 0, [None], PART) is None


def test_samples_near_what_changed_behind_are_loose():
    box, own = (0, 0, 30, 20), rectangle(0, 0, 480, 320)
    cuts = Occlusion(own, (), box)
    assert not cuts.loose(ALL_IN_PLACE).any()
    assert cuts.loose(Moved(behind=ALL_REMOVED)).all()
    assert cuts.loose(Moved(apart=True)).all()
    assert Occlusion(None, (own,), box).loose(ALL_IN_PLACE).all()
    spot = rectangle(16 * 8, 16 * 7, 16 * 10, 16 * 9)
    found = cuts.loose(Moved(behind=((spot, False), (None, True))))
    expected = np.zeros((20, 30), bool)
    expected[5:11, 6:12] = True
    np.testing.assert_array_equal(found, expected)


def test_soft_layers_hide_nothing():
    low, high, own = rectangle(0, 0, 99, 99), rectangle(0, 0, 320, 320), rectangle(0, 0, 200, 200)
    cuts, stack, still = Occlusion(own, (), (0, 0, 20, 20)), [low, high, own], [False, True, True]
    assert cuts.moved(2, stack, still).behind == ((high, True), (low, False))
    assert cuts.moved(2, stack, still, frozenset([1])).behind == ((low, False),)
