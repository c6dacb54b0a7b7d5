"""Traced outlines (VTracer by visioncortex), where the package `vtracer` is installed."""

from __future__ import annotations

import re
from importlib.util import find_spec
from itertools import product

import cv2
import numpy as np

from ..features import Pixels
from ..measure import mean_square

SPECKLES, DIFFERENCES, DIGITS = (4, 16, 64), (8, 32, 96), (3, 5, 7)
"""Settings that are tried: least patches, least differences of colour, and bits of a colour."""

PIECES = 8
"""Straight pieces that a segment is drawn as."""

FINE = 4
"""Samples across and down of a pixel."""

_PATH = re.compile(
    r'<path d="([^"]*)" fill="#(..)(..)(..)" transform="translate\(([-\d.]+),([-\d.]+)\)"'
)


def available() -> bool:
    """Whether the package is installed."""
    return find_spec("vtracer") is not None


def traced(pixels: Pixels, parameters: int | None) -> tuple[Pixels, int]:
    """Traces a picture uint8 [H, W, 3] with the settings that suit a budget best, if there is one.

    Returns:
        The picture that the outlines make, uint8 [H, W, 3], and their number of parameters: all
        coordinates, and three for each colour. If no settings lead to as few parameters as asked
        for, the result is the smallest.
    """
    found = [drawn(svg, pixels.shape) for svg in dict.fromkeys(_svgs(pixels))]
    small = [f for f in found if parameters is None or f[1] <= parameters]
    if small:
        return min(small, key=lambda f: mean_square(pixels, f[0]))
    return min(found, key=lambda f: f[1])


def _svgs(pixels: Pixels) -> list[str]:
    import vtracer

    height, width = pixels.shape[:2]
    opaque = [(*map(int, p), 255) for p in pixels.reshape(-1, 3)]
    return [
        vtracer.convert_pixels_to_svg(
            opaque, (width, height), filter_speckle=speckle, layer_difference=difference,
            color_precision=digits, path_precision=2,
        )
        for speckle, difference, digits in product(SPECKLES, DIFFERENCES, DIGITS)
    ]  # fmt: skip


def drawn(svg: str, shape: tuple[int, ...]) -> tuple[Pixels, int]:
    """Draws the paths that VTracer writes; returns the picture and their number of parameters."""
    height, width = shape[:2]
    canvas = np.full((height * FINE, width * FINE, 3), 255, np.uint8)
    count = 0
    for data, *rest in _PATH.findall(svg):
        colour = tuple(int(c, 16) for c in rest[:3])
        move = np.array([float(v) for v in rest[3:]])
        contours = [_contour(part) for part in data.split("M")[1:]]
        count += 3 + sum(number for _, number in contours)
        shown = [np.rint(((c + move) * FINE - 0.5) * 16).astype(np.int32) for c, _ in contours]
        cv2.fillPoly(canvas, shown, colour, shift=4)
    small = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8), count


def _contour(text: str) -> tuple[np.ndarray, int]:
    """Points [n, 2] of a contour, and its number of coordinates without the last, the first."""
    points = [np.zeros(2)]
    count = 0
    t = (np.arange(1, PIECES + 1) / PIECES)[:, None]
    for kind, numbers in re.findall(r"([A-Z]?)([-\d. ]+)", text):
        at = np.array(numbers.split(), float).reshape(-1, 2)
        count += at.size
        if kind == "C":
            for a, b, end in at.reshape(-1, 3, 2):
                start = points[-1]
                points += list((1 - t) ** 3 * start + 3 * t * (1 - t) ** 2 * a
                               + 3 * t * t * (1 - t) * b + t**3 * end)  # fmt: skip
        else:
            points += list(at)
    return np.array(points[1:]), count - 2
