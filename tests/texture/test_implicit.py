import numpy as np
import pytest

from proxyimg_codec.errors import FormatError
from proxyimg_codec.native import kernel
from proxyimg_codec.render import engines
from proxyimg_codec.texture.implicit import ImplicitTexture, pack, taps, unpack
from proxyimg_codec.texture.network import NetShape
from tests.support.textures import random_network, texture

NETWORK = random_network(NetShape(3, 1, 4, 1, 3), 8)


@pytest.mark.parametrize("bits", range(2, 9))
@pytest.mark.parametrize("partial", [False, True])
def test_textures_come_back(bits, partial):
    stored = np.random.default_rng(0).random((6, 9)) < 0.5 if partial else None
    a = texture(bits, stored)
    b = unpack(pack(a), (NETWORK,))
    assert (a.codes == b.codes).all()
    assert (a.stored == b.stored).all()
    assert (a.steps == b.steps).all()
    assert (a.table == b.table).all()


def test_corner_codes_sit_on_the_corners_of_the_box():
    t = texture()
    x, y = np.array([10.0, 26.0, 10.0, 26.0]), np.array([5.0, 5.0, 20.0, 20.0])
    f = t.features(t.taps(x, y, (10, 5, 16, 15)))
    corners = t.codes[:, [0, 0, -1, -1], [0, -1, 0, -1]].T * t.steps.astype(np.float32)
    assert np.allclose(f, corners, atol=1e-6)


def test_features_are_bilinear_and_clamped():
    t = texture()
    box = (0, 0, 80, 50)
    x = np.array([15.0, -30.0, 200.0])
    f = t.features(t.taps(x, np.full(3, 25.0), box))
    values = t.codes * t.steps.astype(np.float32)[:, None, None]
    middle = (values[:, 2] + values[:, 3]) / 2
    assert np.allclose(f[0], (middle[:, 1] + middle[:, 2]) / 2, atol=1e-6)
    assert np.allclose(f[1], middle[:, 0], atol=1e-6)
    assert np.allclose(f[2], middle[:, -1], atol=1e-6)


def test_features_between_four_codes():
    t = texture()
    values = np.moveaxis(t.codes * t.steps.astype(np.float32)[:, None, None], 0, -1)
    x, y = np.array([21.0, 70.0]), np.array([12.0, 49.0])  # tenths of a column and of a row
    f = t.features(t.taps(x, y, (0, 0, 80, 50)))
    for k, (ix, iy, fx, fy) in enumerate([(2, 1, 0.1, 0.2), (7, 4, 0.0, 0.9)]):
        top = values[iy, ix] * (1 - fx) + values[iy, ix + 1] * fx
        bottom = values[iy + 1, ix] * (1 - fx) + values[iy + 1, ix + 1] * fx
        assert np.allclose(f[k], top * (1 - fy) + bottom * fy, atol=1e-6)


@pytest.mark.skipif(not kernel.available(), reason="kernel not compiled")
@pytest.mark.parametrize(
    "shape",
    [
        NetShape(8, 5, 32, 2, 3), NetShape(19, 1, 15, 1, 4), NetShape(16, 0, 8, 3, 3),
        NetShape(3, 6, 1, 2, 4),
    ],
)  # fmt: skip
def test_kernel_does_what_numpy_does(shape):
    """Whole vectors of features and tiles of rows, and what is left; any count of points."""
    rng = np.random.default_rng(1)
    codes = rng.integers(-8, 8, (shape.dim, 7, 9)).astype(np.int8)
    steps = np.full(shape.dim, 0.3, np.float16)
    plane = ImplicitTexture(0, 4, steps, codes, np.ones((7, 9), bool))
    network = random_network(shape, 8)
    at = plane.taps(rng.uniform(-5, 90, 1000), rng.uniform(-5, 60, 1000), (0, 0, 80, 50))
    whole = engines.run_native(plane, network, at)
    reference = engines.run_numpy(plane, network, at)
    assert np.abs(whole - reference).max() < 2e-4 * np.abs(reference).max()
    for some in (slice(0, 0), slice(5, 6), slice(9, 265), slice(700, None)):
        part = at._replace(base=at.base[some], fx=at.fx[some], fy=at.fy[some])
        assert (engines.run_native(plane, network, part) == whole[some]).all()


def test_taps_never_leave_the_plane():
    x = np.linspace(-5, 25, 61)
    t = taps(x, x, (0, 0, 20, 20), 2, 2)
    assert (t.base == 0).all()
    assert t.fx.min() == 0
    assert t.fx.max() == 1


@pytest.mark.parametrize(
    "change",
    [{"steps": b"\0\0" * 3}, {"steps": b"\0\x7c" * 3}, {"codes": b""}, {"grid": [9, 7]}],
)
def test_damage_is_found(change):
    with pytest.raises(FormatError):
        unpack({**pack(texture()), **change}, (NETWORK,))


@pytest.mark.parametrize("value", [True, False])
def test_a_full_or_empty_mask_is_not_canonical(value):
    from proxyimg_codec.entropy import arrays

    mask = arrays.encode(np.full((1, 6, 9), int(value)), 1, np.ones((6, 9), bool))
    with pytest.raises(FormatError, match="full or empty"):
        unpack({**pack(texture()), "stored": mask}, (NETWORK,))
