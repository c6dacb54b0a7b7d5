"""Random networks and textures, and who runs them."""

import importlib.util

import numpy as np
import pytest

from proxyimg_codec.native import kernel
from proxyimg_codec.texture.implicit import ImplicitTexture
from proxyimg_codec.texture.network import Network


def random_network(shape, bits, seed=0):
    rng = np.random.default_rng(seed)
    top = 1 << (bits - 1)
    return Network(
        shape,
        bits,
        tuple(rng.integers(-top, top, (o, i)).astype(np.int8) for i, o in shape.layers),
        rng.uniform(0.5, 2, shape.rows).astype(np.float16) / top,
        rng.normal(0, 0.3, shape.rows).astype(np.float16),
    )


def texture(bits=4, stored=None, rows=6, columns=9):
    rng = np.random.default_rng(bits)
    stored = np.ones((rows, columns), bool) if stored is None else stored
    top = 1 << (bits - 1)
    codes = np.where(stored, rng.integers(-top, top, (3, rows, columns)), 0).astype(np.int8)
    steps = np.array([0.1, 0.25, 0.5], np.float16)
    return ImplicitTexture(0, bits, steps, codes, stored)


ORT = all(map(importlib.util.find_spec, ("onnx", "onnxruntime")))

ENGINES = [
    "numpy",
    pytest.param("ort", marks=pytest.mark.skipif(not ORT, reason="ONNX Runtime is not installed")),
    pytest.param(
        "native", marks=pytest.mark.skipif(not kernel.available(), reason="kernel not compiled")
    ),
]
