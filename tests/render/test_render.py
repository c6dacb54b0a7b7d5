import math

import numpy as np
import pytest

import proxyimg_codec as pxi
from proxyimg_codec.errors import LimitError, UnsupportedError, UsageError
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.model import Layer, Layers
from proxyimg_codec.native import kernel
from proxyimg_codec.render import compose
from proxyimg_codec.texture.implicit import ImplicitTexture
from proxyimg_codec.texture.network import NetShape, Network
from tests.support.images import image as image_of
from tests.support.textures import ENGINES, random_network


def constant(*output):
    """A network that always gives `output`."""
    shape = NetShape(1, 0, 1, 1, len(output))
    zeros = tuple(np.zeros((o, i), np.int8) for i, o in shape.layers)
    biases = np.array([0, *output], np.float16)
    return Network(shape, 8, zeros, np.ones(shape.rows, np.float16), biases)


def plane(network):
    zeros = np.zeros((1, 2, 2), np.int8)
    return ImplicitTexture(network, 2, np.ones(1, np.float16), zeros, np.ones((2, 2), bool))


def square(x0, y0, x1, y1, hole=False):
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    corners = corners[::-1] if hole else corners
    return np.repeat(corners * 64, 3, axis=0)  # straight segments with handles on their ends


def stack(*layers, size=(20, 12), opaque=None):
    """An image of constant layers: (output, paths or None), back to front."""
    networks = tuple(constant(*output) for output, _ in layers)
    channels = len(layers[0][0])
    items = [
        Layer(f"layer {k}", (0, 0, *size), None if p is None else Boundary(6, tuple(p)), plane(k))
        for k, (_, p) in enumerate(layers)
    ]
    if opaque is None:
        opaque = channels == 3 and layers[0][1] is None
    return image_of(*size, channels, opaque, 8, Layers(items), networks)


RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def test_front_layers_hide_and_holes_show():
    image = stack((RED, None), (GREEN, [square(4, 2, 16, 10), square(8, 4, 12, 8, hole=True)]))
    out = image.render()
    assert out.shape == (12, 20, 3)
    expected = np.zeros((12, 20, 3), np.uint8)
    expected[:] = (255, 0, 0)
    expected[2:10, 4:16] = (0, 255, 0)
    expected[4:8, 8:12] = (255, 0, 0)
    assert (out == expected).all()


def test_partial_coverage_mixes():
    image = stack((RED, None), (GREEN, [square(0, 0, 10, 12)]))
    moved = Boundary(6, (image.layers[1].boundary.paths[0] + np.array([16, 0]),))
    layer = Layer("edge", (0, 0, 20, 12), moved, plane(1))
    image = image_of(20, 12, 3, True, 8, Layers([image.layers[0], layer]), image.networks)
    assert image.render()[5, 10].tolist() == [191, 64, 0]
    assert image.render()[5, 0].tolist() == [64, 191, 0]


def test_without_back_layer_output_has_alpha():
    image = stack((RED, None), (GREEN, [square(4, 2, 16, 10)]))
    out = image.render(background=False)
    assert out.shape == (12, 20, 4)
    assert out[5, 5].tolist() == [0, 255, 0, 255]
    assert out[0, 0].tolist() == [0, 0, 0, 0]
    assert (image.render(layers=["layer 1"]) == out).all()
    assert (image.render(layers=[0]) == (255, 0, 0)).all()


def test_soft_alpha_composites_premultiplied():
    image = stack(((0.25, 0, 0, 0.25), None), ((0, 0.5, 0, 0.5), None))
    out = image.render(dtype=np.float32)
    alpha = 0.5 + 0.5 * 0.25
    assert np.allclose(out[0, 0], (0.125 / alpha, 0.5 / alpha, 0, alpha), atol=1e-6)


def test_outputs_are_clamped():
    assert (stack(((2.0, -1.0, 0.5), None)).render()[0, 0] == (255, 0, 128)).all()
    out = stack(((0.9, 0.2, 0, 0.5), None)).render(dtype=np.float32)
    assert np.allclose(out[0, 0], (1, 0.4, 0, 0.5), atol=1e-3)


def test_reducing_averages():
    image = stack((RED, None), (BLUE, [square(0, 0, 10, 12)]), size=(20, 12))
    out = image.render(width=1, height=1)
    assert out[0, 0].tolist() == [128, 0, 128]


