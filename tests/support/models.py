"""Models in ONNX of the whole renderer: what goes in, and what must come out."""

import numpy as np

from conformance.judge import difference
from proxyimg_codec.export.onnx_renderer import build
from proxyimg_codec.render.view import make_view

PEAK, RMS = 0.03, 0.003
"""Largest errors in 8-bit levels: what the expected pictures of 16 bits are rounded by, and
hardly more."""


def view_of(image, args):
    """The view that the arguments of `Image.render` ask for."""
    size = image.width, image.height
    return make_view(size, *(args.get(k) for k in ("width", "height", "scale", "region")))


def samples(view):
    """The inputs of the model for a view: REN-2 and REN-3."""
    sx, sy = view.supersampling
    columns, rows = view.width * sx, view.height * sy
    grid = np.meshgrid(view.columns(0, columns), view.rows(0, rows))
    size = [view.region_width / columns, view.region_height / rows]
    return {"points": np.stack(grid, 2).reshape(-1, 2), "pixel_size": np.array(size)}


def averaged(colour, view):
    """The picture float32 [H, W, 4], straight, of the colours of all samples."""
    assert colour.dtype == np.float32
    sx, sy = view.supersampling
    picture = colour.reshape(view.height, sy, view.width, sx, 4).astype(float).mean((1, 3))
    picture[..., :3] /= np.maximum(picture[..., 3:], 1e-6)
    return picture.clip(0, 1).astype(np.float32)


def model_of(image, args):
    """The model that the arguments of a render select."""
    still = image.at(args["time"]) if "time" in args else image
    return build(still, args.get("layers"), args.get("background", True))


def agrees(colour, view, expected):
    picture = averaged(colour, view)[..., : expected.shape[2]]
    peak, rms = difference(picture, expected)
    assert peak <= PEAK
    assert rms <= RMS
