"""A picture that moves, at a moment of its timeline."""

from __future__ import annotations

from dataclasses import replace

from ..errors import UsageError
from ..model import Layer, Layers, Picture


def at(picture: Picture, t: float) -> Picture:
    """The still that a picture that moves is at a time in seconds.

    Before and after its timeline a picture stays as it is at its ends, unless it loops.

    Raises:
        UsageError: The picture has no timeline, or the time is not a number.
    """
    line = picture.timeline
    if line is None:
        raise UsageError("the picture does not move; give it a motion first (pxi-animate)")

    def still(layer: Layer) -> Layer:
        if layer.track is None:
            return layer
        pose = replace(layer.pose, sway=layer.track.at(line, t), body=layer.track.body)
        return replace(layer, pose=pose, track=None)

    return replace(picture, layers=Layers(map(still, picture.layers)), timeline=None, history=())
