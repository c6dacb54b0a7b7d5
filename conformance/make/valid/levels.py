"""Valid cases of levels 2 and 3 of every profile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.geometry.track import Track
from proxyimg_codec.model import Picture

from ..builders import (
    SIZE,
    Numbers,
    disc,
    ellipse,
    grid_mesh,
    layer,
    network,
    on_back,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..frames import frame
from ..registry import WHOLE, Build, Valid, Valids
from .metadata import scripted
from .motion import LOOP, moving

CASES = Valids()
_case = CASES.case


def _large(w: int, h: int) -> Build:
    """Builder of a large canvas with a disc in its lower right corner."""

    def build(n: Numbers) -> Picture:
        shape = ellipse((w - 12, h - 9), (11, 8.5), unit=5)
        back = layer("back", (0, 0, w, h), texture(n, grid=(9, 8)))
        return picture((w, h), [back, layer("end", (w - 24, h - 18, 24, 18), texture(n), shape,
                                            unit=5)], network(n))  # fmt: skip

    return build


for _level, _wide, _high in ((2, 1 << 14, 12_000), (3, 1 << 20, 250)):
    CASES[f"level-{_level}-still"] = Valid(
        f"A canvas of {_wide:,} by {_high:,} pixels, of which parts are shown",
        ("LEV-1", "LEV-3", "SEC-2", "SEC-5", "GEO-7", "GEO-16", "render: region"),
        _large(_wide, _high),
        [{"region": [_wide - 24, _high - 18, 24, 18]}, {"region": [0, 0, 9, 8]}],
    )  # fmt: skip


@_case("65 layers, most of which are hidden", "LEV-1", "LEV-3", "SEC-2", "pose: hidden",
       renders=[WHOLE, {"layers": ["part 7", "part 49"]}], name="level-2-posed")  # fmt: skip
def _many_layers(n: Numbers) -> Picture:
    shown = texture(n)
    shape = polygon((1, 1), (5, 2), (2, 5))
    shifts = [((k * 1024 * 7) % 18_000, (k * 1024 * 5) % 13_000) for k in range(64)]
    parts = [
        layer(f"part {k}", (0, 0, 6, 6), shown, shape,
              pose=Pose(shift=shift, hidden=k % 13 > 0) if k else Pose())
        for k, shift in enumerate(shifts)
    ]  # fmt: skip
    return on_back(n, *parts)


@_case("64 networks, and layers that use some of them", "LEV-1", "LEV-3", "SEC-2",
       "networks: several", name="level-3-posed")  # fmt: skip
def _many_networks(n: Numbers) -> Picture:
    shape = polygon((1, 1), (9, 2), (3, 8))
    back = layer("back", (0, 0, *SIZE), texture(n, dim=1, network=40))
    parts = [
        layer(f"by {k}", (0, 0, 9, 9), texture(n, dim=1, network=k), shape,
              pose=Pose(shift=(2500 * k // 9, 1700 * k // 9)))
        for k in (1, 2, 17, 33, 63)
    ]  # fmt: skip
    nets = [network(n, dim=1, hidden=2, octaves=1) for _ in range(64)]
    return picture(SIZE, [back, *parts], *nets)


@_case("Four curves of 16,400 coefficients each", "LEV-1", "LEV-3", "SEC-2", "MOT-3", "MOT-6",
       renders=[WHOLE, {"time": 1799.91}, {"time": 0.2}], name="level-2-moving")  # fmt: skip
def _long_timeline(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 3, 3)
    line = replace(LOOP, duration=3_600_000, intervals=16_400)
    curves = np.zeros((4, line.coefficients), np.int64)
    for k, row in enumerate(curves):
        row[8198 + k : 8201 + k] = 200, -150, 256
        row[k : k + 3] = -150, 70, 256
    shapes = n.integers(-24, 24, (4, *mesh.refined.nodes.shape))
    return moving(on_back(n, disc(n, mesh)), line, {"disc": Track(curves, shapes)})


@_case("A script of 16 megabytes and a bit", "LEV-1", "LEV-3", "SEC-2", "SEC-6", "MOT-10",
       renders=[WHOLE, {"time": 0.4}], name="level-3-moving")  # fmt: skip
def _script_large(n: Numbers) -> bytes:
    return scripted(frame(b"{}", (32, 1 << 24)), (1 << 24) + 2)
