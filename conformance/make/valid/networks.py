"""Valid cases of decoder networks and their numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture
from proxyimg_codec.texture.network import Network

from ..builders import (
    SIZE,
    Numbers,
    ellipse,
    layer,
    network,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Build, Valid, Valids

CASES = Valids()
_case = CASES.case


def _octaves(octaves: int) -> Build:
    """Builder of a layer whose network has `octaves` octaves."""

    def build(n: Numbers) -> Picture:
        back = layer("back", (0, 0, 16, 12), texture(n, dim=2, reach=1))
        # In the highest octaves, single precision leaves few correct bits of a feature.
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
    # Huge hidden values are multiplied by tiny steps.
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
    """Network in which infinities of both signs arise, and differences of infinities."""
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


@_case("Layers with networks of different sizes", "networks: several", "network: depth and width")
def _networks(n: Numbers) -> Picture:
    sizes = [
        {"dim": 3, "octaves": 1, "hidden": 6, "depth": 1},
        {"dim": 1, "octaves": 2, "hidden": 3, "depth": 8},
        {"dim": 5, "octaves": 0, "hidden": 1, "depth": 2},
    ]
    planes = [texture(n, dim=s["dim"], network=i) for i, s in enumerate(sizes)]
    return picture(
        (24, 20),
        [
            layer("back", (0, 0, 24, 20), planes[2]),
            layer("disc", (1, 2, 14, 14), planes[0], ellipse((8, 9), (6, 6))),
            layer("box", (10, 6, 12, 12), planes[1], polygon((11, 8), (21, 8), (21, 17), (11, 17))),
        ],
        *[network(n, bits=4, **s) for s in sizes],
    )


@_case("No frequency encoding", "network: octaves")
def _octaves_0(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 16, 12), texture(n, reach=1.5))
    return picture((16, 12), [back], network(n, octaves=0))


@_case("Seven octaves, and features far beyond one turn", "network: octaves")
def _octaves_7(n: Numbers) -> Picture:
    back = layer("back", (0, 0, 16, 12), texture(n, dim=2, grid=(3, 2), reach=3.0))
    return picture((16, 12), [back], network(n, dim=2, octaves=7, hidden=8))
