"""The reference renderer: coverage, texture, front-to-back compositing, averaging, in tiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..geometry import coverage as cover
from ..geometry.boundary import Boundary
from ..texture.network import Floats
from .engines import Engine
from .view import View

if TYPE_CHECKING:
    from ..image import Image, Layer

TILE_SAMPLES = 1 << 18
"""Samples rendered at a time: bounds the memory of any output."""


def render(
    image: Image,
    view: View,
    layers: Sequence[Layer],
    engine: Engine,
    out: Callable[[int, int, Floats], None],
) -> None:
    """Renders `layers` (back to front) and hands finished tiles to `out`.

    Args:
        image: The picture the layers belong to.
        view: Output size and region.
        layers: What to draw.
        engine: Who runs the networks.
        out: Called with row, column and float32 [h, w, 4] premultiplied colour and alpha in 0..1.
    """
    sx, sy = view.supersampling
    outlines = [outline(layer.boundary, view) for layer in layers]
    tile_w = max(min(view.width, TILE_SAMPLES // (sx * sy)), 1)
    tile_h = max(TILE_SAMPLES // (tile_w * sx * sy), 1)
    for row in range(0, view.height, tile_h):
        h = min(tile_h, view.height - row)
        for column in range(0, view.width, tile_w):
            w = min(tile_w, view.width - column)
            box = (column * sx, row * sy, w * sx, h * sy)
            samples = _tile(image, view, layers, outlines, engine, box)
            if sx * sy > 1:
                samples = samples.reshape(h, sy, w, sx, 4).mean((1, 3), dtype=np.float32)
            out(row, column, samples)


def outline(boundary: Boundary | None, view: View) -> list[NDArray[np.int64]] | None:
    """The paths on the sample grid of `view`, in 1/256 sample; None covers everything."""
    if boundary is None:
        return None
    sx, sy = view.supersampling
    unit = boundary.unit
    return [
        np.stack(
            [
                cover.to_output(p[:, 0], unit, view.x, view.region_width, view.width * sx),
                cover.to_output(p[:, 1], unit, view.y, view.region_height, view.height * sy),
            ],
            axis=1,
        )
        for p in boundary.paths
    ]


def _tile(
    image: Image,
    view: View,
    layers: Sequence[Layer],
    outlines: Sequence[list[NDArray[np.int64]] | None],
    engine: Engine,
    box: tuple[int, int, int, int],
) -> Floats:
    """Samples [h, w, 4], premultiplied, of the sample rectangle `box` = x, y, w, h."""
    x0, y0, w, h = box
    xs, ys = view.columns(x0, x0 + w), view.rows(y0, y0 + h)
    result = np.zeros((h * w, 4), np.float32)
    clear = np.ones(h * w, np.float32)
    for layer, paths in zip(reversed(layers), reversed(outlines), strict=True):
        if paths is None:
            covered = np.full(h * w, cover.FULL, np.int32)
        else:
            covered = cover.coverage(paths, x0, y0, w, h).ravel()
        at = np.flatnonzero((covered > 0) & (clear > 0))
        if not len(at):
            continue
        network = image.networks[layer.texture.network]
        taps = layer.texture.taps(xs[at % w], ys[at // w], layer.box)
        colour = premultiplied(engine(layer.texture, network, taps))
        colour *= (covered[at] * np.float32(1 / cover.FULL))[:, None]
        result[at] += clear[at, None] * colour
        clear[at] *= 1 - colour[:, 3]
    return result.reshape(h, w, 4)


def premultiplied(output: Floats) -> Floats:
    """Network outputs [N, 3 or 4] clamped to valid premultiplied colour and alpha [N, 4].

    Outputs that are not numbers count as 0. Colour is in 0..1; with a fourth output alpha is in
    0..1 and colour in 0..alpha.
    """
    result = np.ones((len(output), 4), np.float32)
    if output.shape[1] == 4:
        result[:, 3] = np.fmin(np.fmax(output[:, 3], 0), 1)
    # Unlike clip, fmax takes the number where the other is none.
    result[:, :3] = np.fmin(np.fmax(output[:, :3], 0), result[:, 3:])
    return result
