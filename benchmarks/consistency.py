"""Consistency of the frames of an animation: along its flow, and in features of gradients.

This is a part of `benchmarks.animation`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.common import Pixels, centre_crop, kodak, read_rgb
from proxyimg_codec.animate.animate import amplitude
from proxyimg_codec.animate.motion import PRESETS
from proxyimg_codec.api import Image
from proxyimg_codec.bench.consistency import ENLARGED, MARGIN, pair, rms
from proxyimg_codec.bench.features import distance

__all__ = ["features", "flow", "rms"]

Moving = Callable[[Image, str], Image]

PAIRS = 7
"""Pairs of consecutive frames, spread over the clip."""


def flow(images: dict[str, Image], moving: Moving) -> Iterator[str]:
    """Yields lines on temporal consistency, for each coder and preset.

    Args:
        images: A picture by each coder.
        moving: Gives a picture the motion of a preset.
    """
    yield (
        f"flow: RMS difference of consecutive frames in 8-bit levels, {MARGIN} px within moving "
        f"layers, {PAIRS} pairs: warped along the known flow from frames of {ENLARGED}x, from "
        "frames as they are (with OpenCV's cubic interpolation), and of standing still; share of "
        "pixels compared; displacement from frame to frame, mean in px"
    )
    for texture, image in images.items():
        for name in PRESETS:
            moved = moving(image, name)
            assert moved.timeline is not None
            count, fps = moved.timeline.frames, moved.timeline.fps
            at = [k * count // PAIRS for k in range(PAIRS)]
            sums = np.sum([pair(moved.at(k / fps), moved.at((k + 1) / fps)) for k in at], axis=0)
            pixels, *squares, length = sums.tolist()
            exact, plain, idle = (np.sqrt(s / max(pixels, 1)) for s in squares)
            share = 100 * pixels / (PAIRS * image.width * image.height)
            yield (
                f"  {texture:8s} {name:7s} {exact:5.2f} {plain:5.2f} {idle:6.2f}  {share:2.0f} %  "
                f"{length / max(pixels, 1):.2f} px"
            )


def features(images: dict[str, Image], moving: Moving, data: Path) -> Iterator[str]:
    """Yields lines on the distance of frames from the still, for each preset.

    For comparison, the first lines have the distance of other pictures.
    """
    yield (
        "features: HOG distance of frames from the still, mean in cells of 8, 16 and 32 px "
        "(histograms of oriented gradients; not a learned metric: the weights of LPIPS, CLIP or "
        "DINO come with none of the packages used here); displacement of nodes, mean in px"
    )
    image = images["pyramid"]
    still = image.render()
    others = [centre_crop(read_rgb(p)) for p in kodak(data) if "23" not in p.stem]
    scales = {"other Kodak pictures": others, "the still, 8 px aside": [np.roll(still, 8, 1)]}
    for what, pictures in scales.items():
        yield f"  {_mean(still, pictures)}  for scale: {what}"
    for name in PRESETS:
        moved = moving(image, name)
        assert moved.timeline is not None
        shown = [moved.render(t=k * moved.timeline.seconds / PAIRS) for k in range(PAIRS)]
        yield f"  {_mean(still, shown)}  {name:7s} {amplitude(moved):.1f} px"


def _mean(still: Pixels, shown: list[Pixels]) -> str:
    mean = np.mean([distance(still, frame) for frame in shown], axis=0)
    return " ".join(f"{v:.3f}" for v in mean)
