"""Valid cases of every `sampling` with every option: poses, masks, alpha, holes, motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture

from ..builders import (
    SIZE,
    Numbers,
    bend,
    ellipse,
    grid_mesh,
    layer,
    network,
    picture,
    polygon,
    texture,
)  # fmt: skip
from ..registry import WHOLE, Args, Build, Valid, Valids
from .meshes import CLOSE, TURN
from .motion import LOOP, moving
from .motion import track as random_track

CASES = Valids()

DIRECT, BOTH, LOCAL, GLOBAL = range(4)

PATHS = ellipse((12, 9), (7, 5.5)), polygon((12, 7), (10, 12), (15, 10.5))
NAMES = {DIRECT: "direct", BOTH: "node", LOCAL: "node-local", GLOBAL: "node-global"}
TITLES = {
    DIRECT: "Direct sampling",
    BOTH: "Local and global features",
    LOCAL: "Local features",
    GLOBAL: "Global features",
}
MIX = (4096, -900, 300, 200, 0, 3000, 1000, 0, 500, 0, 4096, -200)


def _sampled(
    n: Numbers, sampling: int, *, mesh: bool, masked: bool = False, **pose: Any
) -> tuple[Picture, dict[str, Any]]:
    """Picture of a ring on a back layer with the same sampling; and the mesh of the ring."""
    dim = 6 if sampling == BOTH else 4
    features = dim // 2 if sampling == BOTH else dim
    grid = grid_mesh((2, 1), 5, 4, split=[[3, 8, 9, 21]]) if mesh or sampling in (1, 2) else None
    back = grid_mesh((-1, -1), 2, 2, step=(832, 640)) if sampling in (1, 2) else None
    stored = n.integers(0, 2, (2, 8, 9)) == 0 if masked else (None, None)
    planes = [texture(n, dim=features, grid=(9, 8), stored=s, reach=1) for s in stored]
    if mesh and grid is not None:
        pose |= {k: bend(n, grid) for k in ("nodes", "places")}
    layers = [
        layer("back", (0, 0, *SIZE), planes[0], mesh=back, sampling=sampling),
        layer("ring", (4, 3, 16, 12), planes[1], *PATHS, mesh=grid, pose=Pose(**pose),
              sampling=sampling),
    ]  # fmt: skip
    net = network(n, dim=dim, channels=4 if masked else 3, contrast=1.5 if masked else 0.6)
    return picture(SIZE, layers, net, opaque=not masked), {"ring": grid}


def _case(sampling: int, option: str, tests: Sequence[str], build: Build, *more: Args) -> None:
    """Registers a case of a sampling with an option."""
    topics = () if sampling == DIRECT else ("sampling: node",)
    titles = {
        "turned": "turned",
        "bent": "bent and turned, with texture displacements",
        "masked": "codes that are not stored, alpha, a hole, a colour matrix and opacity",
        "moves": "in motion",
    }
    name = f"moves-{NAMES[sampling]}" if option == "moves" else f"{NAMES[sampling]}-{option}"
    CASES[name] = Valid(
        f"{TITLES[sampling]}: {titles[option]}", (*topics, *tests), build, [WHOLE, *more]
    )


def _turned(sampling: int) -> Build:
    return lambda n: _sampled(n, sampling, mesh=False, **TURN)[0]


def _bent(sampling: int) -> Build:
    return lambda n: _sampled(n, sampling, mesh=True, **TURN)[0]


def _masked(sampling: int) -> Build:
    return lambda n: _sampled(n, sampling, mesh=False, masked=True, colour=MIX, opacity=50001)[0]


def _moving(sampling: int) -> Build:
    def build(n: Numbers) -> Picture:
        image, meshes = _sampled(n, sampling, mesh=True)
        still = [replace(v, pose=Pose()) for v in image.layers]
        image = replace(image, layers=type(image.layers)(still))
        tracks = {k: random_track(n, mesh, LOOP) for k, mesh in meshes.items()}
        return moving(image, LOOP, tracks)

    return build


for _sampling in (BOTH, GLOBAL):
    _case(_sampling, "turned", ["pose: affine"], _turned(_sampling), CLOSE)
_case(LOCAL, "bent", ["pose: displacements", "pose: texture displacements"], _bent(LOCAL), CLOSE)
for _sampling in NAMES:
    _case(_sampling, "masked",
          ["texture: mask", "texture: diffusion", "alpha", "coverage: hole", "pose: colour matrix",
           "pose: opacity"], _masked(_sampling))  # fmt: skip
for _sampling in (BOTH, LOCAL, GLOBAL):
    _case(_sampling, "moves", ["MOT-8"], _moving(_sampling), {"time": 0.4})


def _plain(n: Numbers, sampling: int, bent: bool, features: int = 3, **pose: Any) -> Picture:
    """Picture of a ring with a mesh on a back layer with the same sampling."""
    dim = 2 * features if sampling == BOTH else features
    mesh = None
    back = grid_mesh((-1, -1), 2, 2, step=(832, 640))
    if sampling != GLOBAL or bent:
        mesh = grid_mesh((2, 1), 5, 4, split=[[3, 8, 9, 21]])
    if bent and mesh is not None:
        pose |= {"nodes": bend(n, mesh), "places": bend(n, mesh, 20)}
    planes = [texture(n, dim=features, grid=(9, 8), network=1, reach=1) for _ in range(2)]
    layers = [
        layer("back", (0, 0, *SIZE), planes[0], mesh=back, sampling=sampling),
        layer("ring", (4, 3, 16, 12), planes[1], *PATHS, mesh=mesh, pose=Pose(**pose),
              sampling=sampling),
    ]  # fmt: skip
    return picture(SIZE, layers, network(n), network(n, dim=dim))


def _node(name: str, title: str, sampling: int, bent: bool, **pose: Any) -> None:
    """Registers a case of node sampling."""

    def build(n: Numbers) -> Picture:
        return _plain(n, sampling, bent, **pose)

    CASES[name] = Valid(title, ("sampling: node",), build, [WHOLE, CLOSE])


_node("node", "Node sampling: local and global features", BOTH, False)
_node("node-local", "Node sampling with local features alone", LOCAL, False)
_node("node-global", "Node sampling with global features alone, without a mesh", GLOBAL, False)
_node("node-bent", "The same, bent and turned, with texture displacements", BOTH, True, **TURN)
_node("node-local-turned", "Local features of a turned layer", LOCAL, False, **TURN)
_node("node-global-bent", "Global features of a bent layer", GLOBAL, True)


def _few(n: Numbers) -> Picture:
    return _plain(n, BOTH, False, features=1)


CASES["node-few"] = Valid(
    "Node sampling with one feature, local and global", ("sampling: node",), _few, [CLOSE]
)


def _shared(n: Numbers) -> Picture:
    image = _plain(n, GLOBAL, False)
    shape = polygon((1, 1), (9, 2), (4, 8))
    copy = layer("copy", (0, 0, 9, 9), image.layers[1].texture, shape)
    return picture(SIZE, [*image.layers, copy], *image.networks)


CASES["node-shared"] = Valid(
    "A texture that is sampled directly by one layer and globally by another",
    ("sampling: node", "texture: shared"), _shared, [WHOLE],
)  # fmt: skip
