"""The synthesis of a pyramid texture as ONNX: latents in, samples out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnsupportedError
from ..texture import model
from ..texture.network import Floats
from ..texture.planes import Latents, Planes
from ..texture.synthesis import BANDS, mirrored_indices, wavelet
from .onnx_network import IR_VERSION, OPSET

if TYPE_CHECKING:
    import onnx

DOCUMENTATION = """\
Synthesis of a pyramid texture, for planes of the size and step of one file. Inputs are whole
numbers as decoded from the file, [1, channel, row, column]. `lowest` has the lowest planes of three
colours, 0 for luma, 1 and 2 for chroma. `level_k` has the latents of level k, 1 being the finest:
channel 3 * colour + band, band 0 is high-pass across, 1 high-pass down, 2 both. Its rows and
columns are those of the raster, padded to a multiple of 2 ** levels, over 2 ** k. `samples`
[1, row, column, component] is the raster without padding, row 0 on top: red, green and blue, or
grey alone, straight, in 0..1."""


def feed(latents: Latents) -> dict[str, Floats]:
    """Latents as the model takes them: inputs by name.

    Args:
        latents: Those of the planes that the model was built for: `Planes.latents`.
    """
    inputs = {f"level_{k}": y for k, y in enumerate(latents.levels, 1)} | {"lowest": latents.lowest}
    return {name: y[None].astype(np.float32) for name, y in inputs.items()}


def build(planes: Planes) -> onnx.ModelProto:
    """The model: `lowest` float32 [1, 3, h, w], `level_k` float32 [1, 9, ..] -> `samples`.

    `samples` are float32 [1, rows, columns, components] in 0..1, those of `Planes.raster`. Shapes
    are fixed: with L levels, level k has ceil(rows / 2**L) 2**(L - k) rows, columns likewise, and
    the lowest planes have those of level L. Step and weights are initializers, no external data.
    The latents are not inside.

    Raises:
        UnsupportedError: onnx is not installed, or the model of the planes is not known.
    """
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError:
        raise UnsupportedError("ONNX needs onnx: pip install 'proxyimg-codec[ort]'") from None
    weights = model.registered(planes.packed["model"])
    levels, step, (columns, rows) = planes.packed["levels"], planes.packed["step"], planes.size
    h, w = (-(-n >> levels) for n in (rows, columns))
    shapes = {"lowest": (1, 3, h, w)}
    parts, low = _Parts(), "lowest"
    for level in range(levels, 0, -1):
        shapes[f"level_{level}"] = (1, 9, h, w)
        low = _finer(parts, weights, step, level, low, (h, w))
        h, w = 2 * h, 2 * w
    _coloured(parts, weights, planes, low)

    def described(name: str, shape: tuple[int, ...]) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

    graph = helper.make_graph(
        parts.nodes,
        "proxyimg_synthesis",
        [described(*item) for item in shapes.items()],
        [described("samples", (1, rows, columns, planes.components))],
        [numpy_helper.from_array(np.ascontiguousarray(v), n) for n, v in parts.constants.items()],
        doc_string=DOCUMENTATION,
    )
    made = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION,
        producer_name="proxyimg-codec",
    )  # fmt: skip
    onnx.checker.check_model(made)
    return made


class _Parts:
    """Nodes and initializers of a graph."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: dict[str, NDArray[Any]] = {}

    def constant(self, name: str, value: NDArray[Any]) -> str:
        """Adds an initializer; what has the same name is the same."""
        self.constants[name] = value
        return name

    def add(self, op: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Adds a node with one output."""
        from onnx import helper

        self.nodes.append(helper.make_node(op, inputs, [output], name=output, **attributes))
        return output


def _finer(
    parts: _Parts, weights: model.Model, step: int, level: int, low: str, shape: tuple[int, int]
) -> str:
    """The next finer planes [1, 3, 2h, 2w]; as in `texture.synthesis`."""
    number = min(level, len(weights.synthesis))
    net = weights.synthesis[number - 1]
    t = np.float32((step - model.STEP_ORIGIN) / 128)
    arrays = {
        "gain": np.exp(net.gain.floats + net.gain_by_step.floats * t).reshape(1, 9, 1, 1),
        "linear": (wavelet() + net.delta.floats).astype(np.float32),
        "first": net.first.floats,
        "first_bias": net.first_bias.floats + net.first_by_step.floats * t,
        "second": net.second.floats[..., None, None],
        "second_bias": net.second_bias.floats,
        "third": net.third.floats,
        "third_bias": net.third_bias.floats,
    }
    own = {n: parts.constant(f"set_{number}_{n}", v) for n, v in arrays.items()}

    def add(op: str, inputs: list[str], output: str, **attributes: Any) -> str:
        return parts.add(op, inputs, f"{output}_{level}", **attributes)

    high = add("Mul", [f"level_{level}", own["gain"]], "high")
    ring = parts.constant("ring", np.array([0, 0, 1, 1, 0, 0, 1, 1], np.int64))
    padded = add("Pad", [low, ring], "padded", mode="edge")
    around = add("AveragePool", [padded], "around", kernel_shape=[3, 3])
    inputs = add("Concat", [add("Sub", [low, around], "rough"), high], "inputs", axis=1)
    eighth = parts.constant("eighth", np.array(1 / 8, np.float32))
    one = parts.constant("one", np.array(1, np.float32))
    size = add("Mul", [add("Abs", [inputs], "magnitude"), eighth], "size")
    z = add("Div", [inputs, add("Add", [size, one], "divisor")], "soft")
    for name, pads in (("first", 1), ("second", 0)):
        z = add("Conv", [z, own[name], own[f"{name}_bias"]], name, pads=[pads] * 4)
        z = add("Relu", [z], f"{name}_relu")
    z = add("Conv", [z, own["third"], own["third_bias"]], "third", pads=[1] * 4)
    straight = add("Conv", [_extended(parts, level, low, high, shape), own["linear"]], "straight")
    cells = add("Add", [straight, z], "cells")
    return add("DepthToSpace", [cells], "planes", blocksize=2, mode="CRD")


def _extended(parts: _Parts, level: int, low: str, high: str, shape: tuple[int, int]) -> str:
    """Low and then high bands [1, 12, h + 4, w + 4], mirrored as the wavelet needs it."""

    def mirrored(name: str, plane: str, ways: tuple[int, int]) -> str:
        for axis, side, n, way in zip((2, 3), ("rows", "columns"), shape, ways, strict=True):
            index = parts.constant(f"{side}_{way}_{level}", mirrored_indices(n, bool(way)))
            plane = parts.add("Gather", [plane, index], f"{name}_{side}_{level}", axis=axis)
        return plane

    wide = [mirrored("low", low, (0, 0))]
    for band, ways in enumerate(BANDS):
        index = parts.constant(f"channels_{band}", np.arange(band, 9, 3))
        plane = parts.add("Gather", [high, index], f"band_{band}_{level}", axis=1)
        wide.append(mirrored(f"band_{band}", plane, ways))
    return parts.add("Concat", wide, f"extended_{level}", axis=1)


def _coloured(parts: _Parts, weights: model.Model, planes: Planes, low: str) -> str:
    """`samples` of the finest planes [1, 3, h, w]."""
    columns, rows = planes.size
    to_colour = weights.to_colour.floats * np.float32(2 ** (planes.packed["step"] / 64) / 255)
    if planes.components == 1:
        to_colour = to_colour.mean(0, keepdims=True)
    corners = [
        parts.constant("corner", np.array([0, 0])),
        parts.constant("raster", np.array([rows, columns])),
        parts.constant("down_and_across", np.array([2, 3])),
    ]
    x = parts.add("Slice", [low, *corners], "cropped")
    colour = [
        parts.constant("to_colour", to_colour[..., None, None]),
        parts.constant("grey", np.full(planes.components, 128 / 255, np.float32)),
    ]
    x = parts.add("Conv", [x, *colour], "colour")
    limits = [parts.constant(f"limit_{v}", np.array(v, np.float32)) for v in (0, 1)]
    x = parts.add("Clip", [x, *limits], "clipped")
    return parts.add("Transpose", [x], "samples", perm=[0, 2, 3, 1])
