"""Drawing for the page: exact pictures, textures at rest, thumbnails, meshes and outlines."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..edit.operations import substituted
from ..edit.transforms import meshed
from ..export.common import region_of
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS, Refined
from ..geometry.mesher import rim
from ..geometry.pose import Pose
from ..geometry.warp import WEIGHT_BITS, barycentric
from ..io.color import is_srgb, to_srgb
from ..io.raster import Picture as Raster
from ..io.raster import stripped
from ..io.samples import rounded, to_float
from ..limits import Limits
from ..model import Layer, Layers, Picture
from ..render.cache import Cache
from ..render.pixels import render

Bytes = NDArray[np.uint8]
Progress = Callable[[int], None]
Region = tuple[int, int, int, int]

BEYOND = 0.3
"""Part of a layer's width and height that is shown beyond its outline while that is dragged."""

SKIRT = 6.0
"""Width in canvas pixels of the rim that is drawn around a mesh."""

_ONE = 1 << FRACTION_BITS


class Wanted(NamedTuple):
    """Request for an exact picture.

    Attributes:
        region: x, y, width, height in canvas pixels, or None for the whole canvas.
        width: Columns of the result, or None.
        height: Rows of the result, or None.
        time: Time in seconds, or None for the still.
        layers: Positions of the layers to draw, or None for all that are not hidden.
    """

    region: Region | None = None
    width: int | None = None
    height: int | None = None
    time: float | None = None
    layers: tuple[int, ...] | None = None


def exact(
    picture: Picture, wanted: Wanted, limits: Limits, cache: Cache, progress: Progress
) -> Bytes:
    """Draws a picture as every reader does, converted to sRGB: uint8 [H, W, 4], straight alpha.

    Raises:
        PxiError: As `render.pixels.render`.
    """
    found = render(
        picture, region=wanted.region, width=wanted.width, height=wanted.height, t=wanted.time,
        layers=wanted.layers, limits=limits, cache=cache, progress=progress,
    )  # fmt: skip
    return on_screen(found, picture)


def on_screen(pixels: NDArray[Any], picture: Picture) -> Bytes:
    """Pixels uint8 [H, W, 3 or 4] in the colours of a picture as uint8 [H, W, 4] of sRGB."""
    if not is_srgb(picture.blocks):
        pixels = rounded(to_srgb(pixels, picture.blocks), "uint8")
    if pixels.shape[2] == 4:
        return pixels
    return np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])


def png(pixels: Bytes) -> bytes:
    """Bytes of a PNG file of uint8 [H, W, 4], packed fast."""
    from PIL import Image

    out = io.BytesIO()
    opaque = bool((pixels[..., 3] == 255).all())
    Image.fromarray(pixels[..., :3] if opaque else pixels).save(out, "PNG", compress_level=1)
    return out.getvalue()


def thumbnail(
    picture: Picture, index: int, side: int, limits: Limits, cache: Cache, progress: Progress
) -> Bytes:
    """Draws one layer as it is now, cut to where it is, at most `side` pixels wide or high."""
    region = region_of(picture, picture.layers[index])
    scale = min(1.0, side / max(region[2:]))
    width, height = (max(round(n * scale), 1) for n in region[2:])
    wanted = Wanted(region, width, height, None, (index,))
    return exact(picture, wanted, limits, cache, progress)


def texture(
    picture: Picture, index: int, scale: float, limits: Limits, progress: Progress,
    whole: bool = False,
) -> tuple[Bytes, Region]:  # fmt: skip
    """Draws one layer at rest, without opacity, changed colours or bending.

    Args:
        picture: The picture.
        index: Position of the layer.
        scale: Pixels of the result a canvas pixel.
        limits: Bounds on drawing.
        progress: Called with counts of pixels.
        whole: Whether to draw beyond the outline, too, as far as the canvas goes.

    Returns:
        uint8 [H, W, 4] in sRGB, and x, y, width, height in canvas pixels that it covers.

    Raises:
        PxiError: As `render.pixels.render`.
    """
    layer = picture.layers[index]
    if whole and layer.boundary is not None:
        layer = replace(layer, boundary=_around(picture, layer))
        picture = substituted(picture, [layer])
        layer = picture.layers[index]
    x, y, width, height = box = rest_box(picture, layer)
    on_canvas = min(x, y) >= 0 and x + width <= picture.width and y + height <= picture.height
    pose = Pose(places=layer.pose.places)
    if not on_canvas:
        pose = replace(pose, shift=(-x * _ONE, -y * _ONE))
    rest = replace(layer, pose=pose, track=None)
    layers = [rest if v is layer else v for v in picture.layers]
    alone = replace(picture, layers=Layers(layers), timeline=None, history=())
    region = box if on_canvas else (0, 0, width, height)
    if not on_canvas:
        alone = replace(alone, width=width, height=height)
    found = render(
        alone, region=region, scale=scale, layers=(index,), limits=limits, progress=progress
    )
    return on_screen(found, picture), box


def _around(picture: Picture, layer: Layer) -> Boundary:
    """Rectangle around a layer at rest and some of what lies beside it on the canvas."""
    x, y, width, height = rest_box(picture, layer)
    dx, dy = int(BEYOND * width) + 1, int(BEYOND * height) + 1
    left, top = min(x, max(x - dx, 0)), min(y, max(y - dy, 0))
    right = max(x + width, min(x + width + dx, picture.width))
    bottom = max(y + height, min(y + height + dy, picture.height))
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    path = [p for k in range(4) for p in (corners[k], corners[k], corners[(k + 1) % 4])]
    return Boundary(0, (np.array(path, np.int64),))


