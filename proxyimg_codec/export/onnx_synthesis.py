"""Export of the synthesis of a pyramid texture as ONNX: latents in, samples out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..texture import registered_model
from ..texture.grid import BANDS, Grid, mirrored_indices
from ..texture.latents import Latents
from ..texture.network import Floats
from ..texture.planes import Planes
from ..texture.synthesis import wavelet
from .onnx_graph import Graph, Value

if TYPE_CHECKING:
    import onnx

DOCUMENTATION = """\
Synthesis of a pyramid texture, for planes of the size and step of one file. Inputs are whole
numbers as decoded from the file, [1, channel, row, column]. `lowest` has the lowest planes of three
colours, 0 for luma, 1 and 2 for chroma. `level_k` has the latents of level k, 1 being the finest:
channel 3 * colour + band, band 0 is high-pass across, 1 high-pass down, 2 both. Its rows and
columns are those of the raster over 2 ** k, rounded up (in model 1 those of the raster padded to a
multiple of 2 ** levels). `samples` [1, row, column, component] is the raster without padding, row 0
on top: red, green and blue, or grey alone, straight, in 0..1."""


def feed(latents: Latents) -> dict[str, Floats]:
    """Inputs of the model by name, float32 [1, channels, rows, columns] each.

    Args:
        latents: Latents of the planes that the model was built for, from `Planes.latents`.
    """
    inputs = {f"level_{k}": y for k, y in enumerate(latents.levels, 1)} | {"lowest": latents.lowest}
    return {name: y[None].astype(np.float32) for name, y in inputs.items()}


def build(planes: Planes) -> onnx.ModelProto:
    """Builds the model: `lowest` [1, 3, h, w] and `level_k` [1, 9, h', w'] -> `samples`.

    All are float32. `samples` [1, rows, columns, components] in 0..1 are those of `Planes.raster`.
    Shapes are fixed: those of `Grid.at` for each level; the lowest planes have that of the coarsest
    level. Step and weights are initializers; there is no external data. The latents are not part of
    the model.

    Raises:
        UnsupportedError: onnx is not installed, or the model number of the planes is unknown.
    """
    graph = Graph()
    weights = registered_model.registered(planes.packed["model"])
    grid, step, (columns, rows) = Grid.of(planes.packed), planes.packed["step"], planes.size
    low = graph.input("lowest", np.float32, (1, 3, *grid.at(grid.levels)))
    for level in range(grid.levels, 0, -1):
        high = graph.input(f"level_{level}", np.float32, (1, 9, *grid.at(level)))
        net = weights.synthesis[min(level, len(weights.synthesis)) - 1]
        low = _finer(net, step, low, high, grid.at(level - 1))
    samples = _coloured(weights, planes, low)
    shape = 1, rows, columns, planes.components
    return graph.model("proxyimg_synthesis", [(samples, shape)], DOCUMENTATION)


def _finer(
    net: registered_model.Synthesis, step: int, low: Value, latents: Value, shape: tuple[int, int]
) -> Value:
    """Next finer planes [1, 3, *shape], as in `texture.synthesis`."""
    graph = low.graph
    t = np.float32((step - registered_model.STEP_ORIGIN) / 128)
    gain = np.exp(net.gain.floats + net.gain_by_step.floats * t).reshape(1, 9, 1, 1)
    high = latents * gain
    ring = np.array([0, 0, 1, 1, 0, 0, 1, 1])
    around = graph.op("AveragePool", graph.op("Pad", low, ring, mode="edge"), kernel_shape=[3, 3])
    inputs = graph.concat([low - around, high], 1)
    z = inputs / (inputs.abs() * (1 / 8) + 1)
    first_bias = net.first_bias.floats + net.first_by_step.floats * t
    z = graph.op("Relu", graph.op("Conv", z, net.first.floats, first_bias, pads=[1] * 4))
    second = net.second.floats[..., None, None]
    z = graph.op("Relu", graph.op("Conv", z, second, net.second_bias.floats))
    z = graph.op("Conv", z, net.third.floats, net.third_bias.floats, pads=[1] * 4)
    linear = (wavelet() + net.delta.floats).astype(np.float32)
    straight = graph.op("Conv", _extended(low, high, shape), linear)
    cells = graph.op("DepthToSpace", straight + z, blocksize=2, mode="CRD")
    return graph.op("Slice", cells, np.array([0, 0]), np.array(shape), np.array([2, 3]))


def _extended(low: Value, high: Value, shape: tuple[int, int]) -> Value:
    """Low bands, then high bands [1, 12, h + 4, w + 4], mirrored as the wavelet needs it."""

    def mirrored(plane: Value, ways: tuple[int, int]) -> Value:
        for axis, n, way in zip((2, 3), shape, ways, strict=True):
            plane = plane.take(mirrored_indices(n, bool(way)), axis)
        return plane

    wide = [mirrored(low, (0, 0))]
    wide += [mirrored(high.take(np.arange(band, 9, 3), 1), ways) for band, ways in enumerate(BANDS)]
    return low.graph.concat(wide, 1)


def _coloured(weights: registered_model.Model, planes: Planes, low: Value) -> Value:
    """Output `samples` from the finest planes [1, 3, h, w]."""
    graph, (columns, rows) = low.graph, planes.size
    to_colour = weights.to_colour.floats * np.float32(2 ** (planes.packed["step"] / 64) / 255)
    if planes.components == 1:
        to_colour = to_colour.mean(0, keepdims=True)
    x = graph.op("Slice", low, np.array([0, 0]), np.array([rows, columns]), np.array([2, 3]))
    grey = np.full(planes.components, 128 / 255, np.float32)
    x = graph.op("Conv", x, to_colour[..., None, None], grey).clip(0, 1)
    return graph.op("Transpose", x, name="samples", perm=[0, 2, 3, 1])
