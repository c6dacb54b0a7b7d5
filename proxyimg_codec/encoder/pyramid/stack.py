"""Encoding of layers that each have all their pixels: every layer gets planes of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...geometry.boundary import Boundary
from ...limits import DEFAULT_LIMITS
from ...model import Layer, Layers, Picture
from ...texture.network import Floats
from ...texture.planes import Planes
from ...texture.pyramid import PyramidTexture
from ..settings import Settings
from ..shapes.coverage import coverage_of
from ..shapes.layers import LayerPlan, alike
from .encode import Raster
from .picture import Box, Report, alpha_of, colour_of, encode_rasters, within

ROOM = 2
"""Samples beyond the bounds of a boundary that take part in interpolation."""


def encode_stack(
    plans: Sequence[tuple[LayerPlan, int]],
    pixels_of: Callable[[int, Box], Floats],
    finished: Callable[[Picture], Picture],
    original: Floats,
    settings: Settings,
    report: Report,
) -> Picture:
    """Encodes layers with pyramid textures, one set of planes each.

    Args:
        plans: For each layer, back to front, its plan and its channels: 4 if it has alpha.
        pixels_of: Pixels of a layer in a rectangle x, y, width, height of the canvas, float32
            [height, width, 4] in 0..1 with straight alpha; colours continue where alpha is 0.
        finished: Gives the layers of the encoded picture their poses and groups.
        original: float32 [H, W, 4] in 0..1 with straight alpha: how all layers look together.
        settings: Settings of the encoder.
        report: As for `picture.encode_picture`.

    Returns:
        The picture that `finished` makes.

    Raises:
        UsageError: A target size or PSNR is out of reach.
        LimitError: The layers have more samples than readers accept by default.
    """
    size = original.shape[1], original.shape[0]
    boxes = [box_of(plan.boundary, size) for plan, _ in plans]
    both = zip(boxes, plans, strict=True)
    samples = sum(w * h * (channels - 2) for (_, _, w, h), (_, channels) in both)
    DEFAULT_LIMITS.check("samples", samples)
    rasters: list[Raster] = []
    for number, ((plan, channels), box) in enumerate(zip(plans, boxes, strict=True)):
        pixels = pixels_of(number, box)
        rasters.append(colour_of(pixels)._replace(structural=settings.tune == "ms-ssim"))
        if channels == 4:
            x, y, w, h = box
            share = coverage_of(plan.boundary, *size).reshape(size[::-1])[y : y + h, x : x + w]
            rasters.append(alpha_of(within(pixels[..., 3], share, alike(settings))))

    def picture_of(sources: Sequence[Planes]) -> Picture:
        given = iter(sources)
        layers = []
        for (plan, channels), box in zip(plans, boxes, strict=True):
            colour = next(given)
            alpha = next(given) if channels == 4 else None
            view = PyramidTexture(colour, alpha, (0, 0, *box[2:]))
            layers.append(Layer(plan.name, box, plan.boundary, view, plan.mesh))
        most = max(channels for _, channels in plans)
        return finished(Picture(*size, most, False, 8, Layers(layers), ()))

    return encode_rasters(rasters, len(rasters), picture_of, original, settings, report)


def box_of(boundary: Boundary | None, size: tuple[int, int]) -> Box:
    """Rectangle x, y, width, height of the canvas that the texture of a layer has to cover.

    Args:
        boundary: Boundary of the layer; None for the whole canvas.
        size: Width and height of the canvas in pixels.
    """
    if boundary is None:
        return 0, 0, *size
    x0, y0, x1, y1 = boundary.bounds()
    x0, y0 = max(x0 - ROOM, 0), max(y0 - ROOM, 0)
    x1, y1 = min(x1 + ROOM, size[0]), min(y1 + ROOM, size[1])
    return x0, y0, x1 - x0, y1 - y0
