"""Valid cases of every `sampling` with every option: poses, masks, alpha, holes, motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture

from .bent import CLOSE, TURN
from .builders import (
    SIZE,
    Numbers,
    bend,
    grid_mesh,
    layer,
    network,
    picture,
    texture,
)  # fmt: skip
from .moving import LOOP, moving
from .moving import track as random_track
from .nodes import BOTH, GLOBAL, LOCAL, PATHS
from .registry import WHOLE, Args, Build, Valid, Valids

CASES = Valids()

DIRECT = 0
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
    """A ring on a back layer that are sampled in the same way; and the mesh of the ring."""
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
