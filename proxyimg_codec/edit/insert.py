"""Operation that brings a layer of another file, or a cut-out picture, into a picture."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import UsageError
from ..geometry.mesh import FRACTION_BITS
from ..geometry.pose import Pose, fixed
from ..geometry.warp import rectangle
from ..model import Layer, Picture
from ..texture.pyramid import PyramidTexture
from .appearance import brought, loaded
from .operations import NAME_MAX, changed, checked_name, free_name, layer_named, operation
from .transforms import centre


@operation("insert", source="text: the name of a .pxi file, or of a picture file",
           from_layer="foreign?: a layer of that .pxi file; its front one by default",
           at="pair?: canvas point for its centre; by default that in its own file if both have "
              "the same size, otherwise the middle of the canvas",
           over="layer?: a layer that it lies just in front of; by default the front one",
           under="layer?: a layer that it lies just behind",
           name="text?: the new layer's name",
           effort="integer?: 1 to 9, how hard a picture file is encoded; 2 by default")  # fmt: skip
def insert(
    picture: Picture,
    source: str,
    from_layer: str | int | None = None,
    at: Sequence[float] | None = None,
    over: str | int | None = None,
    under: str | int | None = None,
    name: str | None = None,
    effort: int = 2,
) -> Picture:
    """Inserts a layer of another `.pxi` file, which is not encoded anew, or a picture file.

    Shape, texture and pose are kept; motion, parent and groups are not. Samples that are mixed with
    those of its neighbours in the other file do not come along. A picture file that is not clear
    anywhere becomes a rectangle.

    Raises:
        UsageError: There is no such file or layer, the place is behind an opaque back or out of
            range, or the layer is one of `--preset paper` that covers its canvas.
        InputError: The file cannot be read.
        PxiError: The encoder, which a picture file needs, is not installed.
    """
    place = _place(picture, over, under)
    if "\0" in source or not os.path.isfile(source):
        raise UsageError(f"insert: there is no file {source!r}")
    home, origin = loaded(source, from_layer, effort)
    if origin.sampling and origin.boundary is None:
        raise UsageError(
            f"insert: layer {origin.name!r} covers its canvas and has its features at its nodes, "
            "which fit no other canvas"
        )
    if at is None and home.size != picture.size:
        at = picture.width / 2, picture.height / 2
    networks = list(picture.networks)
    texture = brought(picture, home, origin, networks)
    if isinstance(texture, PyramidTexture) and texture.cuts is not None:
        alone = len(home.layers) == 1  # nothing is mixed into it
        cuts = texture.cuts.everything
        texture = replace(texture, cuts=None) if alone else texture.masked(cuts)
    new = replace(
        origin,
        name=_name(picture, origin, source, name),
        boundary=rectangle(home.size) if origin.boundary is None else origin.boundary,
        texture=texture,
        pose=_put(home, origin, at),
        parent=None,
        track=None,
    )
    layers = list(picture.layers)
    layers.insert(place, new)
    return changed(picture, layers, networks=networks)


def _place(picture: Picture, over: str | int | None, under: str | int | None) -> int:
    """Position of a new layer just in front of one, or just behind one.

    Raises:
        UsageError: Both are given, there is no such layer, or it is the back of an opaque picture.
    """
    if over is not None and under is not None:
        raise UsageError("insert: give over or under, not both")
    beside = over if under is None else under
    if beside is None:
        return len(picture.layers)
    layer = layer_named(picture, beside)
    found = next(i for i, v in enumerate(picture.layers) if v is layer)
    if under is not None and found == 0 and picture.opaque:
        raise UsageError(f"insert: nothing can be seen behind {layer.name!r}, the opaque back")
    return found + (under is None)


def _name(picture: Picture, origin: Layer, source: str, wanted: str | None) -> str:
    """Name of the new layer: the wanted one, or that of its layer or picture, made free."""
    if wanted is not None:
        return checked_name(picture, wanted)
    stem = Path(source).stem
    own = origin.name if origin.name != "picture" else stem
    printable = "".join(c if c.isprintable() else "?" for c in own)
    return free_name(picture, printable[: NAME_MAX - 8] or "picture")


def _put(home: Picture, origin: Layer, at: Sequence[float] | None) -> Pose:
    """Pose of a layer whose centre is moved to a canvas point; None leaves it where it is.

    Raises:
        UsageError: It would leave the range of coordinates.
    """
    pose = origin.pose
    if at is None:
        return pose
    x, y = centre(home, [origin])
    unit = 1 << FRACTION_BITS
    shift = (
        pose.shift[0] + round((at[0] - x) * unit),
        pose.shift[1] + round((at[1] - y) * unit),
    )
    pose = replace(pose, shift=shift)
    if fixed(pose.floats) is None:
        raise UsageError(f"insert: layer {origin.name!r} would leave the range of coordinates")
    return pose