def test_regions_and_tiles_are_parts_of_the_whole(small_pxi, monkeypatch):
    image = pxi.open(small_pxi)
    whole = image.render(scale=3, engine="numpy")
    part = image.render(region=(10, 7, 20, 15), scale=3, engine="numpy")
    assert np.abs(whole[21:66, 30:90].astype(int) - part).max() <= 1
    small = image.render(width=9, engine="numpy")
    for samples in (50, 1000, 5000):
        monkeypatch.setattr(compose, "TILE_SAMPLES", samples)
        assert (image.render(scale=3, engine="numpy") == whole).all()
        assert (image.render(width=9, engine="numpy") == small).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_agree(engine, small_pxi):
    image = pxi.open(small_pxi)
    reference = image.render(engine="numpy", scale=2, dtype=np.float32)
    assert np.abs(image.render(engine=engine, scale=2, dtype=np.float32) - reference).max() < 1e-3


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_agree_on_any_network(engine):
    rng = np.random.default_rng(0)
    network = random_network(NetShape(5, 6, 13, 3, 4), 8)
    codes = rng.integers(-8, 8, (5, 7, 9)).astype(np.int8)
    texture = ImplicitTexture(0, 4, np.full(5, 0.1, np.float16), codes, rng.random((7, 9)) < 0.7)
    image = image_of(
        33, 21, 4, False, 8, Layers([Layer("a", (0, 0, 33, 21), None, texture)]), (network,)
    )
    reference = image.render(engine="numpy", dtype=np.float32)
    assert np.abs(image.render(engine=engine, dtype=np.float32) - reference).max() < 2e-3


def test_depths(small_pxi):
    image = pxi.open(small_pxi)
    real = image.render(dtype=np.float32)
    for dtype in (np.uint8, np.uint16):
        out = image.render(dtype=dtype)
        assert out.dtype == dtype
        assert (out == np.rint(real * np.iinfo(dtype).max)).all()


@pytest.mark.parametrize(
    ("request_", "error"),
    [
        ({"dtype": np.int32}, UsageError),
        ({"layers": ["nobody"]}, UsageError),
        ({"layers": [7]}, UsageError),
        ({"layers": []}, UsageError),
        ({"layers": [0], "background": False}, UsageError),
        ({"engine": "magic"}, UsageError),
        ({"engine": []}, UsageError),
        ({"layers": "disc"}, UsageError),
        ({"limits": 3}, UsageError),
        ({"limits": {"output_pixels": 9}}, UsageError),
        ({"progress": 1}, UsageError),
        ({"layers": 2}, UsageError),
        ({"layers": [1.0]}, UsageError),
        ({"layers": [None]}, UsageError),
        ({"layers": [slice(0, 2)]}, UsageError),
        ({"scale": "2"}, UsageError),
        ({"scale": [2, 2]}, UsageError),
        ({"scale": 1j}, UsageError),
        ({"scale": 10**400}, UsageError),
        ({"region": ()}, UsageError),
        ({"region": (1, 2, 3)}, UsageError),
        ({"region": 7}, UsageError),
        ({"width": "9"}, UsageError),
        ({"t": 0.5}, UsageError),
        ({"scale": 1e4}, LimitError),
    ],
)
def test_senseless_requests_are_refused(request_, error, small_pxi):
    with pytest.raises(error):
        pxi.open(small_pxi).render(**request_)


@pytest.mark.parametrize("t", ["1", [1], math.nan, math.inf, 10**400, 1j])
def test_senseless_times_are_refused(t, moving_pxi):
    with pytest.raises(UsageError, match="t = "):
        pxi.open(moving_pxi).render(t=t)


@pytest.mark.parametrize("where", ["compose.engines.find", "pixels._finished"])
def test_too_little_memory_is_a_limit(where, small_pxi, monkeypatch):
    def fails(*_):
        raise MemoryError

    monkeypatch.setattr(f"proxyimg_codec.render.{where}", fails)
    with pytest.raises(LimitError, match="memory to draw"):
        pxi.open(small_pxi).render()


def test_missing_engines_are_named(small_pxi, monkeypatch):
    monkeypatch.setattr(kernel, "available", lambda: False)
    with pytest.raises(UnsupportedError, match="native"):
        pxi.open(small_pxi).render(engine="native")


def test_layers_by_name_and_position(small_pxi):
    layers = pxi.open(small_pxi).layers
    assert [v.name for v in layers] == ["back", "bar", "disc"]
    assert layers["disc"] is layers[2] is layers[-1]
    assert layers[1:] == (layers[1], layers[2])


def test_memory_is_bounded_by_tiles():
    """A picture of 4 Mpx with 64 MB of output needs little beside it."""
    import tracemalloc

    image = stack((RED, None), (GREEN, [square(4, 2, 16, 10)]))
    tracemalloc.start()
    out = image.render(width=2400, height=1440, engine="numpy")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < out.nbytes + 80e6
