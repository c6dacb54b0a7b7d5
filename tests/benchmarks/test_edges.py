"""The measures of edges tell a clean object and back from those with a rim."""

import numpy as np
import pytest

from benchmarks import edges as e

pytest.importorskip("torch")

SIZE = 70, 93
ROW, COLUMN = np.indices(SIZE)


@pytest.fixture
def case():
    """A red disc, whose rim is soft, on backs that become brighter to the right."""
    away = np.hypot(ROW - 33, COLUMN - 45)
    alpha = np.clip(20.5 - away, 0, 1)
    own = np.zeros((*SIZE, 4), np.uint8)
    own[..., 0], own[..., 3] = 230, np.rint(255 * alpha)
    back = np.repeat((60 + COLUMN[..., None]).astype(np.uint8), 3, 2)
    return e.Case("disc", own, back, back)


def test_rings_are_counted_from_the_outline(case):
    at = e.depth(case.mask)
    assert at[33, 45] > e.RINGS
    inside = np.flatnonzero(case.mask[33])
    assert at[33, inside[:3]].tolist() == [1, 2, 3]
    assert at[33, inside[0] - 2 : inside[0]].tolist() == [-2, -1]
    np.testing.assert_allclose(e.rings(at.astype(float), case.mask), np.arange(1, e.RINGS + 1))


def test_an_outline_shows_in_the_profile_and_a_gradient_does_not(case):
    at = e.depth(case.mask)[..., None] * np.ones(3)
    assert np.abs(e.profile(0.5 * at, case.mask)).max() < 0.5
    assert np.abs(e.profile(np.where(at == -1, 12.0, 0), case.mask)).max() > 6


def test_a_disc_is_red_to_its_rim_and_leaves_no_outline(case):
    found = e.score(case, "pyramid", 1, 75)
    assert found.clean
    assert found.ghost < e.GHOST
    assert found.alone[0] < 12
