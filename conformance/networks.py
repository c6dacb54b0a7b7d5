"""Valid cases of decoder networks and their numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture
from proxyimg_codec.texture.network import Network

from .builders import (
    SIZE,
    Numbers,
    ellipse,
    layer,
    network,
    on_back,
    picture,
    polygon,
    texture,
)  # fmt: skip
from .registry import WHOLE, Build, Valid, Valids

CASES = Valids()
_case = CASES.case


def _octaves(octaves: int) -> Build:
    def build(n: Numbers) -> Picture:
        back = layer("back", (0, 0, 16, 12), texture(n, dim=2, reach=1))
        # In single precision, what is left of a feature in the highest octaves is little.
        net = network(n, dim=2, octaves=octaves, hidden=8, contrast=0.6 if octaves < 9 else 0.2)
        return picture((16, 12), [back], net)

    return build


for _count in range(1, 13):
    if _count != 7:
        CASES[f"octaves-{_count}"] = Valid(
            f"{_count} octave{'s' if _count > 1 else ''}", ("network: octaves",), _octaves(_count),
            [WHOLE],
        )  # fmt: skip


@_case("The most features, and few of everything else", "network: depth and width")
def _network_wide(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 16, 12), texture(n, dim=64, grid=(3, 2)))
    return picture((16, 12), [back], network(n, dim=64, octaves=0, hidden=1, depth=1))


@_case("Steps of the smallest and the largest float16, biases of both signs and minus zero",
       "TEX-3", "TEX-10", "TEX-16", "TEX-17")  # fmt: skip
def _network_steps(n: Numbers) -> Picture:
    net = network(n, dim=3, octaves=0, hidden=4)
    smallest, largest = np.float16(2.0**-24), np.float16(65504)
    # Hidden values that are huge, times steps that are tiny.
    steps = net.steps.copy()
    steps[:2] = largest, smallest
    steps[4:] = smallest
    biases = net.biases.copy()
    biases[:4] = [-5000, 65504, -0.0, 0.25]
    plane = texture(n)
    plane = replace(plane, steps=np.array([smallest, 2.0**-11, 2.0**-10], np.float16))
    back = layer("back", (0, 0, 16, 12), plane)
    return picture((16, 12), [back], replace(net, steps=steps, biases=biases))


def _huge(n: Numbers) -> Network:
    """A network in which infinities arise, of both signs, and differences of them."""
    net = network(n, dim=3, octaves=0, hidden=4, depth=8)
    steps = np.full_like(net.steps, np.float16(65504))
    return replace(net, steps=steps)


@_case("A network whose numbers overflow, in a layer of no opacity: a decoder must survive it",
       "TEX-18", "TEX-19", "MSH-35", "SEC-1")  # fmt: skip
def _network_overflow(n: Numbers) -> Picture:
    shape = ellipse((12, 9), (7, 5.5))
    glass = layer("glass", (4, 3, 16, 12), texture(n, network=1), shape, pose=Pose(opacity=0))
    back = layer("back", (0, 0, *SIZE), texture(n))
    return picture(SIZE, [back, glass], network(n), _huge(n))


@_case("Several layers with several holes each, through which others and nothing show",
       "coverage: hole", "compositing: order", "alpha: from coverage alone",
       renders=[WHOLE, {"region": [4, 3, 9, 7], "width": 36}])  # fmt: skip
def _holes(n: Numbers) -> Picture:
    w, h = SIZE
    sheet = polygon((1, 1), (w - 1, 1), (w - 1, h - 1), (1, h - 1))
    first = sheet, ellipse((8, 8), (4, 4), reverse=True), ellipse((17, 9), (3, 5), reverse=True)
    second = (
        ellipse((12, 9), (11, 8)),
        polygon((5, 5), (11, 6), (8, 13), reverse=True),
        polygon((14, 4), (20, 9), (14, 14), reverse=True),
        ellipse((17, 9), (1.5, 1.5)),
    )
    return picture(
        SIZE,
        [
            layer("first", (0, 0, w, h), texture(n), *first),
            layer("second", (0, 0, w, h), texture(n), *second),
            layer("third", (3, 2, 16, 12), texture(n), ellipse((11, 9), (9, 3)),
                  ellipse((8, 9), (2, 2), reverse=True), ellipse((14, 9), (2, 2), reverse=True)),
        ],
        network(n),
        opaque=False,
    )  # fmt: skip


@_case("Boundaries in all units, from whole pixels to 1/64", "boundary: unit", "GEO-7",
       renders=[WHOLE, {"width": 53}])  # fmt: skip
def _units(n: Numbers) -> Picture:
    w, h = SIZE
    shown = texture(n)
    parts = []
    for unit in range(7):
        x = 1.4 + 3.1 * unit
        shape = polygon((x, 1.3), (x + 3.7, 4.2), (x + 1.1, 16.6), unit=unit)
        parts.append(layer(f"in {1 << unit}", (0, 0, w, h), shown, shape, unit=unit))
    return on_back(n, *parts)
