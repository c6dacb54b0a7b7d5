"""Export of a decoder network as ONNX: features in, colour out."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..texture.network import Floats, Network
from .onnx_graph import Graph, Value

if TYPE_CHECKING:
    import onnx


def build(network: Network) -> onnx.ModelProto:
    """Builds the model: `features` float32 [N, D] -> `colour` float32 [N, channels], N dynamic.

    The model includes the frequency encoding, by double-angle formulas as in
    `texture.network.encode_features`. Weights are dequantized initializers; there is no external
    data. Outputs are not clamped.

    Raises:
        UnsupportedError: onnx is not installed.
    """
    graph = Graph()
    features = graph.input("features", np.float32, ["N", network.shape.dim])
    colour = forward(network, features, "colour")
    return graph.model("proxyimg_decoder", [(colour, ["N", network.shape.channels])])


def forward(network: Network, features: Value, name: str = "") -> Value:
    """Adds a decoder network to a graph.

    Args:
        network: The network.
        features: float32 [N, D]; the nodes are added to its graph.
        name: Name of the output.

    Returns:
        float32 [N, channels] colours, not clamped.
    """
    graph = features.graph
    x = _encoded(features, network.shape.octaves)
    for i, (weight, bias) in enumerate(network.layers):
        last = i + 1 == len(network.layers)
        x = graph.op("Gemm", x, weight, bias, transB=1, name=name if last else "")
        if not last:
            x = graph.op("Relu", x)
    return x


def _encoded(features: Value, octaves: int) -> Value:
    """Frequency encoding, as `texture.network.encode_features`."""
    graph, encoded = features.graph, [features]
    if octaves:
        angle = features * math.pi
        s, c = graph.op("Sin", angle), graph.op("Cos", angle)
        encoded += [s, c]
        for _ in range(1, octaves):
            twice = s * 2
            s, c = twice * c, 1 - twice * s
            encoded += [s, c]
    return graph.concat(encoded, 1)


@functools.lru_cache(maxsize=64)
def session(network: Network) -> Callable[[Floats], Floats]:
    """Function that runs a network in ONNX Runtime, on one thread.

    It maps features float32 [N, D] to colours float32 [N, channels], not clamped.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    run = onnxruntime.InferenceSession(
        build(network).SerializeToString(), options, providers=["CPUExecutionProvider"]
    )

    def call(features: Floats) -> Floats:
        colour: Floats = run.run(["colour"], {"features": features})[0]
        return colour

    return call
