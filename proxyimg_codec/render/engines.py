"""Engines that run the decoder network. All give the same colours but for rounding.

An engine is a function from (texture, network, taps) to float32 [N, channels]. The engine `numpy`
is the readable reference with which the others have to agree.
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
"""Points computed at a time, few enough for their features to stay in the processor cache."""


def run_numpy(texture: ImplicitTexture, network: Network, taps: Taps) -> Floats:
    """Runs the network in numpy, with outputs float32 [N, channels] for taps of N points."""
    out = np.empty((len(taps.base), network.shape.channels), np.float32)
    for at, part in in_chunks(taps):
        out[at] = network(texture.features(part))
    return out


def run_native(texture: ImplicitTexture, network: Network, taps: Taps) -> Floats:
    """Runs the network in the compiled kernel; arguments and result are those of `run_numpy`."""
    shape, weights = _flat(network)
    stride = np.full(len(taps.base), taps.stride, np.int32)
    return kernel.forward(shape, texture.table, weights, taps.base, stride, taps.fx, taps.fy)


@functools.lru_cache(maxsize=64)
def _flat(network: Network) -> tuple[kernel.Net, Floats]:
    s = network.shape
    parts = [a.ravel() for layer in network.layers for a in layer]
    return kernel.Net(s.dim, s.octaves, s.hidden, s.depth, s.channels), np.concatenate(parts)


def run_features(network: Network, features: Floats) -> Floats:
    """Outputs float32 [N, channels] for given features float32 [N, D], computed in numpy."""
    out = np.empty((len(features), network.shape.channels), np.float32)
    for i in range(0, len(out), _CHUNK):
        at = slice(i, i + _CHUNK)
        out[at] = network(features[at])
    return out


def in_chunks(taps: Taps) -> Iterator[tuple[slice, Taps]]:
    """Divides taps into chunks for the processor cache, each with its place in the output."""
    for i in range(0, len(taps.base), _CHUNK):
        at = slice(i, i + _CHUNK)
        yield at, Taps(taps.base[at], taps.fx[at], taps.fy[at], taps.stride)


BUILT_IN: dict[str, Engine] = {"numpy": run_numpy, "native": run_native}
"""Engines that need no other package; further ones are plug-ins (`plugins`)."""


def find(name: str) -> Engine:
    """Finds an engine by name.

    Args:
        name: Name of the engine; ``auto`` is ``native`` if the kernel is available, else ``numpy``.

    Raises:
        UsageError: There is no engine of that name.
        UnsupportedError: The engine, or a package that it needs, is not installed.
    """
    if name == "auto":
        name = "native" if kernel.available() else "numpy"
    if name == "native" and not kernel.available():
        raise UnsupportedError("engine native: the kernel was not compiled at installation")
    if isinstance(name, str) and name in BUILT_IN:
        return BUILT_IN[name]
    known = [*BUILT_IN, *plugins.names("engines")]
    if name not in known:
        raise UsageError(f"engine {name!r} is unknown; choose auto, {', '.join(known)}")
    engine: Engine = plugins.find("engines", name)
    return engine
