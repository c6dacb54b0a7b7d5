"""Valid cases of node sampling: features from the nodes of a mesh and from the boundary."""

from __future__ import annotations

from typing import Any

from proxyimg_codec.geometry.pose import Pose
from proxyimg_codec.model import Picture

from .bent import CLOSE, TURN
from .builders import (
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
from .registry import WHOLE, Valid, Valids

CASES = Valids()

BOTH, LOCAL, GLOBAL = 1, 2, 3

PATHS = ellipse((12, 9), (7, 5.5)), polygon((12, 7), (10, 12), (15, 10.5))


def _sampled(n: Numbers, sampling: int, bent: bool, features: int = 3, **pose: Any) -> Picture:
    """A ring with a mesh on a back layer, which is sampled in the same way."""
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


def _case(name: str, title: str, sampling: int, bent: bool, **pose: Any) -> None:
    def build(n: Numbers) -> Picture:
        return _sampled(n, sampling, bent, **pose)

    CASES[name] = Valid(title, ("sampling: node",), build, [WHOLE, CLOSE])


_case("node", "Node sampling: local and global features", BOTH, False)
_case("node-local", "Node sampling with local features alone", LOCAL, False)
_case("node-global", "Node sampling with global features alone, without a mesh", GLOBAL, False)
_case("node-bent", "The same, bent and turned, with texture displacements", BOTH, True, **TURN)
_case("node-local-turned", "Local features of a turned layer", LOCAL, False, **TURN)
_case("node-global-bent", "Global features of a bent layer", GLOBAL, True)


def _few(n: Numbers) -> Picture:
    return _sampled(n, BOTH, False, features=1)


CASES["node-few"] = Valid(
    "Node sampling with one feature, local and global", ("sampling: node",), _few, [CLOSE]
)


def _shared(n: Numbers) -> Picture:
    image = _sampled(n, GLOBAL, False)
    shape = polygon((1, 1), (9, 2), (4, 8))
    copy = layer("copy", (0, 0, 9, 9), image.layers[1].texture, shape)
    return picture(SIZE, [*image.layers, copy], *image.networks)


CASES["node-shared"] = Valid(
    "A texture that is sampled directly by one layer and globally by another",
    ("sampling: node", "texture: shared"), _shared, [WHOLE],
)  # fmt: skip
