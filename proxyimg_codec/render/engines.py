"""Engines: who runs the decoder network. All give the same colours within rounding.

An engine is a function from (texture, network, taps) to float32 [N, channels]; `numpy` is the
readable reference that the others are judged by.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np

from .. import plugins
from ..errors import UnsupportedError, UsageError
from ..native import kernel
from ..texture.implicit import ImplicitTexture, Taps
from ..texture.network import Floats, Network

Engine = Callable[[ImplicitTexture, Network, Taps], Floats]

_CHUNK = 4096
"""Points at a time: the encoded features then stay in the cache."""


def run_numpy(texture: ImplicitTexture, network: Network, taps: Taps) -> Floats:
    """Plain numpy."""
    out = np.empty((len(taps.base), network.shape.channels), np.float32)
    for at, part in in_chunks(taps):
        out[at] = network(texture.features(part))
    return out


def run_native(texture: ImplicitTexture, network: Network, taps: Taps) -> Floats:
    """The compiled kernel."""
    shape, weights = _flat(network)
    stride = np.full(len(taps.base), taps.stride, np.int32)
    return kernel.forward(shape, texture.table, weights, taps.base, stride, taps.fx, taps.fy)


@functools.lru_cache(maxsize=64)
def _flat(network: Network) -> tuple[kernel.Net, Floats]:
    s = network.shape
    parts = [a.ravel() for layer in network.layers for a in layer]
    return kernel.Net(s.dim, s.octaves, s.hidden, s.depth, s.channels), np.concatenate(parts)


def run_features(network: Network, features: Floats) -> Floats:
    """Outputs [N, channels] for features [N, D] that do not come from taps, in plain numpy."""
    out = np.empty((len(features), network.shape.channels), np.float32)
    for i in range(0, len(out), _CHUNK):
        at = slice(i, i + _CHUNK)
        out[at] = network(features[at])
    return out


def in_chunks(taps: Taps) -> Iterator[tuple[slice, Taps]]:
    """Parts of taps that are run at a time, and where in the output they belong."""
    for i in range(0, len(taps.base), _CHUNK):
        at = slice(i, i + _CHUNK)
        yield at, Taps(taps.base[at], taps.fx[at], taps.fy[at], taps.stride)


BUILT_IN: dict[str, Engine] = {"numpy": run_numpy, "native": run_native}
"""Engines that need nothing else; others are plug-ins (`plugins`)."""


def find(name: str) -> Engine:
    """The engine called `name`; ``auto`` is ``native`` where it was built, else ``numpy``.

    Raises:
        UsageError: No such engine.
        UnsupportedError: It is not installed.
    """
    if name == "auto":
        name = "native" if kernel.available() else "numpy"
    if name == "native" and not kernel.available():
        raise UnsupportedError("engine native: the kernel was not compiled at installation")
    if name in BUILT_IN:
        return BUILT_IN[name]
    known = [*BUILT_IN, *plugins.names("engines")]
    if name not in known:
        raise UsageError(f"engine {name!r} is unknown; choose auto, {', '.join(known)}")
    engine: Engine = plugins.find("engines", name)
    return engine
