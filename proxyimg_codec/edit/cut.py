"""Operation that makes a layer of its own out of a part of another one.

Nothing is encoded anew. Both show the same planes, or share the codes of an implicit texture among
them. What is taken no longer shows in the old layer, which is filled there as wherever something
hides it, and keeps its whole outline. So the picture looks as before until one of them is moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import PxiError, UsageError
from ..geometry import coverage as cover
from ..geometry import mesher
from ..geometry.boundary import Boundary
from ..geometry.pose import OPACITY_MAX
from ..model import Layer, Picture
from ..render.pixels import render
from ..texture.implicit import Box, ImplicitTexture
from ..texture.occlusion import REACH, Occlusion
from ..texture.pyramid import PyramidTexture, Texture
from .operations import changed, checked_name, free_name, layer_named, operation
from .regions import Bools, Ints, at_rest, coverage, eroded, extent, traced, within
from .structure import ONE

OPAQUE = 0.97
"""Least alpha of what is cut out; below it what remains would shine through."""

MARGIN = 2
"""Samples around a boundary that the interpolating kernel needs, and that are then filled."""


@operation("cut", layer=ONE, mask="text?: the name of a file with a mask of the canvas",
           points="pairs?: canvas points inside of what is cut out, where there is no mask",
           outside="pairs?: canvas points outside of it",
           name="text?: the new layer's name; by default that of the mask file")  # fmt: skip
def cut(
    picture: Picture,
    layer: str | int,
    mask: str | None = None,
    points: Sequence[Sequence[float]] | None = None,
    outside: Sequence[Sequence[float]] | None = None,
    name: str | None = None,
) -> Picture:
    """Makes a new layer, just in front, out of a part of a layer: by a mask, or by points.

    The new layer keeps a pixel away from the outline of the old one. It follows the old layer,
    unless that covers the canvas.

    Raises:
        UsageError: There is neither mask nor point, or both; nothing or everything of the layer
            lies inside; or the layer is in a state in which cutting would change the picture.
        InputError: The mask cannot be read or has not the size of the canvas.
        PxiError: The encoder, which finds what is pointed at, is not installed.
    """
    chosen = layer_named(picture, layer)
    _check(chosen)
    if (mask is None) == (points is None) or (mask is not None and outside is not None):
        raise UsageError("cut: give either a mask, or points inside of what is cut out")
    where = mask if mask is not None else f"what lies at {_listed(points or ())}"
    wanted = _mask(picture, chosen, mask, points or (), outside or ())
    box = extent(chosen.boundary, picture.size)
    covered = coverage(chosen.boundary, box)
    inside = _inside(picture, chosen, wanted, box, covered, where)
    boundary = traced(inside, box)
    if name is None:
        name = free_name(picture, _stem(mask) or f"{chosen.name} part")
    _check_alpha(picture, chosen, wanted)
    taken, left = _shared(chosen, boundary)
    whole = chosen.boundary is None
    part = replace(
        chosen,
        name=checked_name(picture, name),
        box=taken[0],
        boundary=boundary,
        texture=taken[1],
        parent=chosen.parent if whole else chosen.name,
    )
    if chosen.mesh is not None and chosen.track is None:
        part = replace(part, mesh=mesher.derived(boundary, picture.size))
    layers = list(picture.layers)
    at = next(i for i, v in enumerate(layers) if v is chosen)
    layers[at : at + 1] = [replace(chosen, texture=left), part]
    return changed(picture, layers)


def _check(layer: Layer) -> None:
    """Refuses layers that would look different once they are cut."""
    pose = layer.pose
    said = f"cut: layer {layer.name!r}"
    if pose.hidden:
        raise UsageError(f"{said} is hidden; --show it first")
    if pose.opacity != OPACITY_MAX:
        raise UsageError(f"{said} is translucent, so that both would show; set its opacity after")
    if pose.nodes is not None:
        raise UsageError(f"{said} is bent; cut it first, then bend it")
    if pose.places is not None:
        raise UsageError(f"{said} has a texture that is fitted to its shape; cut it first")
    if layer.sampling:
        raise UsageError(
            f"{said} has its features at its own nodes, which do not fit another outline; encode "
            "the picture with other settings than --preset paper"
        )
    texture = layer.texture
    if isinstance(texture, PyramidTexture) and texture.part[2:] != layer.box[2:]:
        raise UsageError(f"{said} has a texture that is stretched over it; cut the layer it is of")


def _listed(points: Sequence[Sequence[float]]) -> str:
    return " and ".join(f"{x:g},{y:g}" for x, y in points)


def _stem(mask: str | None) -> str:
    """Name of the region of a mask file; empty without one."""
    if mask is None:
        return ""
    from ..encoder.shapes.mask_files import region_name

    return region_name(Path(mask))


def _mask(
    picture: Picture, layer: Layer, mask: str | None, points: Sequence[Sequence[float]],
    outside: Sequence[Sequence[float]],
) -> Bools:  # fmt: skip
    """Mask of what is wanted, bool [H, W] on the canvas: that of a file, or what is at points."""
    try:
        from ..encoder.shapes.find import find_layers
        from ..encoder.shapes.mask_files import load_mask
    except ModuleNotFoundError as error:
        raise PxiError(f"cut needs {error.name}: pip install 'proxyimg-codec[encode]'") from None
    if mask is not None:
        return load_mask(mask, *picture.size)
    pixels = alone = render(picture, layers=[layer.name])
    if alone.shape[2] == 4:  # edges are found more easily where there is something beyond them
        pixels = render(picture)
        own = alone[..., 3] > 127
        pixels[own] = alone[own][:, : pixels.shape[2]]
    named = "inside"
    hints = {named: [(x, y) for x, y in points]}
    others = {named: [(x, y) for x, y in outside]} if outside else None
    found = find_layers(pixels, points=hints, negatives=others)
    return next(region.mask for region in found if region.name == named)


def _inside(
    picture: Picture, layer: Layer, wanted: Bools, box: Box, covered: Ints, where: str
) -> Bools:
    """Part of a layer at rest that becomes a new layer, bool [height, width] of `box`.

    Along its outline a layer keeps the outermost pixel: the coverage of both would add up there.

    Raises:
        UsageError: It has no pixels, none that shows, or all of the layer's.
    """
    full = covered == cover.FULL
    inside = at_rest(layer, wanted, box, covered) & eroded(full, layer.boundary is None)
    if not inside.any():
        raise UsageError(f"cut: {where} has nothing of layer {layer.name!r}; it lies elsewhere")
    if inside[eroded(full, layer.boundary is None)].all():
        raise UsageError(
            f"cut: {where} has all of layer {layer.name!r}, nothing would be left; take less, for "
            "points by others outside of it (@!X,Y), or --duplicate it"
        )
    texture = layer.texture
    if isinstance(texture, PyramidTexture) and texture.shown is not None:
        x, y = layer.box[0] - box[0], layer.box[1] - box[1]
        row, column = np.nonzero(inside)
        row, column = row - y, column - x
        height, width = texture.shown.shape
        there = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        if not texture.shown[row[there], column[there]].any():
            raise UsageError(
                f"cut: {where} has nothing of layer {layer.name!r} that can be seen; others hide it"
            )
    return inside


def _check_alpha(picture: Picture, layer: Layer, wanted: Bools) -> None:
    """Refuses parts whose texture is translucent: what remains behind would shine through.

    Raises:
        UsageError: The texture has alpha, and is not opaque in a pixel that lies well inside.
    """
    if layer.texture.channels(picture.networks) < 4:
        return
    alpha = render(picture, layers=[layer.name], dtype=np.float32)[..., 3]
    inside = wanted & eroded(alpha > 0, True)
    if (alpha[inside] < OPAQUE).any():
        raise UsageError(
            f"cut: layer {layer.name!r} is translucent in places there, so that what remains of it "
            "would show as well; keep to its opaque parts"
        )


Part = tuple[Box, Texture]


def _shared(layer: Layer, boundary: Boundary) -> tuple[Part, Texture]:
    """Shares the texture of a layer between a part with a boundary and the rest of it.

    Returns:
        Box and texture of the part, and the texture of the rest.
    """
    texture = layer.texture
    if isinstance(texture, ImplicitTexture):
        return _codes(texture, layer.box, boundary)
    left, top, right, bottom = boundary.bounds()
    x, y, width, height = layer.box
    side = 1 << texture.cell  # cells of a mask begin at its corner
    x0, y0 = (max(v, 0) // side * side for v in (left - MARGIN - x, top - MARGIN - y))
    x1, y1 = min(right + MARGIN - x, width), min(bottom + MARGIN - y, height)
    if texture.behind is not None:  # it is stretched over the whole part
        x0, y0, x1, y1 = 0, 0, width, height
    box = x + x0, y + y0, x1 - x0, y1 - y0
    mask = texture.mask
    if mask is not None:
        mask = mask[y0 // side : -(-y1 // side), x0 // side : -(-x1 // side)]
        mask = None if mask.all() else mask
    cell = 0 if mask is None else texture.cell
    part = texture.part[0] + x0, texture.part[1] + y0, *box[2:]
    old = texture.cuts
    if old is None:
        old = Occlusion(None, (), layer.box, within(texture.mask, texture.cell, texture.part))
    near = coverage(boundary, box) > 0
    for _ in range(REACH):
        near = ~eroded(~near, True)
    own = Occlusion(
        boundary,
        tuple(front for front in old.fronts if (coverage(front, box)[near] > 0).any()),
        box,
        within(mask, cell, part),
        texture.matte is None,
    )
    return (
        (box, replace(texture, part=part, cell=cell, mask=mask, cuts=own, copies=None)),
        replace(texture, cuts=replace(old, fronts=(*old.fronts, boundary))),
    )


def _codes(texture: ImplicitTexture, box: Box, boundary: Boundary) -> tuple[Part, Texture]:
    """Shares the codes of a texture: each side stores those that its own pixels depend on."""
    covered = coverage(boundary, box)
    taken = texture.stored & _touched(covered > 0, texture.grid, box)
    left = texture.stored & _touched(covered < cover.FULL, texture.grid, box)
    one, other = (
        replace(texture, stored=stored, codes=np.where(stored, texture.codes, np.int8(0)))
        for stored in (v if v.any() else texture.stored for v in (taken, left))
    )
    return (box, one), other


def _touched(pixels: Bools, grid: tuple[int, int], box: Box) -> Bools:
    """Codes that points in some pixels of a box depend on, bool [rows, columns] of a grid.

    Args:
        pixels: bool [height, width] of the box.
        grid: Columns and rows of the codes, whose corners lie on those of the box.
        box: Rectangle x, y, width, height.
    """
    out = pixels
    for axis, (codes, extent_) in enumerate(zip(grid[::-1], (box[3], box[2]), strict=True)):
        edge = np.arange(extent_ + 1) * ((codes - 1) / extent_)
        low = np.minimum(np.floor(edge[:-1]), codes - 2).astype(int)
        high = np.minimum(np.floor(edge[1:]), codes - 2).astype(int) + 1
        moved = np.moveaxis(out, axis, 0)
        # Starts and ends of the runs of codes that each pixel needs, counted up along the axis.
        change = np.zeros((codes + 1, moved.shape[1]), np.int32)
        np.add.at(change, low, moved.astype(np.int32))
        np.add.at(change, high + 1, -moved.astype(np.int32))
        out = np.moveaxis(np.cumsum(change, 0)[:-1] > 0, 0, axis)
    return np.asarray(out)
