"""Engine ``ort``: ONNX Runtime runs the decoder network on features gathered by numpy."""

from __future__ import annotations

import numpy as np

from ..errors import UnsupportedError
from ..render.engines import in_chunks
from ..texture.implicit import ImplicitTexture, Taps
from ..texture.network import Floats, Network

try:
    import onnx  # noqa: F401  # imported here so that it fails before any work is done
    import onnxruntime  # noqa: F401
except ImportError:
    raise UnsupportedError(
        "engine ort needs onnxruntime and onnx: pip install 'proxyimg-codec[ort]'"
    ) from None

from .onnx_network import session


def run(texture: ImplicitTexture, network: Network, taps: Taps) -> Floats:
    """Colours float32 [N, channels] at N points, not clamped; see `render.engines`."""
    run_network = session(network)
    out = np.empty((len(taps.base), network.shape.channels), np.float32)
    for at, part in in_chunks(taps):
        out[at] = run_network(texture.features(part))
    return out