def rest_box(picture: Picture, layer: Layer) -> Region:
    """Rectangle x, y, width, height in canvas pixels around the outline of a layer at rest."""
    if layer.boundary is None:
        return 0, 0, picture.width, picture.height
    x0, y0, x1, y1 = layer.boundary.bounds()
    return x0, y0, max(x1 - x0, 1), max(y1 - y0, 1)


def texture_key(layer: Layer, numbers: dict[int, tuple[Any, int]]) -> str:
    """Key of all that the texture of a layer at rest depends on.

    Args:
        layer: The layer.
        numbers: Textures that have a number already, and that number, by identity; grows.
    """
    number = numbers.setdefault(id(layer.texture), (layer.texture, len(numbers)))[1]
    paths = [] if layer.boundary is None else [p.tobytes() for p in layer.boundary.paths]
    places = b"" if layer.pose.places is None else layer.pose.places.tobytes()
    return f"{number}-{_digest(*paths, places)}"


def mesh_key(picture: Picture, layer: Layer) -> str:
    """Key of all that the mesh of a layer and its bending depend on."""
    nodes = b"" if layer.pose.nodes is None else layer.pose.nodes.tobytes()
    if layer.mesh is None:
        paths = [] if layer.boundary is None else [p.tobytes() for p in layer.boundary.paths]
        return _digest(repr(picture.size).encode(), *paths)
    refined = layer.mesh.refined
    return _digest(refined.nodes.tobytes(), refined.faces.tobytes(), nodes)


def _digest(*parts: bytes) -> str:
    state = hashlib.blake2b(digest_size=8)
    for part in parts:
        state.update(len(part).to_bytes(8, "little"))
        state.update(part)
    return state.hexdigest()


def mesh(picture: Picture, layer: Layer) -> dict[str, Any]:
    """Mesh of a layer, its own or one as edits make it: JSON values, see `README.md`."""
    full = meshed(picture, layer)
    assert full.mesh is not None, "`meshed` gives it one"
    refined, pose = full.mesh.refined, layer.pose
    bent = None
    if pose.nodes is not None:
        bent = _pixels(refined.nodes + replace(pose, sway=None).displacements)
    skirt, band = _skirt(refined)
    return {
        "nodes": _pixels(refined.nodes),
        "bent": bent,
        "faces": refined.faces.tolist(),
        "skirt": skirt,
        "triangles": [*band, *refined.faces.tolist()],
    }


def _pixels(points: NDArray[np.int64]) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in points / _ONE]


def _skirt(refined: Refined) -> tuple[list[list[float]], list[list[int]]]:
    """Vertices beyond the rim of a mesh, each of which follows a face, and triangles to them."""
    loops = rim(refined.faces)
    if not loops:
        return [], []
    points, faces = refined.nodes / _ONE, refined.faces
    beside = {(int(f[k]), int(f[(k + 1) % 3])): f for f in faces for k in range(3)}
    skirt: list[list[float]] = []
    band: list[list[int]] = []
    for loop in loops:
        first = len(points) + len(skirt)
        at = points[loop]
        way = np.roll(at, -1, 0) - at
        turned = np.stack([way[:, 1], -way[:, 0]], 1)
        normal = turned / np.maximum(np.hypot(*turned.T)[:, None], 1e-9)
        out = normal + np.roll(normal, 1, 0)
        out /= np.maximum(np.hypot(*out.T)[:, None], 0.5)
        count = len(loop)
        for k, node in enumerate(loop):
            follows = loop[(k + 1) % count]
            face = beside[node, follows]
            skirt.append([*face.tolist(), *_weights(points[face], at[k] + SKIRT * out[k])])
            near, far = first + k, first + (k + 1) % count
            band += [[node, near, far], [node, far, follows]]
    return skirt, band


def _weights(corners: NDArray[np.float64], point: NDArray[np.float64]) -> list[float]:
    """Barycentric weights of a point in a triangle, also beyond it."""
    sides = np.stack([corners[1] - corners[0], corners[2] - corners[0]], 1)
    if abs(np.linalg.det(sides)) < 1e-9:
        return [1.0, 0.0, 0.0]
    b, c = np.linalg.solve(sides, point - corners[0])
    return [float(1 - b - c), float(b), float(c)]


def control_points(layer: Layer) -> list[list[list[float]]] | None:
    """Present control points of the outline of a layer, in canvas pixels, path by path.

    None if it covers the canvas.
    """
    boundary = layer.boundary
    if boundary is None:
        return None
    return [_pixels(layer.pose.apply(p)) for p in _displaced(boundary, layer)]


def _displaced(boundary: Boundary, layer: Layer) -> list[NDArray[np.int64]]:
    """Control points in 1/1024 canvas pixel as bending leaves them, before the affine map."""
    paths = [p << (FRACTION_BITS - boundary.unit) for p in boundary.paths]
    if layer.pose.nodes is None or layer.mesh is None:
        return paths
    refined, moved = layer.mesh.refined, replace(layer.pose, sway=None).displacements
    result = []
    for path in paths:
        face, weights = barycentric(path, refined.nodes, refined.faces)
        shift = (weights[..., None] * moved[refined.faces[face]]).sum(1) >> WEIGHT_BITS
        result.append(path + shift)
    return result


def raster_png(source: Raster, width: int | None) -> bytes:
    """PNG file of a raster in sRGB, at most `width` pixels wide.

    Raises:
        PxiError: Its colours cannot be converted.
    """
    from PIL import Image

    pixels = stripped(source).pixels
    pixels = rounded(np.clip(to_float(pixels)[0], 0, 1), "uint8")
    if width is not None and width < pixels.shape[1]:
        height = max(round(pixels.shape[0] * width / pixels.shape[1]), 1)
        pixels = np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.BOX))
    return png(pixels)
