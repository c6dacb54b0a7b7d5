"""Operations on the appearance of layers: opacity, colour, texture (ProxyImg, equation 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..codec.read import from_file
from ..errors import InputError, PxiError, UsageError
from ..geometry.boundary import Boundary
from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import COLOUR_BITS, COLOUR_MAX, NODE_BITS, NODE_MAX, OPACITY_MAX
from ..geometry.warp import WEIGHT_BITS, barycentric
from ..model import Layer, Picture
from ..texture.network import Network
from ..texture.occlusion import Occlusion
from ..texture.pyramid import PyramidTexture, Texture
from .operations import changed, layer_named, operation, shown_together, substituted
from .soft_textures import with_matte, without_matte
from .transforms import TARGET, meshed, sampled

LUMA = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue in luminance (ITU-R BT.709)."""

Reals = NDArray[np.float64]


@operation("opacity", layer=TARGET, value="number: 0 to 1")
def opacity(picture: Picture, layer: str | int, value: float) -> Picture:
    """Sets the opacity of a layer."""
    if not 0 <= value <= 1:
        raise UsageError(f"opacity: {value} is not within 0 and 1")
    return _posed(picture, layer, opacity=round(value * OPACITY_MAX))


@operation("hide", layer=TARGET)
def hide(picture: Picture, layer: str | int) -> Picture:
    """Stops drawing a layer."""
    return _posed(picture, layer, hidden=True)


@operation("show", layer=TARGET)
def show(picture: Picture, layer: str | int) -> Picture:
    """Draws a hidden layer again."""
    return _posed(picture, layer, hidden=False)


@operation("still", layer=TARGET)
def still(picture: Picture, layer: str | int) -> Picture:
    """Forgets the motion of a layer."""
    return substituted(picture, [replace(v, track=None) for v in shown_together(picture, layer)])


def _posed(picture: Picture, target: str | int, **values: Any) -> Picture:
    """Picture in which a layer, or the layers of a group, have other values in their poses."""
    layers = shown_together(picture, target)
    return substituted(picture, [replace(v, pose=replace(v.pose, **values)) for v in layers])


@operation("recolour", layer=TARGET, hue="number?: degrees to turn the hue by",
           saturation="number?: a factor, 0 is grey", brightness="number?: a factor",
           tint="colour?: #rrggbb, whose shades are used",
           matrix="colours?: rows of a 3 x 4 matrix for red, green, blue and one")  # fmt: skip
def recolour(
    picture: Picture,
    layer: str | int,
    hue: float = 0,
    saturation: float = 1,
    brightness: float = 1,
    tint: str | None = None,
    matrix: Sequence[float] | None = None,
) -> Picture:
    """Changes the colours of a layer, in the order of the parameters, on top of earlier changes.

    Args:
        picture: The picture.
        layer: Name or position of a layer, or name of a group.
        hue: Rotation of the hue in degrees.
        saturation: Factor of the saturation; 0 gives grey.
        brightness: Factor of red, green and blue.
        tint: ``#rrggbb``; colours become shades of it, by luminance. None for none.
        matrix: The 12 entries of a 3 x 4 matrix, row by row, applied to (red, green, blue, 1) in
            0..1; None for none.

    Raises:
        UsageError: An entry of the resulting matrix exceeds 256.
    """
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
    for each in shown_together(picture, layer):
        before = np.eye(4)
        if each.pose.colour:
            before[:3] = np.array(each.pose.colour).reshape(3, 4) / (1 << COLOUR_BITS)
        values = np.rint((change @ before)[:3] * (1 << COLOUR_BITS))
        if np.abs(values).max() > COLOUR_MAX:
            raise UsageError("recolour: the colours would change more than 256 times")
        rest = np.array_equal(values, np.eye(4)[:3] * (1 << COLOUR_BITS))
        colour = () if rest else tuple(int(v) for v in values.ravel())
        layers.append(replace(each, pose=replace(each.pose, colour=colour)))
    return substituted(picture, layers)


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
           source="layer: a layer of this picture, or the name of a .pxi or picture file",
           from_layer="foreign?: a layer of that .pxi file; its front one by default",
           fit="fit?: box to box, or by the shape of the outlines",
           effort="integer?: 1 to 9, how hard a picture file is encoded; 2 by default")  # fmt: skip
