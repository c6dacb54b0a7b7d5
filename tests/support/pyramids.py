"""Made-up pyramid textures: their samples come from a name, not from coded planes."""

import zlib
from functools import partial

import numpy as np

from conformance.make.builders import Numbers, ellipse, network, polygon, texture
from proxyimg_codec.container import plan
from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.model import Layer, Layers
from proxyimg_codec.texture import synthesis
from proxyimg_codec.texture.occlusion import Occlusion
from proxyimg_codec.texture.planes import Planes
from proxyimg_codec.texture.pyramid import PyramidTexture
from tests.support.images import changed
from tests.support.images import image as image_of

SIZE = 64, 48
DEFAULTS = {"int": lambda f: f.low, "ints": lambda f: [f.low] * f.items, "bin": lambda f: b""}


def raster(name, size, components):
    """float32 [rows, columns, components] in 0..1: waves and some noise."""
    columns, rows = size
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    y, x = np.mgrid[0:rows, 0:columns]
    phase = rng.uniform(3, 9, (2, components))
    waves = np.sin(x[..., None] / phase[0]) * np.cos(y[..., None] / phase[1])
    noise = rng.uniform(-1, 1, (rows, columns, components))
    return np.clip(0.5 + 0.4 * waves + 0.1 * noise, 0, 1).astype(np.float32)


def unpacked(fields, where=""):
    """What `planes.unpack` does, but for the samples."""
    made = Planes(fields)
    return showing(made, raster(fields["data"].decode(), made.size, made.components))


def showing(source, samples):
    """Planes, whose samples are replaced."""
    source.__dict__["samples"] = partial(_given, samples)
    return source


def _given(samples, window):
    return samples


def planes(name, size=SIZE, components=3):
    """Planes with the samples of a name."""
    fields = {f.key: DEFAULTS[f.kind](f) for f in plan.FIELDS}
    size = list(size)
    return unpacked({**fields, "size": size, "components": components, "data": name.encode()})


def view(source, alpha=None, part=None, cell=0, mask=None, cuts=None):
    """A view of planes; of all of them by default."""
    return PyramidTexture(source, alpha, part or (0, 0, *source.size), cell, mask, cuts)


def layers(source, alpha=None):
    """Layers back, bar and disc, that show the raster in its place.

    The back layer does not have what is well inside the disc. Grey planes are not shared.
    """
    disc = Boundary(4, (ellipse((32, 24), (14, 14)),))
    bar = Boundary(4, (polygon((4, 38), (60, 38), (60, 46), (4, 46)),))
    y, x = np.mgrid[0:12, 0:16] * 4 + 2
    rim = np.hypot(x - 32, y - 24) > 9
    round_ = np.hypot(np.arange(30)[:, None] - 14.5, np.arange(31) - 15.5) < 16
    boxes = (0, 0, *SIZE), (3, 36, 59, 11), (16, 9, 31, 30)
    masks = (2, rim), (0, None), (0, round_)
    return [
        Layer(name, box, shape, view(source, alpha, box, *mask))
        for name, box, shape, mask in zip(
            ("back", "bar", "disc"), boxes, (None, bar, disc), masks, strict=True
        )
    ]


def picture(source=None, alpha=None):
    """The picture of `layers`, opaque without alpha."""
    source = source or planes("colour")
    channels = 3 if alpha is None else 4
    info = {"encoder": "", "settings": "", "areas": [2000, 448, 615]}
    stack = Layers(layers(source, alpha))
    return image_of(*SIZE, channels, alpha is None, 8, stack, (), info=info)


def cut_picture(source=None, alpha=None):
    """Like `picture`, but boundaries cut the views, and the disc lies over the bar in part."""
    source = source or planes("colour")
    channels = 3 if alpha is None else 4
    bar = Boundary(4, (polygon((4, 30), (60, 30), (60, 46), (4, 46)),))
    disc = Boundary(4, (ellipse((32, 24), (14, 14)),))
    boundaries = None, bar, disc
    boxes = (0, 0, *SIZE), (2, 28, 60, 20), (16, 8, 32, 32)
    stack = []
    for k, (name, box, numbers) in enumerate(
        zip(("back", "bar", "disc"), boxes, ([1, 2], [1, 2], [2]), strict=True)
    ):
        cuts = Occlusion.of(numbers, k, boundaries, box)
        stack.append(Layer(name, box, boundaries[k], view(source, alpha, box, cuts=cuts)))
    info = {"encoder": "", "settings": "", "areas": [1900, 700, 615]}
    return image_of(*SIZE, channels, alpha is None, 8, Layers(stack), (), info=info)


def implicit():
    """A picture of the same size with the same layers, of implicit textures and one network."""
    n = Numbers("implicit")
    stack = [changed(v, texture=texture(n, grid=(9, 8))) for v in layers(planes("none"))]
    return image_of(*SIZE, 3, True, 8, Layers(stack), (network(n),))


def filled(view):
    """Whether a view has had to fill what does not show."""
    return any("filled" in key for key in vars(view))


def synthesized(weights, grid, latents, step):
    """Samples in 0..255 of whole planes, level by level; not clipped, with padding."""
    out = np.ascontiguousarray(latents.lowest.transpose(1, 2, 0), np.float32)
    for level in range(len(latents.levels), 0, -1):
        found = np.ascontiguousarray(latents.levels[level - 1], np.int32)
        out = synthesis.finer(weights, level, out, found, step, grid.at(level - 1))
    return synthesis.colours(weights, out, step)
