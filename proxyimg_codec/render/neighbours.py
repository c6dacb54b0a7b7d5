"""How layers lie beside those that their textures were cut against, once edits have moved some.

A view of planes knows the boundaries that took samples from it when it was made (`texture.cuts`).
Where such a boundary has moved away or gone, samples that were mixed with it no longer fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..geometry.boundary import Boundary
from ..geometry.pose import Pose
from ..geometry.warp import outline
from ..model import Layer, Picture
from ..texture.occlusion import ALL_IN_PLACE, Moved
from ..texture.pyramid import PyramidTexture, Texture


def present_outline(picture: Picture, layer: Layer) -> Boundary | None:
    """The boundary of one of its layers in its present place; None for the whole canvas."""
    return outline(layer.boundary, layer.pose, layer.mesh, picture.size)


def moved_neighbours(picture: Picture, layer: Layer) -> Moved:
    """What no longer lies to a layer as it did when the samples of its view were mixed."""
    layers = picture.layers
    home = next(k for k, v in enumerate(layers) if v.texture is layer.texture)
    return _moved(layer.texture, layer.pose, layers, home)


def _moved(view: Texture, pose: Pose, layers: Sequence[Layer], home: int) -> Moved:
    """What has moved away from a view, cut for layer `home`, that a layer in a pose shows."""
    if not isinstance(view, PyramidTexture) or view.cuts is None:
        return ALL_IN_PLACE
    boundaries = [v.boundary for v in layers]
    still = [v.pose.still(pose) for v in layers]
    raster = [
        isinstance(v.texture, PyramidTexture) and v.texture.planes is view.planes for v in layers
    ]
    return view.cuts.moved(home, boundaries, still, raster)


def settled(layers: Sequence[Layer]) -> list[Layer]:
    """Layers whose views have a mask for each boundary that cut them and is gone."""
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
