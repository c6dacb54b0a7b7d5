"""Neighbours of a layer that are no longer as they were when its texture was cut [PYR-46].

The layers of a pyramid picture are views of one raster. A view knows the boundaries that cut it
when it was made (`texture.occlusion`). The raster samples on such a boundary are mixtures of the
colours on both sides. They no longer fit once an edit has moved the boundary away, removed its
layer or changed its colours, nor where that layer is not drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

from ..geometry.boundary import Boundary
from ..geometry.warp import outline
from ..model import Layer, Picture
from ..texture.implicit import Box
from ..texture.occlusion import ALL_IN_PLACE, Moved
from ..texture.planes import Planes
from ..texture.pyramid import PyramidTexture, Texture

Size = tuple[int, int]


_OUTLINES: WeakKeyDictionary[Layer, tuple[Size, Boundary | None]] = WeakKeyDictionary()
_MOVED: WeakKeyDictionary[Picture, dict[tuple[Layer, frozenset[Layer]], Moved]] = (
    WeakKeyDictionary()
)


def present_outline(picture: Picture, layer: Layer) -> Boundary | None:
    """Boundary of a layer of `picture` in its present place; None for the whole canvas."""
    known = _OUTLINES.get(layer)
    if known is None or known[0] != picture.size:
        found = outline(layer.boundary, layer.pose, layer.mesh, picture.size)
        known = _OUTLINES[layer] = (picture.size, found)
    return known[1]


def moved_neighbours(
    picture: Picture, layer: Layer, drawn: frozenset[Layer] | None = None
) -> Moved:
    """Finds what has changed beside a layer since its view was cut; see `Moved`.

    Args:
        picture: The picture.
        layer: A layer of it.
        drawn: Layers that are drawn; by default those that are not hidden.
    """
    layers = picture.layers
    if drawn is None:
        drawn = _visible(layers)
    known = _MOVED.setdefault(picture, {})
    if (layer, drawn) not in known:
        home = next(k for k, v in enumerate(layers) if v.texture is layer.texture)
        known[layer, drawn] = _moved(layer, layers, home, drawn)
    return known[layer, drawn]


def _visible(layers: Sequence[Layer]) -> frozenset[Layer]:
    return frozenset(layer for layer in layers if not layer.pose.hidden)


def _moved(layer: Layer, layers: Sequence[Layer], home: int, drawn: frozenset[Layer]) -> Moved:
    """Finds what has changed beside a layer that shows a view.

    Args:
        layer: The layer.
        layers: All layers, back to front.
        home: Number of the layer for which the view was cut, the first one that shows it.
        drawn: Layers that are drawn.
    """
    view = layer.texture
    if not isinstance(view, PyramidTexture) or view.cuts is None:
        return ALL_IN_PLACE
    raster = place(view, view.cuts.box)
    still = [
        {v, layer} <= drawn and v.pose.still(layer.pose) and place(v.texture, v.box) == raster
        for v in layers
    ]
    views = ((k, v.texture) for k, v in enumerate(layers))
    soft = frozenset(k for k, t in views if isinstance(t, PyramidTexture) and t.matte)
    found = view.cuts.moved(home, [v.boundary for v in layers], still, soft)
    behind = zip(layers[: layers.index(layer)], still, strict=False)
    return found._replace(apart=bool(view.matte) and any(v in drawn and not s for v, s in behind))


def place(texture: Texture, box: Box) -> tuple[Planes, int, int] | None:
    """Planes that a texture shows over a box, and where on the canvas they begin.

    It is None if there are no planes, or they are stretched.
    """
    if not isinstance(texture, PyramidTexture) or texture.part[2:] != box[2:]:
        return None
    return texture.planes, box[0] - texture.part[0], box[1] - texture.part[1]


def settled(layers: Sequence[Layer]) -> list[Layer]:
    """Replaces cuts that a file cannot express by masks, in the views of all layers.

    A file names the layers whose boundaries cut a view. So these layers must still exist, and stand
    in front of the first layer that shows the view, or be that layer [PYR-40].
    """
    boundaries = [layer.boundary for layer in layers]
    shown: dict[Texture, Texture] = {}
    for i, layer in enumerate(layers):
        view = layer.texture
        if view in shown:
            continue
        shown[view] = view
        if isinstance(view, PyramidTexture) and view.cuts is not None:
            sharing = (k for k, v in enumerate(layers) if v.texture is view)
            home = next((k for k in sharing if layers[k].box == view.cuts.box), None)
            if home is None:
                shown[view] = view.masked(view.cuts.everything)
            elif home > i:
                shown[view] = view.masked(_moved(layers[home], layers, home, _visible(layers)))
            elif view.cuts.numbers(i, boundaries) is None:
                shown[view] = view.masked(*view.cuts.removed(i, boundaries))
    return [
        layer if shown[layer.texture] is layer.texture
        else replace(layer, texture=shown[layer.texture])
        for layer in layers
    ]  # fmt: skip
