"""Merging of basins: partitions, nesting, strengths, and known pictures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.encoder.shapes.hierarchy import borders, hierarchy, merged, partitions
from proxyimg_codec.encoder.shapes.maps import Maps


def lines(height: int, width: int, *columns: tuple[int, float]) -> np.ndarray:
    boundary = np.zeros((height, width), np.float32)
    for x, strength in columns:
        boundary[:, x : x + 2] = strength
    return boundary


def test_lines_divide_a_picture_until_their_strength():
    tree = hierarchy(lines(61, 103, (30, 0.8), (70, 0.4)))
    fine, middle, coarse = (tree.cut(level) for level in (0.2, 0.6, 0.95))
    assert [len(np.unique(v)) for v in (fine, middle, coarse)] == [3, 2, 1]
    assert len(np.unique(fine[:, :29])) == 1
    assert len(np.unique(fine[:, 34:68])) == 1
    assert middle[30, 50] == middle[30, 90] != middle[30, 10]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(5, 60), st.integers(5, 60))
def test_cuts_are_partitions_that_nest(seed, height, width):
    boundary = np.random.default_rng(seed).random((height, width)).astype(np.float32)
    tree = hierarchy(boundary)
    assert (np.diff(tree.strengths) >= 0).all()
    assert len(tree.merges) == tree.count - 1
    finer = tree.cut(0.0)
    np.testing.assert_array_equal(np.unique(tree.basins), np.arange(tree.count))
    for level in (0.3, 0.5, 0.7, 2.0):
        coarser = tree.cut(level)
        pairs = np.unique(np.stack([finer.ravel(), coarser.ravel()]), axis=1)
        assert len(np.unique(pairs[0])) == pairs.shape[1]
        finer = coarser
    assert coarser.max() == 0


def test_regions_of_different_kinds_stay_apart():
    labels = np.repeat(np.arange(4), 10)[None].repeat(8, 0)
    tree = merged(labels, np.full((8, 40), 0.1, np.float32), np.array([0, 0, 1, 1]))
    np.testing.assert_array_equal(tree.of_basins(1.0), [0, 0, 1, 1])


def test_borders_have_their_length_and_strength():
    labels = np.zeros((6, 9), np.intp)
    labels[2:4, 3:5] = 1
    boundary = np.where(labels == 1, 0.5, 0.25).astype(np.float32)
    pairs, lengths, sums = borders(labels, boundary)
    assert pairs.tolist() == [[0, 1]]
    assert lengths.tolist() == [8]
    assert sums[0] == pytest.approx(4.0)


def test_outside_of_the_support_is_apart():
    inside = np.zeros((40, 50), np.bool_)
    inside[5:35, 5:22] = inside[5:35, 28:45] = True
    cut = hierarchy(np.zeros((40, 50), np.float32), inside).cut(0.5)
    assert cut[20, 10] != cut[20, 40]


def test_partitions_have_the_size_of_the_picture():
    boundary = lines(257, 1001, (400, 0.9))
    maps = Maps(boundary, boundary, np.zeros((257, 1001, 2), np.float32))
    first, last = partitions(maps, [0.3, 1.0])
    assert first.shape == last.shape == (257, 1001)
    assert (first.max(), last.max()) == (1, 0)
    assert (first[:, 390] != first[:, 412]).all()
