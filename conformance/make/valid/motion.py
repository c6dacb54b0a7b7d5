"""Valid cases of motion; the first render of each is the still, which every reader can show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from proxyimg_codec.geometry.boundary import Boundary
from proxyimg_codec.geometry.mesh import Mesh
from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.geometry.track import Timeline, Track
from proxyimg_codec.model import Layer, Layers, Picture
from proxyimg_codec.texture.occlusion import Occlusion

from ..builders import (
    SIZE,
    Numbers,
    bend,
    disc,
    grid_mesh,
    layer,
    on_back,
    picture,
    polygon,
    texture,
)
from ..registry import WHOLE, Args, Valid, Valids
from .meshes import CLOSE, TURN
from .pyramids import coded, view
from .views import RING, pieces

CASES = Valids()
_case = CASES.case

LOOP = Timeline(1500, 12, True, 5, 4)
ONCE = Timeline(1501, 25, False, 4, 4, '{"version": 1, "preset": "sway"}\n')


def track(n: Numbers, mesh: Mesh, line: Timeline, modes: int = 2, reach: int = 24) -> Track:
    """Track of random curves of magnitude 1 or less, and random shapes up to `reach` units."""
    return Track(
        n.integers(-256, 256, (modes, line.coefficients)),
        n.integers(-reach, reach, (modes, *mesh.refined.nodes.shape)),
    )


def moving(image: Picture, line: Timeline, tracks: Mapping[str, Track]) -> Picture:
    """Picture whose layers move, by name."""
    layers = [replace(v, track=tracks.get(v.name)) for v in image.layers]
    return replace(image, layers=Layers(layers), timeline=line)


def _disc(n: Numbers, line: Timeline, modes: int = 2, reach: int = 24) -> Picture:
    """Picture of a disc that moves on a back layer."""
    mesh = grid_mesh((2, 1), 5, 4)
    image = on_back(n, disc(n, mesh))
    return moving(image, line, {"disc": track(n, mesh, line, modes, reach)})


def _at(*times: float) -> list[Args]:
    """Arguments of renders: the still, then some times, of which the first is enlarged."""
    return [WHOLE, {"time": times[0], **CLOSE}, *({"time": t} for t in times[1:])]


@_case("A layer that moves in a loop: within it, beyond its end and before its beginning",
       "MOT-2", "MOT-6", "MOT-7",
       renders=_at(0.37, 1.45, 7.000003, -0.83, 1.5))  # fmt: skip
def _moves_loop(n: Numbers) -> Picture:
    return _disc(n, LOOP)


@_case("A layer that moves once, made by a script, and stays as it is at both ends",
       "MOT-2", "MOT-6", "MOT-7", "MOT-10",
       renders=_at(0.61, -0.5, 1.501, 9.75))  # fmt: skip
def _moves_once(n: Numbers) -> Picture:
    return _disc(n, ONCE)


@_case("Layers on refined meshes with several shapes, around one that does not move",
       "MOT-1", "MOT-3", "MOT-4", "mesh: midpoints",
       renders=_at(0.21, 1.3))  # fmt: skip
def _moves_layers(n: Numbers) -> Picture:
    meshes = {
        "disc": grid_mesh((2, 1), 5, 4, split=[[3, 8, 9, 21], [1, 2]]),
        "still": grid_mesh((9, 1), 2, 2),
        "front": grid_mesh((11, 5), 3, 3, split=[[4]]),
    }
    shapes = polygon((11, 2), (16, 3), (13, 9)), polygon((21, 7), (18, 16), (12, 11))
    image = on_back(
        n,
        disc(n, meshes["disc"]),
        layer("still", (9, 1, 8, 9), texture(n), shapes[0], mesh=meshes["still"]),
        layer("front", (11, 6, 11, 11), texture(n), shapes[1], mesh=meshes["front"]),
    )
    tracks = {k: track(n, m, LOOP, 4, 12) for k, m in meshes.items() if k != "still"}
    return moving(image, LOOP, tracks)


@_case("A layer that was bent and turned moves: displacements add up before the affine map",
       "MOT-8", "pose: order", renders=_at(0.7, 1.1))  # fmt: skip
def _moves_posed(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    image = on_back(n, disc(n, mesh, nodes=bend(n, mesh), opacity=60000, **TURN))
    return moving(image, LOOP, {"disc": track(n, mesh, LOOP)})


for _unit, _modes, _reach in ((0, 1, 2), (6, 5, 70)):

    def _build(n: Numbers, unit: int = _unit, modes: int = _modes, reach: int = _reach) -> Picture:
        return _disc(n, replace(LOOP, unit=unit), modes, reach)

    _shapes = "One shape" if _modes == 1 else f"{_modes} shapes"
    CASES[f"moves-unit-{_unit}"] = Valid(
        f"{_shapes} in multiples of 1/{1 << _unit} pixel", ("MOT-2", "MOT-7"),
        _build, _at(0.37, 1.0),
    )  # fmt: skip

for _line in (replace(LOOP, intervals=1), replace(LOOP, intervals=2), replace(ONCE, intervals=1)):

    def _short(n: Numbers, line: Timeline = _line) -> Picture:
        return _disc(n, line)

    _name = f"moves-{'loop' if _line.loop else 'once'}-{_line.intervals}"
    CASES[_name] = Valid(
        f"A timeline {'in a loop' if _line.loop else 'without loop'} with few intervals: "
        f"{_line.coefficients} coefficients", ("MOT-2", "MOT-7"),
        _short, [WHOLE, {"time": 0.4}, {"time": 1.2}],
    )  # fmt: skip


@_case("A back layer without boundary moves: its outline is the bent canvas",
       "MOT-8", "outline: the whole canvas", renders=[WHOLE, {"time": 0.4}])  # fmt: skip
def _moves_canvas(n: Numbers) -> Picture:
    mesh = grid_mesh((-1, -1), 2, 2, step=(832, 640))
    image = on_back(n, disc(n))
    layers = Layers([replace(image.layers[0], mesh=mesh), image.layers[1]])
    image = replace(image, opaque=False, layers=layers)
    return moving(image, LOOP, {"back": track(n, mesh, LOOP, 1, 60)})


@_case("A node is flung so far that its displacement is clamped", "MOT-5", "MOT-7",
       renders=_at(0.4))  # fmt: skip
def _moves_far(n: Numbers) -> Picture:
    mesh = grid_mesh((2, 1), 5, 4)
    nodes = mesh.refined.nodes
    shapes = np.zeros((2, *nodes.shape), np.int64)
    # Without clamping, this node in the middle would go straight down.
    shapes[:, np.flatnonzero((nodes == [10 << 10, 9 << 10]).all(1))[0]] = [
        [(1 << 20) - 1, (1 << 20) - 1],
        [0, (1 << 20) - 1],
    ]
    line = replace(LOOP, unit=0)
    curves = np.full((2, line.coefficients), 300)
    curves[1] = (1 << 15) - 1
    image = on_back(n, disc(n, mesh))
    return moving(image, line, {"disc": Track(curves, shapes)})


@_case("A layer of which no node is displaced is bent all the same: what is mixed with it does "
       "not show", "MOT-8", "pyramid: cuts", renders=[WHOLE, {"time": 0.5}])  # fmt: skip
def _moves_nowhere(n: Numbers) -> Picture:
    box, mesh = (4, 3, 16, 12), grid_mesh((2, 1), 5, 4)
    source, ring = coded(n, SIZE, levels=3), Boundary(4, (RING,))
    shapes = None, ring
    back = view(source, cuts=Occlusion.of([1], 0, shapes, (0, 0, *SIZE)))
    front = view(source, part=box, cuts=Occlusion.of([1], 1, shapes, box))
    image = picture(
        SIZE,
        [
            Layer("back", (0, 0, *SIZE), None, back),
            Layer("disc", box, ring, front, mesh, 0, Pose()),
        ],
    )
    return moving(image, LOOP, {"disc": track(n, mesh, LOOP, 1, 0)})


def _bodies(n: Numbers, numbers: tuple[int, int]) -> Picture:
    """Picture of a bar on a disc on a back layer, which cut each other; disc and bar move alike."""
    meshes = grid_mesh((4, 2), 7, 7), grid_mesh((9, 6), 8, 4)
    image = pieces(n, {})
    layers = [
        image.layers[0],
        *(replace(v, mesh=m) for v, m in zip(image.layers[1:], meshes, strict=True)),
    ]
    curves = n.integers(128, 256, (1, LOOP.coefficients))
    tracks = {
        v.name: Track(curves, np.tile([-40, 23], (1, len(m.refined.nodes), 1)), body)
        for v, m, body in zip(image.layers[1:], meshes, numbers, strict=True)
    }
    return moving(replace(image, layers=Layers(layers)), LOOP, tracks)


_APART = [WHOLE, *({"time": 0.5, "layers": [v]} for v in ("disc", "bar")), {"time": 0.5}]


@_case("Two layers move as one body: what they are mixed with of each other shows, but not of the "
       "back layer", "MOT-9", "pyramid: cuts", renders=_APART)  # fmt: skip
def _moves_together(n: Numbers) -> Picture:
    return _bodies(n, (7, 7))


@_case("Two layers move alike, but as two bodies: what they are mixed with does not show",
       "MOT-9", "pyramid: cuts", renders=_APART)  # fmt: skip
def _moves_apart(n: Numbers) -> Picture:
    return _bodies(n, (7, 0))