def texture(
    picture: Picture,
    layer: str | int,
    source: str,
    from_layer: str | int | None = None,
    fit: str = "box",
    effort: int = 2,
) -> Picture:
    """Gives a layer the texture of another layer, of another file's layer, or of a picture.

    Where boundaries cut the view of the source, the texture is filled from what lies clear of them:
    mixed samples would be an outline of the source in the middle of the layer.

    Args:
        picture: The picture.
        layer: Name or position of the layer that changes.
        source: Name of a layer of the picture, or of a `.pxi` file or picture file.
        from_layer: Name or position of a layer of that `.pxi` file; its front layer by default.
        fit: ``box`` stretches the texture from box to box; ``shape`` maps outline to outline.
        effort: How hard the encoder tries with a picture file, 1..9; other sources need none.

    Raises:
        UsageError: The source does not exist, or does not fit.
        InputError: The source cannot be read.
    """
    target = layer_named(picture, layer)
    networks = list(picture.networks)
    if source in {v.name for v in picture.layers}:
        if from_layer is not None:
            raise UsageError("texture: from_layer needs a .pxi file as source")
        home, origin = picture, layer_named(picture, source)
        shown = origin.texture
    else:
        home, origin = loaded(source, from_layer, effort)
        shown = brought(picture, home, origin, networks)
    if isinstance(shown, PyramidTexture) and shown.cuts is not None and origin is not target:
        shown = shown.masked(shown.cuts.everything)
    if isinstance(shown, PyramidTexture) and origin is not target:
        shown = without_matte(shown)
    if fit == "box" and origin is not target:
        shown = with_matte(shown, target, effort)
    if origin.sampling and fit == "shape":
        raise UsageError(
            f"texture: layer {origin.name!r} has its features at its own nodes, which do not fit "
            "the outline of another layer; stretch it box to box"
        )
    if origin.sampling and target.mesh is None:
        target = meshed(picture, target)
    new = replace(target, texture=shown, sampling=origin.sampling)
    if fit == "shape" or origin.pose.places is not None:
        matched = (target, picture.size, origin, home.size) if fit == "shape" else None
        new = _placed(meshed(picture, new), origin, matched)
    else:
        new = replace(new, pose=replace(new.pose, places=None))
    layers = [new if v.name == target.name else v for v in picture.layers]
    return changed(picture, layers, networks=networks)


def brought(picture: Picture, home: Picture, origin: Layer, networks: list[Network]) -> Texture:
    """Texture of layer `origin` of picture `home`, in a form that `picture` can use.

    Planes are taken as a whole, including the parts that other layers of their file show. A network
    or planes that `picture` has already are shared.

    Args:
        picture: The picture that gets the texture.
        home: The picture that the texture comes from.
        origin: The layer of `home` that has the texture.
        networks: Networks of `picture`; one is appended if the texture needs another.
    """
    texture = origin.texture
    if isinstance(texture, PyramidTexture):
        known = picture.planes
        return texture.renewed(
            {p: next((q for q in known if q.packed == p.packed), p) for p in texture.sources}
        )
    brought = home.network_of(origin)
    assert brought is not None, "an implicit texture has a network"
    same = (i for i, v in enumerate(networks) if v.packed == brought.packed)
    number = next(same, len(networks))
    if number == len(networks):
        networks.append(brought)
    return replace(texture, network=number)


