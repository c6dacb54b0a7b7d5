"""Operations on how layers are shown: opacity, colour, texture (ProxyImg, equation 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PxiError, UsageError
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import COLOUR_BITS, COLOUR_MAX, NODE_BITS, NODE_MAX, OPACITY_MAX
from ..image import Image, Layer, open_image
from .geometry import TARGET, meshed, sampled
from .operations import changed, one, operation, shown_together, substituted

LUMA = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue in luminance (ITU-R BT.709)."""

Reals = NDArray[np.float64]


@operation("opacity", layer=TARGET, value="number: 0 to 1")
def opacity(image: Image, layer: str | int, value: float) -> Image:
    """Sets the opacity of a layer."""
    if not 0 <= value <= 1:
        raise UsageError(f"opacity: {value} is not within 0 and 1")
    return _posed(image, layer, opacity=round(value * OPACITY_MAX))


@operation("hide", layer=TARGET)
def hide(image: Image, layer: str | int) -> Image:
    """Stops drawing a layer."""
    return _posed(image, layer, hidden=True)


@operation("show", layer=TARGET)
def show(image: Image, layer: str | int) -> Image:
    """Draws a hidden layer again."""
    return _posed(image, layer, hidden=False)


def _posed(image: Image, target: str | int, **values: Any) -> Image:
    layers = shown_together(image, target)
    return substituted(image, [replace(v, pose=replace(v.pose, **values)) for v in layers])


@operation("recolour", layer=TARGET, hue="number?: degrees to turn the hue by",
           saturation="number?: a factor, 0 is grey", brightness="number?: a factor",
           tint="colour?: #rrggbb, whose shades are used",
           matrix="colours?: rows of a 3 x 4 matrix for red, green, blue and one")  # fmt: skip
