import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.errors import FormatError
from proxyimg_codec.texture.network import (
    BLOCK,
    LARGE_BLOCK,
    SMALL,
    NetShape,
    encode_features,
    pack,
    unpack,
)
from tests.support.textures import random_network


@settings(max_examples=20, deadline=None)
@given(
    st.builds(
        NetShape, st.integers(1, 9), st.integers(0, 6), st.integers(1, 20), st.integers(1, 3),
        st.integers(3, 4),
    ),
    st.integers(2, 8),
)  # fmt: skip
def test_networks_come_back(shape, bits):
    network = random_network(shape, bits)
    again = unpack(pack(network))
    assert again.shape == shape
    for a, b in zip(network.weights, again.weights, strict=True):
        assert (a == b).all()
    assert (again.steps == network.steps).all()
    assert (again.biases == network.biases).all()


def test_paper_arithmetic():
    """The paper's network, 672 -> 64 x 4 -> 3, has 55,747 parameters (compression table)."""
    assert NetShape(32, 10, 64, 4, 3).parameters == 55747
    assert NetShape(8, 6, 32, 2, 3).parameters + 83 * 83 * 8 == 59627


@pytest.mark.parametrize("scale", [1.2, 3000])
def test_encoding_is_the_sines_and_cosines(scale):
    f = np.random.default_rng(0).normal(0, scale, (500, 3)).astype(np.float32)
    out = encode_features(f, 6)
    exact = [f.astype(np.float64)]
    for k in range(6):
        exact += [np.sin(2**k * np.pi * exact[0]), np.cos(2**k * np.pi * exact[0])]
    assert out.shape == (500, 39)
    assert (out[:, :3] == f).all()
    assert np.abs(out - np.concatenate(exact, 1)).max() < 2e-5


def test_output_is_the_plain_mlp():
    network = random_network(NetShape(4, 2, 6, 2, 3), 8)
    f = np.random.default_rng(1).normal(0, 0.5, (7, 4)).astype(np.float32)
    x = encode_features(f, 2)
    ends = np.cumsum([6, 6])
    for k, (w, s, b) in enumerate(zip(
        network.weights, np.split(network.steps.astype(np.float32), ends),
        np.split(network.biases.astype(np.float32), ends), strict=True,
    )):  # fmt: skip
        x = x @ (w * s[:, None]).T + b
        x = np.maximum(x, 0) if k < 2 else x
    assert np.allclose(network(f), x, atol=1e-5)


@pytest.mark.parametrize("hidden", [13, 97])
def test_points_do_not_depend_on_each_other(hidden):
    """Bit for bit, whether the layers count as small or as large."""
    shape = NetShape(5, 4, hidden, 2, 3)
    network = random_network(shape, 8)
    assert max(i * o for i, o in shape.layers) * BLOCK > SMALL or hidden == 13
    for weight, _ in network.layers:
        point = np.random.default_rng(3).normal(0, 1, (weight.shape[1], 1)).astype(np.float32)
        for block in (BLOCK, LARGE_BLOCK):
            same = weight @ point.repeat(block, 1)
            if (same != same[:, :1]).any():
                pytest.skip("BLAS rounds by place within a product")
    f = np.random.default_rng(2).normal(0, 1, (5000, 5)).astype(np.float32)
    whole = network(f)
    assert whole.shape == (5000, 3)
    for part in (slice(0, 0), slice(3, 4), slice(70, 330), slice(1000, None), slice(None, None, 7)):
        assert (network(f[part]) == whole[part]).all()


@pytest.mark.parametrize(
    "change",
    [
        {"steps": b"\0"}, {"steps": b"\0\0" * 15}, {"biases": b"\0\x7e" * 15},
        {"weights": b""}, {"hidden": 7}, {"steps": b"\0\xbc" * 15},
    ],
)  # fmt: skip
def test_damage_is_found(change):
    fields = pack(random_network(NetShape(4, 1, 6, 2, 3), 8))
    with pytest.raises(FormatError):
        unpack({**fields, **change})
    with pytest.raises(FormatError):
        unpack({**fields, "weights": fields["weights"] + b"\0"})
