"""Proxy nodes of the layers that are encoded: a base mesh, refined where the picture has detail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ... import plugins
from ...geometry.boundary import Boundary
from ...geometry.mesh import FRACTION_BITS, Base, Mesh
from ...geometry.mesher import EDGE_BACK, EDGE_FRONT
from ...geometry.raster import rasterize
from ...texture.network import Floats
from ..settings import Settings
from .layers import Plan

HIERARCHIES_FRONT, HIERARCHIES_BACK = 3, 2
"""Hierarchies, the base included (ProxyImg, h_f and h_b)."""

Mesher = Callable[[Boundary | None, tuple[int, int], float], Base]


def with_meshes(picture: Floats, plan: Plan, settings: Settings) -> Plan:
    """`plan` with a mesh for each layer, as `settings.mesh` asks for.

    A lone back layer has one only if its features come from it, and is then no background.

    Args:
        picture: float32 [H, W, 4], premultiplied.
        plan: Layers back to front.
        settings: ``mesher`` is the name of a mesher, or ``none``.

    Raises:
        UsageError: There is no such mesher.
        InputError: An external mesher failed.
    """
    lone = len(plan.layers) == 1 and plan.layers[0].boundary is None
    if settings.mesher == "none" or (lone and settings.sampling == "direct"):
        return plan
    mesher: Mesher = plugins.find("meshers", settings.mesher)
    detail = gradient(picture)
    size = (picture.shape[1], picture.shape[0])
    layers = []
    for layer in plan.layers:
        back = layer.boundary is None and not lone
        mesh = Mesh.build(mesher(layer.boundary, size, EDGE_BACK if back else EDGE_FRONT))
        mesh = refined(mesh, detail, HIERARCHIES_BACK if back else HIERARCHIES_FRONT)
        layers.append(replace(layer, mesh=mesh))
    return replace(plan, layers=tuple(layers))


def children(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners [4 n, 3, 2] of the four children of triangles [n, 3, 2], in the order of a mesh."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = np.stack([a, d, f, d, b, e, f, e, c, d, e, f], axis=1)
    return four.reshape(-1, 3, 2)


def gradient(picture: Floats) -> Floats:
    """Magnitude of the Sobel gradient [H, W] of the mean of the channels."""
    grey = np.ascontiguousarray(picture[..., :3].mean(2))
    dx, dy = (cv2.Sobel(grey, cv2.CV_32F, *d) for d in ((1, 0), (0, 1)))
    return np.asarray(np.hypot(dx, dy), np.float32)


def refined(mesh: Mesh, detail: Floats, hierarchies: int) -> Mesh:
    """The mesh with triangles split 1 to 4 where the mean gradient inside exceeds the picture's.

    Triangles that hold no more than one pixel stay whole (ProxyImg, refinement).
    """
    height, width = detail.shape
    threshold = float(detail.mean())
    nodes = mesh.base.positions / (1 << FRACTION_BITS)
    corners = nodes[mesh.base.triangles]
    flags: list[NDArray[np.bool_]] = []
    for _ in range(hierarchies - 1):
        owner = rasterize(corners, 0, 0, width, height).ravel()
        inside = owner >= 0
        pixels = np.bincount(owner[inside], minlength=len(corners))
        total = np.bincount(owner[inside], detail.ravel()[inside], len(corners))
        split = (pixels > 1) & (total > threshold * pixels)
        flags.append(split)
        corners = children(corners[split])
        if not len(corners):
            break
    return mesh.split(flags)
