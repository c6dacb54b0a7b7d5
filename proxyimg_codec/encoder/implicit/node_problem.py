"""Fitting problem of node sampling, the paper's method: features from nodes and boundary.

The sizes are those of ProxyImg: one code of 16 features per cell of 8 x 8 px, 8 x 8 codes for the
back layer, 10 octaves, and four hidden layers of width 64.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UsageError
from ...geometry.mesh import FRACTION_BITS, Mesh
from ...geometry.pose import REST
from ...geometry.warp import Warp
from ...texture import node_sampling
from ...texture.implicit import taps
from ...texture.network import Floats, NetShape
from ..settings import NODE_SPACING, Settings
from ..shapes.layers import LayerPlan
from .fit_problem import Plane, Prior, Problem

DIM, OCTAVES, HIDDEN, DEPTH = 16, 10, 64, 4
"""Features per code, octaves of the encoding, width and number of hidden layers (ProxyImg)."""

BACK_GRID = 8
"""Codes across and down a back layer, if it is not the only layer (ProxyImg)."""


@dataclass(frozen=True)
class NodeOptions:
    """Variants of node sampling.

    Attributes:
        edge: Whether the global feature is used.
        local: Local feature: ``multi`` from the refined triangles, ``single`` from those of
            hierarchy 1, or ``none``.
        octaves: Octaves of the encoding.
        cell: Distance of codes in canvas pixels.
        back_grid: Codes across and down a back layer, if it is not the only layer.
        distance: Whether the nodes of a triangle are weighted by inverse squared distance instead
            of barycentrically; an experiment that no file can store.
        own_codes: Whether each node has a code of its own instead of a sample of the plane; an
            experiment that no file can store.
        dim: Features of a code.
        hidden: Width of the hidden layers of the network.
        depth: Number of hidden layers.

    Raises:
        UsageError: There is neither a local nor a global feature, or `local` is unknown.
    """

    edge: bool = True
    local: str = "multi"
    octaves: int = OCTAVES
    cell: float = NODE_SPACING
    back_grid: int = BACK_GRID
    distance: bool = False
    own_codes: bool = False
    dim: int = DIM
    hidden: int = HIDDEN
    depth: int = DEPTH

    def __post_init__(self) -> None:
        if self.local not in ("multi", "single", "none") or not (self.edge or self.meshed):
            raise UsageError("node sampling needs local multi or single, or edge, or both")

    @property
    def meshed(self) -> bool:
        """Whether the local feature is used."""
        return self.local != "none"

    def network(self, channels: int) -> NetShape:
        """Sizes of the decoder network, with 3 or 4 output channels."""
        features = self.dim * (self.edge + self.meshed)
        return NetShape(features, self.octaves, self.hidden, self.depth, channels)

    def grid(self, plane: Plane, back: bool) -> tuple[int, int]:
        """Columns and rows of a plane; `back` if its layer is the back one of several."""
        if back:
            return self.back_grid, self.back_grid
        columns, rows = (max(round(n / self.cell), 2) for n in plane.box[2:])
        return columns, rows


@dataclass(frozen=True, eq=False)
class NodeProblem(Problem):
    """Fitting problem of node sampling.

    Its entries share P points at which the planes are sampled: the nodes and anchors of all layers.
    `base`, `stride`, `fx` and `fy` are [P], and belong to these points instead of entries.

    Attributes:
        own: Number of table rows after those of the planes, for nodes with codes of their own.
        layer: int32 [entries] layer of each entry.
        place: float32 [entries, 2] canvas position of the pixel centre.
        corners: int32 [entries, 3] points at the corners of the triangle; [entries, 0] without
            local feature.
        weights: float32 [entries, 3] weights of the corners; [entries, 0] without local feature.
        anchors: For each layer the number of its first anchor among the points, and float32 [S, 2]
            its anchors in canvas pixels; () without global feature.
    """

    own: int
    layer: NDArray[np.int32]
    place: Floats
    corners: NDArray[np.int32]
    weights: Floats
    anchors: tuple[tuple[int, Floats], ...]

    @property
    def sampling(self) -> int:
        """Sampling mode of the layers, as in LAYR."""
        if not self.corners.shape[1]:
            return node_sampling.GLOBAL
        return node_sampling.BOTH if self.anchors else node_sampling.LOCAL

    @property
    def codes(self) -> int:
        """Number of rows of the table of codes."""
        return super().codes + self.own


def options_for(settings: Settings) -> NodeOptions:
    """Options that settings ask for: the paper's at quality 50, other spacings at others."""
    back = max(round(BACK_GRID * NODE_SPACING / settings.spacing), 2)
    return NodeOptions(cell=settings.spacing, back_grid=back)


