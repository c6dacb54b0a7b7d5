"""Thumbnails of pictures that are as they were encoded: only the levels that they need [REN-18].

While all layers rest in their place, what they show together is one raster, so that one is drawn.
What a level adds to it is fine detail, of which the mean over an output pixel keeps little: a share
of about pitch / span, where `pitch` is that of the samples which the level is made for, and `span`
that of output pixels. PLAN tells in `details` how much each level adds. So what a thumbnail loses
without the finest ones is known before anything is decoded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..model import Layer, Picture
from ..texture import sampling
from ..texture.grid import Window
from ..texture.network import Floats
from ..texture.occlusion import ALL_IN_PLACE
from ..texture.planes import Planes
from ..texture.pyramid import PyramidTexture
from .neighbours import moved_neighbours, place
from .progress import Progress
from .view import View

ERROR_MAX = 1.4
"""Root mean square, in 8-bit levels, that a thumbnail may lose: 45 dB, and a little more."""

UNKNOWN = 12.0
"""Root mean square that a level is taken to add where a file does not tell."""

SPAN_MIN = 1.4
"""Fewest samples that are left for an output pixel, across and down."""

STRIP = 64
"""Output rows drawn at a time."""


def raster(picture: Picture, layers: Sequence[Layer], view: View) -> Planes | None:
    """Finds the raster that a thumbnail is drawn from.

    Args:
        picture: Picture that the layers belong to.
        layers: Layers to draw, back to front.
        view: View of the picture.

    Returns:
        Its planes; None if the view is not smaller than its region, or shows anything else than
        samples of one raster, each on its pixel.
    """
    if view.width >= view.region_width or view.height >= view.region_height:
        return None
    if not (picture.opaque and layers and layers[0] is picture.layers[0]):
        return None
    drawn = frozenset(layers)
    found = place(layers[0].texture, layers[0].box)
    if found is None or found[1:] != (0, 0) or layers[0].box != (0, 0, *picture.size):
        return None
    plain = all(place(v.texture, v.box) == found and _plain(v) for v in layers)
    return found[0] if plain and all(_in_place(picture, v, drawn) for v in layers) else None


def _plain(layer: Layer) -> bool:
    """Whether a layer shows samples as they are, and no mask takes any."""
    texture = layer.texture
    return (
        isinstance(texture, PyramidTexture)
        and texture.alpha is None
        and texture.mask is None
        and (texture.cuts is None or texture.cuts.within is None)
        and layer.pose.at_rest
        and layer.pose.sway is None
    )


def _in_place(picture: Picture, layer: Layer, drawn: frozenset[Layer]) -> bool:
    """Whether no neighbour has moved relative to a layer."""
    return moved_neighbours(picture, layer, drawn) == ALL_IN_PLACE


def spare(planes: Planes, span: float) -> int:
    """Finds how many of the finest levels of planes a thumbnail does without.

    Args:
        planes: The planes.
        span: Samples that an output pixel spans, across or down, whichever are fewer.
    """
    error, found = 0.0, 0
    for level, detail in enumerate(planes.details or (UNKNOWN,) * planes.packed["levels"], 1):
        error += (detail * (1 << (level - 1)) / span) ** 2
        # Interpolating what is left blurs it, the more levels there are, the more.
        lost = error * (0.7 + 0.15 * level)
        if lost > ERROR_MAX**2 or span < SPAN_MIN * (1 << level):
            break
        found = level
    return found


def draw(
    planes: Planes, view: View, out: Callable[[int, int, Floats], None],
    progress: Callable[[int], None] | None = None,
) -> None:  # fmt: skip
    """Draws a thumbnail, and hands finished strips to a function.

    Args:
        planes: Planes of the raster.
        view: View of the picture.
        out: Called for each strip with row and column of its first output pixel, and float32
            [h, w, 3] colour.
        progress: As for `compose.compose`.

    Raises:
        FormatError: A coded stream that is decoded only now is corrupt.
    """
    down, across = view.region_height / view.height, view.region_width / view.width
    level = spare(planes, min(down, across))
    rows, columns = planes.shape(level)
    from_rows = _taps(view.y, down, view.height, level, rows)
    from_columns = _taps(view.x, across, view.width, level, columns)
    window = Window(*_span(from_rows[0]), *_span(from_columns[0]))
    told = Progress(view.width * view.height, progress)
    with told.decoding([(planes, window)]):
        if level:
            samples, start = planes.reduced(level, window), window
        else:
            samples, start = planes.samples(window), Window.whole((rows, columns))
    for top in range(0, view.height, STRIP):
        index, weight = from_rows[0][top : top + STRIP], from_rows[1][top : top + STRIP]
        with told.drawing(len(index) * view.width):
            first, end = _span(index)
            strip = samples[first - start.top : end - start.top]
            strip = _mixed(strip, index - first, weight, 0)
            strip = _mixed(strip, from_columns[0] - start.left, from_columns[1], 1)
            out(top, 0, strip.repeat(3 // planes.components, 2))


def _taps(
    start: int, span: float, count: int, level: int, size: int
) -> tuple[NDArray[np.int64], Floats]:
    """Samples that output pixels are mixed of along one axis.

    Args:
        start: First canvas pixel of the region.
        span: Canvas pixels that an output pixel spans.
        count: Number of output pixels.
        level: Number of the finest levels that are left out.
        size: Number of samples that are left.

    Returns:
        int64 [count, taps] numbers of samples, and float32 [count, taps] weights.
    """
    points = int(np.ceil(span / (1 << level)))
    at = start + (np.arange(count * points) + 0.5) * (span / points)
    at = np.clip((at - 0.5) / (1 << level), 0, size - 1)
    before = at.astype(np.int64)
    parts = np.stack(sampling.weights((at - before).astype(np.float32)), 1) / np.float32(points)
    index = (before[:, None] + np.arange(-1, sampling.TAPS - 1)).reshape(count, -1)
    first = index.min(1)
    taps = int((index.max(1) - first).max()) + 1
    weight = np.zeros((count, taps), np.float32)
    np.add.at(weight, (np.arange(count)[:, None], index - first[:, None]), parts.reshape(count, -1))
    return np.clip(first[:, None] + np.arange(taps), 0, size - 1), weight


def _span(index: NDArray[np.int64]) -> tuple[int, int]:
    """First sample of some, and the one after the last."""
    return int(index.min()), int(index.max()) + 1


def _mixed(samples: Floats, index: NDArray[np.int64], weight: Floats, axis: int) -> Floats:
    """Weighted sums of samples [rows, columns, C] along an axis."""
    shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
    out = samples.take(index[:, 0], axis) * weight[:, 0].reshape(shape)
    for k in range(1, index.shape[1]):
        out += samples.take(index[:, k], axis) * weight[:, k].reshape(shape)
    return out
