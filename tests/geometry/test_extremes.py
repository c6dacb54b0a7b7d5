"""Values that a file may hold and no editor would make."""

import numpy as np
import pytest

from proxyimg_codec.errors import LimitError
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.geometry.raster import rasterize
from proxyimg_codec.geometry.warp import Warp
from proxyimg_codec.limits import Budget, Limits


def test_a_matrix_that_is_singular_in_floating_point_alone_is_survived():
    n = (1 << 31) - 2
    shown = Warp(Pose(matrix=(n, n - 1, n + 1, n)), None).locate(np.array([1.5]), np.array([2.5]))
    assert np.isfinite([shown.x, shown.y]).all()


def test_narrow_triangles_cost_their_rows():
    # Between the centres of two columns: they cover nothing, and cross all rows.
    narrow = np.array([[(3.6, 0), (3.7, 0), (3.65, 500)]] * 400, float)
    assert (rasterize(narrow[:4], 0, 0, 8, 500) == -1).all()
    with pytest.raises(LimitError, match="overlap"):
        rasterize(narrow, 0, 0, 8, 500, Budget(Limits(overlap=40)))


def test_triangles_beside_the_window_cost_nothing():
    beside = np.array([[(-9, 0), (-1, 0), (-5, 500)], [(9, 0), (12, 0), (9, 500)]] * 400, float)
    assert (rasterize(beside, 0, 0, 8, 500, Budget(Limits(overlap=0))) == -1).all()


def test_faces_of_a_mirrored_layer_keep_their_order():
    # Whatever lies in front stays in front when the picture is turned over.
    front = np.array([(0, 0), (9, 0), (0, 9)], float)
    both = np.stack([front[::-1], front])
    assert (rasterize(both, 0, 0, 4, 4) == 1).all()
    flipped = both * [-1, 1] + [4, 0]
    assert (rasterize(flipped[:, ::-1], 0, 0, 4, 4) == 1).all()
    assert Pose(matrix=(-1, 0, 0, 1)).mirrored
    assert not Pose().mirrored