class _Points:
    """Points at which planes are sampled, collected layer by layer.

    Attributes:
        count: Number of points so far.
    """

    def __init__(self) -> None:
        self.count = 0
        self._parts: list[tuple[int, NDArray[np.float64]]] = []

    def add(self, layer: int, points: NDArray[np.float64]) -> int:
        """Appends points float64 [n, 2] of a layer; returns the number of the first."""
        self._parts.append((layer, points))
        self.count += len(points)
        return self.count - len(points)

    def taps(self, planes: Sequence[Plane]) -> list[NDArray[Any]]:
        """Arrays base, stride, fx and fy [count] of all points, as in `Problem`."""
        parts = []
        for k, points in self._parts:
            plane = planes[k]
            t = taps(points[:, 0], points[:, 1], plane.box, plane.columns, plane.rows)
            stride = np.full(len(points), t.stride, np.int32)
            parts.append((t.base + np.int32(plane.start), stride, t.fx, t.fy))
        return [np.concatenate(p) for p in zip(*parts, strict=True)]


def build(
    problem: Problem, layers: Sequence[LayerPlan], size: tuple[int, int], options: NodeOptions
) -> NodeProblem:
    """Makes the problem of node sampling.

    Args:
        problem: Problem of direct sampling of the same layers, with any network and spacing.
        layers: Layers, back to front; they need meshes if there is a local feature.
        size: Width and height of the canvas in pixels.
        options: Variant of the method.
    """
    layer, place = _entries(problem)
    planes: list[Plane] = []
    points = _Points()
    corners = np.zeros((len(layer), 3 * options.meshed), np.int32)
    weights = np.zeros(corners.shape, np.float32)
    for k, (old, planned) in enumerate(zip(problem.planes, layers, strict=True)):
        start = planes[-1].start + planes[-1].size if planes else 0
        back = planned.boundary is None and len(layers) > 1
        planes.append(Plane(old.box, *options.grid(old, back), start))
        at = np.flatnonzero(layer == k)
        if options.meshed and len(at):
            assert planned.mesh is not None, "the local feature needs a mesh"
            mesh = planned.mesh if options.local == "multi" else planned.mesh.split([])
            nodes, weights[at] = _locate(mesh, old, place[at], options.distance)
            used, index = np.unique(nodes, return_inverse=True)
            first = points.add(k, mesh.refined.nodes[used] / (1 << FRACTION_BITS))
            corners[at] = first + index.reshape(-1, 3)
    nodes_end = points.count
    anchors = []
    if options.edge:
        for k, planned in enumerate(layers):
            ends = node_sampling.anchors(planned.boundary, size)
            anchors.append((points.add(k, ends), ends.astype(np.float32)))
    base, stride, fx, fy = points.taps(planes)
    own = 0
    if options.own_codes:
        own = nodes_end + 1  # one more, because taps read the next row too, with weight 0
        base[:nodes_end] = planes[-1].start + planes[-1].size + np.arange(nodes_end)
        stride[:nodes_end] = fx[:nodes_end] = fy[:nodes_end] = 0
    values = {f.name: getattr(problem, f.name) for f in fields(Problem)} | {
        "shape": options.network(problem.shape.channels), "planes": tuple(planes),
        "base": base, "stride": stride, "fx": fx, "fy": fy,
        "prior": Prior(np.zeros(0, np.int32), np.zeros((0, 4), np.int32), np.zeros(0, np.float32)),
    }  # fmt: skip
    return NodeProblem(
        **values, own=own, layer=layer, place=place.astype(np.float32), corners=corners,
        weights=weights, anchors=tuple(anchors),
    )  # fmt: skip


def _entries(problem: Problem) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Layer int32 [entries] and pixel centre float64 [entries, 2] of entries of direct sampling."""
    layer = np.searchsorted([p.start for p in problem.planes], problem.base, side="right") - 1
    place = np.zeros((len(layer), 2))
    for k, plane in enumerate(problem.planes):
        at = np.flatnonzero(layer == k)
        iy, ix = np.divmod(problem.base[at] - plane.start, plane.columns)
        x0, y0, width, height = plane.box
        place[at, 0] = x0 + (ix + problem.fx[at]) * (width / (plane.columns - 1))
        place[at, 1] = y0 + (iy + problem.fy[at]) * (height / (plane.rows - 1))
    return layer.astype(np.int32), np.floor(place) + 0.5


def _locate(
    mesh: Mesh, plane: Plane, place: NDArray[np.float64], distance: bool
) -> tuple[NDArray[np.int32], Floats]:
    """Finds the triangles of pixel centres.

    Args:
        mesh: Mesh of the layer.
        plane: Plane of the layer, whose box the pixels lie in.
        place: float64 [n, 2] pixel centres.
        distance: Whether to weight by inverse squared distance instead of barycentrically.

    Returns:
        int32 [n, 3] nodes of the triangle of each, and float32 [n, 3] their weights.
    """
    warp = Warp(REST, mesh, meshed=True)
    faces = warp.faces(np.zeros(2), np.ones(2), plane.box)
    column, row = (np.floor(place) - plane.box[:2]).astype(np.int64).T
    located = warp.locate(place[:, 0], place[:, 1], faces[row, column])
    assert located.face is not None, "a meshed warp locates it"
    assert located.weights is not None, "a meshed warp locates it"
    nodes = mesh.refined.faces[located.face]
    weights = located.weights
    if distance:
        away = mesh.refined.nodes[nodes] / (1 << FRACTION_BITS) - place[:, None]
        weights = 1 / np.maximum((away**2).sum(2), node_sampling.NEAR)
        weights /= weights.sum(1, keepdims=True)
    return nodes, weights.astype(np.float32)
