"""Export of the whole renderer as ONNX: canvas points in, colour out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..geometry.coverage import ONE
from ..model import Layer, Picture, Pictured
from ..render.neighbours import present_outline
from ..render.pixels import selected
from .onnx_graph import Graph, Value
from .onnx_renderer_coverage import chords, coverage
from .onnx_renderer_texture import colour
from .onnx_renderer_warp import locate

if TYPE_CHECKING:
    import onnx

BLOCK = 1024
"""Samples computed at a time; chords and faces that affect none of them are left out."""

DOCUMENTATION = f"""\
A picture as a function of the place: points of its canvas in, colours out.
`points` float64 [N, 2], N >= 1: x and y of the centres of samples in canvas pixels. x grows to the
right and y downwards from the upper left corner; the centre of the first pixel is (0.5, 0.5).
`pixel_size` float64 [2]: width and height of a sample in canvas pixels. Edges are smoothed over
that rectangle around each point.
`colour` float32 [N, 4]: red, green, blue and alpha in 0..1, premultiplied: straight colour is that
divided by alpha. Values are in the colour space of the picture, that of its ICC profile, or sRGB;
they are not linear light.
To render W by H pixels of a region of RW by RH canvas pixels whose corner is (X, Y), let a pixel
have ceil(RW / W) by ceil(RH / H) samples, at most 64 each way. With n of them in a row of the whole
region and m in a column, pixel_size is (RW / n, RH / m), and the points are X + (i + 0.5) RW / n,
Y + (j + 0.5) RH / m. A pixel is the mean of the premultiplied colours of its samples.
Curves are divided into chords for the scale that pixel_size asks for, so that they are smooth at
any. They are rounded to 1/256 sample, beginning at the first point of a call, and so are points
that are not whole samples away from it.
Points should go row by row, or at least follow on points near to them: {BLOCK} are computed at a
time, without what none of them can see. Memory is that of so many, whatever N is."""


def build(
    image: Pictured, layers: Sequence[str | int] | None = None, background: bool = True
) -> onnx.ModelProto:
    """Builds the model of a renderer.

    Its inputs are `points` float64 [N, 2] and `pixel_size` float64 [2], its output is `colour`
    float32 [N, 4]; `DOCUMENTATION` describes them.

    Args:
        image: A picture without motion; `render.moment.at` gives that of a moment.
        layers: Names or positions of the layers to draw; by default all that are not hidden.
        background: Whether to draw the back layer of an opaque picture.

    Raises:
        UsageError: A layer is unknown, or none is left to draw.
        UnsupportedError: onnx is not installed, or the model would be larger than 2 GiB.
    """
    picture = image.picture
    chosen = selected(picture, layers, background)
    graph = Graph()
    # Computations that decide about geometry are in double precision, as in the specification.
    points = graph.input("points", np.float64, ["N", 2])
    size = graph.input("pixel_size", np.float64, [2])
    first = points.take(0)
    corner = first - size / 2
    places = [(layer, present_outline(picture, layer)) for layer in chosen]
    outlines = {
        layer: chords(graph, outline, corner, size)
        for layer, outline in places
        if outline is not None
    }
    corners = graph.op("Round", (points - first) / size * ONE)
    blocks, count = _blocks(points)

    def block(index: Value) -> Value:
        return _composited(picture, chosen, outlines, points.take(index), corners.take(index))

    rows = graph.scan(blocks, block).reshape(-1, 4)
    start, axes = np.array([0]), np.array([0])
    result = graph.op("Slice", rows, start, count, axes, name="colour")
    canvas = {"width": str(picture.width), "height": str(picture.height)}
    said = _documentation(picture, chosen)
    return graph.model("proxyimg_renderer", [(result, ["N", 4])], said, canvas)


def _documentation(picture: Picture, chosen: Sequence[Layer]) -> str:
    """Text about the model, which is stored in it."""
    said = [DOCUMENTATION, f"The canvas has {picture.width} by {picture.height} pixels."]
    if picture.opaque and picture.layers[0] in chosen:
        said.append("The picture is opaque: alpha is to be ignored.")
    return "\n".join(said)


def _composited(
    picture: Picture, chosen: Sequence[Layer], outlines: Mapping[Layer, Value], at: Value,
    corner: Value,
) -> Value:  # fmt: skip
    """Composites all layers, front to back.

    Args:
        picture: The picture.
        chosen: The layers to draw, back to front.
        outlines: Chords of the layers that have an outline.
        at: Points [BLOCK, 2].
        corner: Upper left corners of their samples [BLOCK, 2], as `coverage` takes them.

    Returns:
        float32 [BLOCK, 4] premultiplied colour and alpha.
    """
    graph, drawn = at.graph, frozenset(chosen)
    result = graph.constant(np.zeros((BLOCK, 4), np.float32))
    clear = graph.constant(np.ones((BLOCK, 1), np.float32))
    for layer in reversed(chosen):
        weight = clear
        if layer in outlines:
            covered = coverage(outlines[layer], corner).reshape(-1, 1)
            weight = clear * covered
        seen = _seen(picture, layer, drawn, at, weight) * weight
        result = result + seen
        clear = clear - seen.take(np.array([3]), 1)
    return result


def _blocks(points: Value) -> tuple[Value, Value]:
    """Divides points into blocks; the last block is filled up with the last point.

    Returns:
        Numbers of the points, int64 [blocks, BLOCK]; number of all points, int64 [1].
    """
    graph = points.graph
    count = graph.op("Shape", points, dtype=np.int64, start=0, end=1)
    whole = (count + (BLOCK - 1)) / BLOCK * BLOCK
    numbers = graph.op("Range", np.array(0), whole.reshape(), np.array(1), dtype=np.int64)
    return numbers.minimum(count - 1).reshape(-1, BLOCK), count


def _seen(
    picture: Picture, layer: Layer, drawn: frozenset[Layer], at: Value, weight: Value
) -> Value:
    """Colour float32 [BLOCK, 4] of a layer at points; 0 where its weight is 0."""
    graph = at.graph
    nothing = graph.constant(np.zeros((BLOCK, 4), np.float32))

    def some() -> Value:
        index = graph.op("NonZero", weight.reshape(-1), dtype=np.int64).reshape(-1)
        found = colour(picture, layer, drawn, locate(layer, at.take(index)))
        return graph.op("ScatterND", nothing, index.reshape(-1, 1), found)

    return graph.choose(weight.reduced("Max") > 0, some, lambda: nothing)
