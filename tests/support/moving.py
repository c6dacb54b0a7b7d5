"""A small picture that moves, made without a simulation."""

from dataclasses import replace

from conformance.make.builders import Numbers
from conformance.make.valid.motion import moving, track
from proxyimg_codec.api import Image
from proxyimg_codec.geometry.mesher import derived
from proxyimg_codec.geometry.track import Timeline
from proxyimg_codec.model import Layers
from tests.support import pyramids

LOOP = Timeline(1500, 8, True, 5, 2, '{"version": 1, "preset": "sway"}\n')
ONCE = replace(LOOP, loop=False, script="")


def picture(names=("bar", "disc"), line: Timeline = LOOP, reach: int = 12) -> Image:
    """64x48 pixels, the layers back, bar and disc, of which some move by up to some pixels.

    Args:
        names: What moves.
        line: The timeline.
        reach: Largest displacement of a shape in units of the timeline; there are two.
    """
    picture = pyramids.implicit().picture
    layers = [
        replace(v, mesh=derived(v.boundary, picture.size, 0.2)) if v.name in names else v
        for v in picture.layers
    ]
    n = Numbers("moving")
    tracks = {
        v.name: replace(track(n, v.mesh, line, 2, reach), body=k)
        for k, v in enumerate(layers)
        if v.name in names and v.mesh
    }
    return Image(moving(replace(picture, layers=Layers(layers)), line, tracks))
