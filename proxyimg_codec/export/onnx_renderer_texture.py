"""Textures in the renderer as ONNX: TEX-10 to TEX-23, PYR-43 and PYR-44."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import COLOUR_BITS, OPACITY_MAX, Pose
from ..model import Layer, Picture
from ..render.neighbours import moved_neighbours
from ..texture import diffusion, node_sampling
from ..texture.cubic import TAPS
from ..texture.implicit import ImplicitTexture
from ..texture.network import Floats
from ..texture.pyramid import PyramidTexture
from .onnx_graph import Graph, Value
from .onnx_network import forward
from .onnx_renderer_warp import Shown

SAMPLE_ONE = 65535
"""Integer that stands for the sample 1.0 of a raster in the model."""


def colour(picture: Picture, layer: Layer, drawn: frozenset[Layer], shown: Shown) -> Value:
    """Premultiplied colour and alpha float32 [N, 4] of a layer in its pose.

    Args:
        picture: The picture.
        layer: The layer.
        drawn: All layers that are drawn.
        shown: The texture points of the samples.
    """
    texture, graph = layer.texture, shown.points.graph
    if isinstance(texture, PyramidTexture):
        padded = texture.padded(moved_neighbours(picture, layer, drawn))
        found, channels = _sampled(layer, texture, padded, shown.points), texture.channels(())
    else:
        network = picture.network_of(layer)
        assert network is not None, "an implicit texture has a network"
        if layer.sampling:
            features = _at_nodes(picture, layer, texture, shown)
        else:
            features = _features(layer, texture, shown)
        found, channels = forward(network, features), network.shape.channels
    return _posed(layer.pose, _premultiplied(graph, found, channels))


def _premultiplied(graph: Graph, output: Value, channels: int) -> Value:
    """Premultiplied colour, as `render.compose.premultiplied`."""
    output = graph.where(
        graph.op("IsNaN", output, dtype=bool), graph.constant(np.array(0, np.float32)), output
    )
    output = output.clip(0, 1)
    if channels == 4:
        alpha = output.take(np.array([3]), 1)
        return output.minimum(alpha)
    alpha = output.take(np.array([0]), 1) * 0 + 1
    return graph.concat([output, alpha], 1)


def _posed(pose: Pose, colour: Value) -> Value:
    """Colour changed by the pose of a layer, as in `render.compose`."""
    graph = colour.graph
    if pose.colour:
        matrix = np.array(pose.colour, np.float32).reshape(3, 4).T / (1 << COLOUR_BITS)
        alpha = colour.take(np.array([3]), 1)
        mixed = graph.op("MatMul", colour, matrix).clip(0, alpha)
        colour = graph.concat([mixed, alpha], 1)
    return colour if pose.opacity == OPACITY_MAX else colour * (pose.opacity / OPACITY_MAX)


def _features(layer: Layer, texture: ImplicitTexture, shown: Shown) -> Value:
    """Features float32 [N, D] at points [TEX-11, TEX-12]."""
    graph = shown.points.graph
    columns, rows = texture.grid
    x0, y0, width, height = layer.box
    ix, fx = _before(shown.points, 0, x0, (columns - 1) / width, columns)
    iy, fy = _before(shown.points, 1, y0, (rows - 1) / height, rows)
    corners = np.array([0, 1, columns, columns + 1])
    across = graph.concat([1 - fx, fx, 1 - fx, fx], 1)
    down = graph.concat([1 - fy, 1 - fy, fy, fy], 1)
    found = _gathered(_codes(texture), iy * columns + ix + corners, across * down)
    return found * (texture.steps.astype(np.float32) / (1 << diffusion.FRACTION_BITS))


def _codes(texture: ImplicitTexture) -> NDArray[np.int16]:
    """Codes, filled where none are stored, int16 [rows * columns, D] in 1/256 code."""
    filled = diffusion.fill(texture.codes, texture.stored)
    return np.moveaxis(filled, 0, -1).reshape(-1, len(texture.steps)).astype(np.int16)


def _gathered(table: NDArray[Any], index: Value, weights: Value) -> Value:
    """Weighted sums float32 [N, C] of rows of a table.

    Args:
        table: [R, C] table.
        index: int64 [N, taps] rows.
        weights: float32 [N, taps].
    """
    rows = index.graph.constant(table).take(index).astype(np.float32)
    return (rows * weights.reshape(0, -1, 1)).reduced("Sum", 1)


def _before(points: Value, axis: int, start: int, scale: float, count: int) -> tuple[Value, Value]:
    """Codes before points on an axis, int64 [N, 1], and fractions to the next, float32 [N, 1]."""
    at = ((points.take(np.array([axis]), 1) - start) * scale).clip(0, count - 1)
    before = at.floor().minimum(count - 2)
    return before.astype(np.int64), (at - before).astype(np.float32)


def _at_nodes(picture: Picture, layer: Layer, texture: ImplicitTexture, shown: Shown) -> Value:
    """Features float32 [N, D] of a layer with node sampling [TEX-20, TEX-21, TEX-22, TEX-23]."""
    graph, parts = shown.points.graph, []
    if layer.sampling != node_sampling.GLOBAL:
        assert layer.mesh is not None, "local features need a mesh"
        assert shown.face is not None
        assert shown.weights is not None
        refined = layer.mesh.refined
        features = node_sampling.at(texture, layer.box, refined.nodes / (1 << FRACTION_BITS))
        corners = graph.constant(features[refined.faces]).take(shown.face)  # [N, 3, D]
        parts.append((corners * shown.weights.reshape(0, -1, 1)).reduced("Sum", 1))
    if layer.sampling != node_sampling.LOCAL:
        anchors = node_sampling.anchors(layer.boundary, picture.size)
        features = node_sampling.at(texture, layer.box, anchors)
        away = [shown.points.take(np.array([k]), 1) - anchors[:, k] for k in (0, 1)]  # [N, S]
        shares = 1 / (away[0] * away[0] + away[1] * away[1]).maximum(node_sampling.NEAR)
        total = shares.reduced("Sum", 1).reshape(-1, 1)
        parts.append(graph.op("MatMul", shares, features) / total)
    return graph.concat(parts, 1).astype(np.float32)


def _sampled(layer: Layer, texture: PyramidTexture, padded: Floats, points: Value) -> Value:
    """Raster interpolated by cubic convolution, float32 [N, channels], not clamped [PYR-43]."""
    stride = padded.shape[1]
    table = np.rint(padded.reshape(-1, padded.shape[2]) * SAMPLE_ONE).astype(np.uint16)
    columns, across = _taps(points, 0, layer.box[0], layer.box[2], texture.part[2])
    rows, down = _taps(points, 1, layer.box[1], layer.box[3], texture.part[3])
    offsets = np.add.outer(np.arange(TAPS) * stride, np.arange(TAPS)).ravel()
    weights = (down.reshape(0, TAPS, 1) * across.reshape(0, 1, TAPS)).reshape(0, TAPS * TAPS)
    found = _gathered(table, rows * stride + columns + offsets, weights)
    return found * (1 / SAMPLE_ONE)


def _taps(points: Value, axis: int, start: int, extent: int, samples: int) -> tuple[Value, Value]:
    """Sample before each point on an axis, int64 [N, 1], and weights float32 [N, 4]."""
    at = (points.take(np.array([axis]), 1) - start) * (samples / extent) - 0.5
    at = at.clip(0, samples - 1)
    before = at.floor()
    f = (at - before).astype(np.float32)
    weights = [
        ((2 - f) * f - 1) * f * 0.5,
        ((3 * f - 5) * f * f + 2) * 0.5,
        ((4 - 3 * f) * f + 1) * f * 0.5,
        (f - 1) * f * f * 0.5,
    ]
    return before.astype(np.int64), points.graph.concat(weights, 1)
