"""Neighbours of a layer that have moved since its texture was cut [PYR-46].

The layers of a pyramid picture are views of one raster. A view knows the boundaries that cut it
when it was made (`texture.occlusion`). The raster samples on such a boundary are mixtures of the
colours on both sides. They no longer fit once an edit has moved the boundary away or removed its
layer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

from ..geometry.boundary import Boundary
from ..geometry.pose import Pose
from ..geometry.warp import outline
from ..model import Layer, Picture
from ..texture.occlusion import ALL_IN_PLACE, Moved
from ..texture.pyramid import PyramidTexture, Texture

Size = tuple[int, int]


_OUTLINES: WeakKeyDictionary[Layer, tuple[Size, Boundary | None]] = WeakKeyDictionary()
_MOVED: WeakKeyDictionary[Picture, dict[Layer, Moved]] = WeakKeyDictionary()


def present_outline(picture: Picture, layer: Layer) -> Boundary | None:
    """Boundary of a layer of `picture` in its present place; None for the whole canvas."""
    known = _OUTLINES.get(layer)
    if known is None or known[0] != picture.size:
        found = outline(layer.boundary, layer.pose, layer.mesh, picture.size)
        known = _OUTLINES[layer] = (picture.size, found)
    return known[1]


def moved_neighbours(picture: Picture, layer: Layer) -> Moved:
    """Finds what has moved relative to a layer since its view was cut; see `Moved`."""
    known = _MOVED.setdefault(picture, {})
    if layer not in known:
        layers = picture.layers
        home = next(k for k, v in enumerate(layers) if v.texture is layer.texture)
        known[layer] = _moved(layer.texture, layer.pose, layers, home)
    return known[layer]


def _moved(view: Texture, pose: Pose, layers: Sequence[Layer], home: int) -> Moved:
    """Finds what has moved relative to a layer that shows a view.

    Args:
        view: Texture of the layer.
        pose: Pose of the layer.
        layers: All layers, back to front.
        home: Number of the layer for which the view was cut, the first one that shows it.
    """
    if not isinstance(view, PyramidTexture) or view.cuts is None:
        return ALL_IN_PLACE
    boundaries = [v.boundary for v in layers]
    still = [v.pose.still(pose) for v in layers]
    raster = [
        isinstance(v.texture, PyramidTexture) and v.texture.planes is view.planes for v in layers
    ]
    return view.cuts.moved(home, boundaries, still, raster)


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
                shown[view] = view.masked(_moved(view, layers[home].pose, layers, home))
            elif view.cuts.numbers(i, boundaries) is None:
                shown[view] = view.masked(*view.cuts.removed(i, boundaries))
    return [
        layer if shown[layer.texture] is layer.texture
        else replace(layer, texture=shown[layer.texture])
        for layer in layers
    ]  # fmt: skip