def loaded(source: str, name: str | int | None, effort: int) -> tuple[Picture, Layer]:
    """Reads a `.pxi` file and chooses a layer of it, or encodes a picture file as one layer.

    A boundary that the picture gets, since it is clear outside, cuts the texture of the layer.

    Returns:
        The picture and the layer.

    Raises:
        UsageError: There is no such file, or `name` is given for a file that is not a `.pxi` file.
        InputError: The file cannot be read.
        PxiError: The encoder, which a picture file needs, is not installed.
    """
    try:
        with open(source, "rb") as file:
            known = file.read(4) == b"\x89PXI"
    except (FileNotFoundError, ValueError):
        raise UsageError(
            f"texture: {source!r} is neither a layer of the picture nor a file"
        ) from None
    except OSError as error:
        raise InputError(f"{source}: cannot be read: {error.strerror}") from None
    if known:
        found = from_file(source)
        return found, found.layers[-1 if name is None else name]
    if name is not None:
        raise UsageError(f"texture: {source} is not a .pxi file, which from_layer needs")
    from ..io.raster import read, stripped

    pixels = stripped(read(source)).pixels
    try:
        from ..encoder.encode import encode
    except ModuleNotFoundError as error:
        raise PxiError(
            f"the texture of a picture needs {error.name}: pip install 'proxyimg-codec[encode]'"
        ) from None
    made = encode(pixels, max_layers=1, effort=effort)
    layer = made.layers[0]
    if isinstance(layer.texture, PyramidTexture) and layer.texture.alpha is None:
        cuts = Occlusion.of([0] if layer.boundary else [], 0, [layer.boundary], layer.box)
        layer = replace(layer, texture=replace(layer.texture, cuts=cuts))
    return made, layer


Shapes = tuple[Layer, tuple[int, int], Layer, tuple[int, int]]
"""A layer and the size of its canvas; another layer and the size of that one's canvas.

The shape of the first is mapped to the shape of the second.
"""


def _placed(layer: Layer, origin: Layer, matched: Shapes | None) -> Layer:
    """Sets `places` of a layer so that its nodes show the texture of `origin` as `origin` does.

    Args:
        layer: A layer with a mesh and the texture of `origin`.
        origin: The layer that the texture comes from.
        matched: Two layers whose outlines are mapped to each other; None stretches box to box.
    """
    assert layer.mesh is not None, "`meshed` gave it one"
    rest = layer.mesh.refined.nodes / (1 << FRACTION_BITS)
    here, there = (np.array(v.box, float).reshape(2, 2) for v in (layer, origin))
    scale = here[1] / there[1]
    points = there[0] + (rest - here[0]) / scale if matched is None else _matched(rest, matched)
    if origin.pose.places is not None:
        assert origin.mesh is not None, "places need a mesh"
        refined = origin.mesh.refined
        fixed = np.rint(points * (1 << FRACTION_BITS)).astype(np.int64)
        face, weights = barycentric(fixed, refined.nodes, refined.faces)
        corners = origin.pose.places[refined.faces[face]]
        points += (weights[..., None] * corners).sum(1) / (1 << (WEIGHT_BITS + NODE_BITS))
    # The box of a layer never changes: the plane is stretched over it.
    shown = here[0] + (points - there[0]) * scale
    places = np.rint((shown - rest) * (1 << NODE_BITS))
    places = np.clip(places, 1 - NODE_MAX, NODE_MAX - 1).astype(np.int64)
    return replace(layer, pose=replace(layer.pose, places=places if places.any() else None))


def _matched(points: Reals, shapes: Shapes) -> Reals:
    """Maps points of a layer to the shape of another layer, outline to outline.

    The map is polar. A point in direction t from the centre of its shape, at a share r of the
    distance to the outline, is mapped to direction t and share r in the other shape.

    Args:
        points: float64 [N, 2] in canvas pixels.
        shapes: The two layers.

    Returns:
        float64 [N, 2] in pixels of the other canvas.
    """
    layer, size, origin, origin_size = shapes
    here, there = _Star(layer.boundary, size), _Star(origin.boundary, origin_size)
    away = points - here.centre
    angle = np.arctan2(away[:, 1], away[:, 0])
    ratio = there.reach(angle) / here.reach(angle)
    return np.asarray(there.centre + away * ratio[:, None])


class _Star:
    """Shape as the distance of its outline from its centre, in every direction."""

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
        """Distance of the outline from the centre in pixels, at least 1.

        Args:
            angle: float64 [N] directions in radians.

        Returns:
            float64 [N] distances.
        """
        place = (angle / (2 * math.pi) % 1) * self.DIRECTIONS - 0.5
        steps = np.arange(self.DIRECTIONS)
        found = np.interp(place % self.DIRECTIONS, steps, self._far, period=self.DIRECTIONS)
        return np.asarray(np.maximum(found, 1.0), np.float64)
