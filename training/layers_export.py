"""Exports the layers network: python -m training.layers_export STATE.pt OUT.onnx.zst."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
import zstandard
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from .layers_network import Block, LayersNetwork

Floats = NDArray[np.float32]

LEVELS = 63
"""Largest level of a weight: 7 bits, which are stored as bytes and compressed."""


class Graph:
    """ONNX graph in the making; names of values count up."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, values: NDArray[np.generic]) -> str:
        """Adds an initializer and returns its name."""
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def add(self, op: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        """Adds a node and returns the name of its output."""
        output = output or f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(op, list(inputs), [output], **attributes))
        return output

    def convolution(
        self, x: str, part: nn.Conv2d | nn.Linear, norm: nn.BatchNorm2d | None = None
    ) -> str:
        """Adds a convolution with the normalisation after it; its weights are small integers.

        Each output channel has its own scale; runtimes turn the weights to floats when they load.
        """
        weight = part.weight.detach().double()
        weight = weight if weight.ndim == 4 else weight[..., None, None]
        bias = (
            torch.zeros(len(weight)).double() if part.bias is None else part.bias.detach().double()
        )
        if norm is not None:
            assert norm.running_var is not None
            assert norm.running_mean is not None
            gain = norm.weight.detach() / torch.sqrt(norm.running_var + norm.eps)
            weight = weight * gain[:, None, None, None]
            bias = (bias - norm.running_mean) * gain + norm.bias.detach()
        scale = weight.abs().amax((1, 2, 3), keepdim=True).clamp_min(1e-12) / LEVELS
        levels = self.constant(torch.round(weight / scale).to(torch.int8).numpy())
        floats = self.add("Cast", levels, to=TensorProto.FLOAT)
        weights = self.add("Mul", floats, self.constant(_floats(scale)))
        options: dict[str, Any] = {}
        if isinstance(part, nn.Conv2d):
            pad = int(part.padding[0])
            options = {"pads": [pad] * 4, "strides": part.stride, "dilations": part.dilation}
        return self.add("Conv", x, weights, self.constant(_floats(bias)), **options)

    def block(self, x: str, part: Block) -> str:
        """Adds a residual block."""
        inner = self.add("Relu", self.convolution(x, part.first, part.first_norm))
        return self.add(
            "Relu", self.add("Add", x, self.convolution(inner, part.second, part.second_norm))
        )


def _floats(values: Tensor) -> Floats:
    return values.to(torch.float32).numpy()


def exported(model: LayersNetwork) -> onnx.ModelProto:
    """Turns a trained network into a model.

    Its input ``rgb`` is float32 [1, 3, H, W] in 0..1, sides multiples of 32. Its output ``maps`` is
    float32 [1, 4, H, W]: figure and boundary in 0..1, and the vector x, y of ownership.
    """
    g = Graph()
    centred = g.add("Sub", "rgb", g.constant(np.array(0.45, np.float32)))
    x = g.add("Mul", centred, g.constant(np.array(4, np.float32)))
    x = g.add("Relu", g.convolution(x, model.stem))
    kept = []
    for i, level in enumerate(model.levels):
        for block in level.children():
            x = g.block(x, block)  # type: ignore[arg-type] # a Block
        kept.append(x)
        if i < len(model.down):
            x = g.add("Relu", g.convolution(x, model.down[i]))  # type: ignore[arg-type] # a Conv2d
    whole = g.convolution(g.add("ReduceMean", x, axes=[2, 3]), model.whole)
    x = g.add("Relu", g.add("Add", g.add("Add", x, g.convolution(x, model.wide)), whole))
    sizes = g.constant(np.array([1, 1, 2, 2], np.float32))
    for i in reversed(range(len(model.up))):
        x = g.convolution(x, model.up[i])  # type: ignore[arg-type] # a Conv2d
        x = g.add(
            "Resize", x, "", sizes, mode="linear", coordinate_transformation_mode="half_pixel"
        )
        x = g.block(g.add("Relu", g.add("Add", x, kept[i])), model.joined[i])  # type: ignore[arg-type] # a Block
    x = g.add("DepthToSpace", g.convolution(x, model.head), blocksize=2, mode="CRD")
    halves = g.constant(np.array([2, 2]))
    g.nodes.append(helper.make_node("Split", [x, halves], ["logits", "owner"], axis=1))
    g.add("Concat", g.add("Sigmoid", "logits"), "owner", output="maps", axis=1)
    shapes = [["N", c, "H", "W"] for c in (3, 4)]
    graph = helper.make_graph(
        g.nodes,
        "layers",
        [helper.make_tensor_value_info("rgb", TensorProto.FLOAT, shapes[0])],
        [helper.make_tensor_value_info("maps", TensorProto.FLOAT, shapes[1])],
        g.constants,
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(made)
    return made


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("state", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    model = LayersNetwork()
    model.load_state_dict(torch.load(args.state)["average"])
    made = exported(model.eval()).SerializeToString(deterministic=True)
    content = zstandard.ZstdCompressor(level=19).compress(made)
    args.out.write_bytes(content)
    print(f"{args.out}: {len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()}")


if __name__ == "__main__":
    main()