def recolour(
    image: Image,
    layer: str | int,
    hue: float = 0,
    saturation: float = 1,
    brightness: float = 1,
    tint: str | None = None,
    matrix: Sequence[float] | None = None,
) -> Image:
    """Changes the colours of a layer, in the order of the parameters, on top of earlier changes."""
    change = np.eye(4)
    steps = [_hue(hue), _saturation(saturation), np.eye(3) * brightness]
    if tint is not None:
        target = np.array([int(tint[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        steps.append(np.outer(target / max(float(np.dot(target, LUMA)), 0.25), LUMA))
    for step in steps:
        change[:3] = step @ change[:3]
    if matrix is not None:
        change[:3] = np.array(matrix, float).reshape(3, 4) @ change
    layers = []
    for each in shown_together(image, layer):
        before = np.eye(4)
        if each.pose.colour:
            before[:3] = np.array(each.pose.colour).reshape(3, 4) / (1 << COLOUR_BITS)
        values = np.rint((change @ before)[:3] * (1 << COLOUR_BITS))
        if np.abs(values).max() > COLOUR_MAX:
            raise UsageError("recolour: the colours would change more than 256 times")
        rest = np.array_equal(values, np.eye(4)[:3] * (1 << COLOUR_BITS))
        colour = () if rest else tuple(int(v) for v in values.ravel())
        layers.append(replace(each, pose=replace(each.pose, colour=colour)))
    return substituted(image, layers)


def _saturation(factor: float) -> Reals:
    """Colour matrix of feColorMatrix `saturate` (W3C Filter Effects Module 1)."""
    return factor * np.eye(3) + (1 - factor) * np.tile(LUMA, (3, 1))


def _hue(degrees: float) -> Reals:
    """Colour matrix of feColorMatrix `hueRotate` (W3C Filter Effects Module 1)."""
    r, g, b = LUMA
    grey = np.tile(LUMA, (3, 1))
    skew = np.array([[-r, -g, 1 - b], [0.143, 0.140, -0.283], [-(1 - r), g, b]])
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(grey + c * (np.eye(3) - grey) + s * skew)


@operation("texture", layer="layer: the layer that changes, by name or position",
           source="text: a layer of this picture, or the name of a .pxi or picture file",
           from_layer="text?: the layer of that .pxi file; its front one by default",
           fit="fit?: box to box, or by the shape of the outlines")  # fmt: skip
def texture(
    image: Image, layer: str | int, source: str, from_layer: str | None = None, fit: str = "box"
) -> Image:
    """Gives a layer the texture of another layer, of another file's layer, or of a picture."""
    target = one(image, layer)
    networks = list(image.networks)
    if source in {v.name for v in image.layers}:
        if from_layer is not None:
            raise UsageError("texture: from_layer needs a .pxi file as source")
        origin = one(image, source)
        shown = origin.texture
    else:
        origin = _loaded(source, from_layer)
        assert origin.image is not None
        networks.append(origin.image.networks[origin.texture.network])
        shown = replace(origin.texture, network=len(networks) - 1)
    if origin.sampling and target.mesh is None:
        target = meshed(target)
    new = replace(target, texture=shown, sampling=origin.sampling)
    new = replace(new, pose=replace(new.pose, places=None))
    if fit == "shape":
        new = _fitted(new, origin)
    layers = [new if v.name == target.name else v for v in image.layers]
    return changed(image, layers, networks=networks)


def _loaded(source: str, name: str | None) -> Layer:
    """The layer of a `.pxi` file, or a picture file as one layer.

    Raises:
        UsageError: There is no such file.
    """
    if not Path(source).is_file():
        raise UsageError(f"texture: {source!r} is neither a layer of the picture nor a file")
    with open(source, "rb") as file:
        known = file.read(4) == b"\x89PXI"
    if known:
        layers = open_image(source).layers
        return layers[-1 if name is None else name]  # type: ignore[no-any-return]  # untyped key
    if name is not None:
        raise UsageError(f"texture: {source} is not a .pxi file, which from_layer needs")
    from ..pictures import read

    pixels = read(source).pixels
    try:
        from ..encoder.encode import encode
    except ModuleNotFoundError as error:
        raise PxiError(
            f"the texture of a picture needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    return encode(pixels, max_layers=1).layers[0]  # type: ignore[no-any-return]  # untyped key


def _fitted(layer: Layer, origin: Layer) -> Layer:
    """`layer` showing the texture of `origin` so that outlines meet.

    Polar: a node at direction t from the centre of its shape, at a share r of the way to the
    outline, shows the point at direction t and share r in the shape of `origin`.
    """
    layer = meshed(layer)
    assert layer.mesh is not None
    assert layer.image is not None
    assert origin.image is not None
    here = _Star(layer.boundary, (layer.image.width, layer.image.height))
    there = _Star(origin.boundary, (origin.image.width, origin.image.height))
    rest = layer.mesh.refined.nodes / (1 << FRACTION_BITS)
    away = rest - here.centre
    angle = np.arctan2(away[:, 1], away[:, 0])
    ratio = there.reach(angle) / here.reach(angle)
    shown = there.centre + away * ratio[:, None]
    places = np.rint((shown - rest) * (1 << NODE_BITS))
    places = np.clip(places, 1 - NODE_MAX, NODE_MAX - 1).astype(np.int64)
    pose = replace(layer.pose, places=places if places.any() else None)
    return replace(layer, box=origin.box, pose=pose)


class _Star:
    """A shape seen from its centre: how far its outline is in every direction."""

    DIRECTIONS = 360

    def __init__(self, boundary: Boundary | None, size: tuple[int, int]) -> None:
        if boundary is None:
            w, h = size
            corners = np.array([[0, 0], [w, 0], [w, h], [0, h]], float)
            t = np.linspace(0, 1, 64, endpoint=False)[:, None]
            points = np.concatenate(
                [a + (b - a) * t for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
            )
        else:
            points = sampled(boundary)
        self.centre = (points.min(0) + points.max(0)) / 2
        away = points - self.centre
        angle = np.arctan2(away[:, 1], away[:, 0])
        length = np.hypot(*away.T)
        slot = np.floor((angle / (2 * math.pi) % 1) * self.DIRECTIONS).astype(int)
        far = np.zeros(self.DIRECTIONS)
        np.maximum.at(far, slot % self.DIRECTIONS, length)
        seen = np.flatnonzero(far > 0)
        steps = np.arange(self.DIRECTIONS)
        self._far = np.interp(steps, seen, far[seen], period=self.DIRECTIONS)

    def reach(self, angle: Reals) -> Reals:
        """Distance of the outline from the centre in directions [n], at least 1 px."""
        place = (angle / (2 * math.pi) % 1) * self.DIRECTIONS - 0.5
        steps = np.arange(self.DIRECTIONS)
        found = np.interp(place % self.DIRECTIONS, steps, self._far, period=self.DIRECTIONS)
        return np.asarray(np.maximum(found, 1.0), np.float64)
