"""Still picture of a moment of a motion."""

from __future__ import annotations

from dataclasses import replace

from ..errors import UsageError
from ..model import Layer, Layers, Picture


def at(picture: Picture, t: float) -> Picture:
    """Returns one moment of an animated picture as a still picture without history.

    Args:
        picture: The picture with a timeline.
        t: Time in seconds. A timeline that loops repeats; otherwise a time before its start or
            after its end counts as its start or end.

    Raises:
        UsageError: The picture has no timeline, or `t` is not a finite number.
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


def displacements(picture: Picture) -> list[tuple[bytes, int | None] | None]:
    """For each layer its displacements at a moment of a timeline, and its body, or None.

    No file holds them.
    """
    poses = (layer.pose for layer in picture.layers)
    return [None if v.sway is None else (v.sway.tobytes(), v.body) for v in poses]
