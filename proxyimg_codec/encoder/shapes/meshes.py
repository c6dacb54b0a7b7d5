"""Meshes of the layers that are encoded: a base, refined where the picture has detail."""

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
"""Number of hierarchies of objects and of the back, base included (ProxyImg, h_f and h_b)."""

Mesher = Callable[[Boundary | None, tuple[int, int], float], Base]


def with_meshes(picture: Floats, plan: Plan, settings: Settings) -> Plan:
    """Makes a mesh for each layer of a plan, if the settings ask for meshes.

    A back layer that is the only layer gets a mesh for node sampling only, as fine as that of an
    object.

    Args:
        picture: float32 [H, W, 4] premultiplied picture in 0..1.
        plan: Plan of the layers.
        settings: Settings of the encoder.

    Returns:
        The plan with meshes; `plan` itself if there are none.

    Raises:
        UsageError: There is no such mesher.
        UnsupportedError: The mesher is not installed.
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
    """Corners [4 n, 3, 2] of the children of triangles [n, 3, 2], in the order of `refine`."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = np.stack([a, d, f, d, b, e, f, e, c, d, e, f], axis=1)
    return four.reshape(-1, 3, 2)


def gradient(picture: Floats) -> Floats:
    """Magnitude float32 [H, W] of the Sobel gradient of the mean of red, green and blue."""
    grey = np.ascontiguousarray(picture[..., :3].mean(2))
    dx, dy = (cv2.Sobel(grey, cv2.CV_32F, *d) for d in ((1, 0), (0, 1)))
    return np.asarray(np.hypot(dx, dy), np.float32)


def refined(mesh: Mesh, detail: Floats, hierarchies: int) -> Mesh:
    """Splits triangles into four where the mean of `detail` inside exceeds that of the picture.

    Triangles of at most one pixel stay whole (ProxyImg, refinement).

    Args:
        mesh: Mesh without split flags.
        detail: float32 [H, W] gradient magnitude of the picture.
        hierarchies: Most hierarchies, base included.
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
