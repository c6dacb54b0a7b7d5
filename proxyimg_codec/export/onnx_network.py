"""The decoder network as ONNX: features in, colour out."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError
from ..texture.network import Floats, Network

if TYPE_CHECKING:
    import onnx

OPSET = 18
IR_VERSION = 8


def build(network: Network) -> onnx.ModelProto:
    """The model: `features` float32 [N, D] -> `colour` float32 [N, channels], N dynamic.

    The frequency encoding is inside, by double-angle formulas as in
    `texture.network.encode_features`; weights are dequantized initializers, no external data.
    Outputs are not clamped.

    Raises:
        UnsupportedError: onnx is not installed.
    """
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError:
        raise UnsupportedError("ONNX needs onnx: pip install 'proxyimg-codec[ort]'") from None
    nodes: list[onnx.NodeProto] = []
    constants: dict[str, NDArray[np.float32]] = {
        "pi": np.array(math.pi, np.float32),
        "one": np.array(1, np.float32),
        "two": np.array(2, np.float32),
    }

    def add(op: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(op, inputs, [output], name=output, **attributes))
        return output

    encoded = ["features"]
    if network.shape.octaves:
        angle = add("Mul", ["features", "pi"], "angle")
        s, c = add("Sin", [angle], "sin_0"), add("Cos", [angle], "cos_0")
        encoded += [s, c]
        for k in range(1, network.shape.octaves):
            twice = add("Mul", [s, "two"], f"twice_sin_{k}")
            square = add("Mul", [twice, s], f"two_sin_squared_{k}")
            s, c = add("Mul", [twice, c], f"sin_{k}"), add("Sub", ["one", square], f"cos_{k}")
            encoded += [s, c]
    x = add("Concat", encoded, "encoded", axis=1)
    for i, (weight, bias) in enumerate(network.layers):
        last = i + 1 == len(network.layers)
        constants[f"weight_{i}"], constants[f"bias_{i}"] = weight, bias
        name = "colour" if last else f"linear_{i}"
        x = add("Gemm", [x, f"weight_{i}", f"bias_{i}"], name, transB=1)
        if not last:
            x = add("Relu", [x], f"relu_{i}")
    graph = helper.make_graph(
        nodes,
        "proxyimg_decoder",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["N", network.shape.dim])],
        [helper.make_tensor_value_info("colour", TensorProto.FLOAT, ["N", network.shape.channels])],
        [numpy_helper.from_array(np.ascontiguousarray(v), n) for n, v in constants.items()],
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION,
        producer_name="proxyimg-codec",
    )  # fmt: skip
    onnx.checker.check_model(model)
    return model


@functools.lru_cache(maxsize=64)
def session(network: Network) -> Callable[[Floats], Floats]:
    """A function that runs the network in onnxruntime on one thread."""
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
