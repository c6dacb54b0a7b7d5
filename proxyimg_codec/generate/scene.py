"""One layer among its surroundings, as a function of its colours that torch can differentiate.

The renderer draws the picture twice, with the layer all black and all white. The difference is the
share of each pixel that the layer has, through coverage, opacity, alpha and what lies in front.
So a pixel is the black one plus this share times the layer's colour at the texture point there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..errors import UsageError
from ..geometry.pose import COLOUR_BITS
from ..geometry.warp import Warp
from ..limits import Budget
from ..model import Layer, Layers, Picture
from ..render.neighbours import present_outline
from ..render.pixels import render
from ..render.view import View, make_view
from ..texture.network import Floats

Reals = NDArray[np.float64]

MARGIN = 0.25
"""Width of the surroundings on each side of the layer, as a share of its longer side."""

VISIBLE = 1 / 255
"""Least share of a pixel that counts."""

LEAST = 64.0
"""Fewest visible pixels of a layer that can get a texture."""

BACKDROP = 0.5
"""Grey behind pictures that are clear somewhere."""

STRIP = 1 << 20
"""Samples whose texture points are found at a time."""

ONE = 1 << COLOUR_BITS
BLACK, WHITE = (0,) * 12, (0, 0, 0, ONE) * 3
"""Colour matrices that make everything black or white."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A layer among its surroundings.

    Attributes:
        black: float32 [3, h, w] the scene with the layer black, in 0..1.
        share: float32 [h, w] share of each pixel that the layer has, 0..1.
        index: int64 [n] numbers, row by row, of the pixels where the layer shows.
        x: float64 [n] x of the texture points that they show, in canvas pixels at rest.
        y: float64 [n] y of these points.
        box: x0, y0, x1, y1 of the layer, in pixels of the scene.
        region: Part of the canvas that the scene shows: x, y, width, height.
        matrix: float32 [3, 4] colour matrix of the layer's pose; None for none.
    """

    black: Tensor
    share: Tensor
    index: Tensor
    x: Reals
    y: Reals
    box: tuple[int, int, int, int]
    region: tuple[int, int, int, int]
    matrix: Tensor | None

    def image(self, colours: Tensor) -> Tensor:
        """Scene [3, h, w] with colours [n, 3] of the layer, in 0..1."""
        if self.matrix is not None:
            matrix = self.matrix.to(colours)
            colours = (colours @ matrix[:, :3].T + matrix[:, 3]).clamp(0, 1)
        black = self.black.to(colours)
        part = self.share.to(colours).reshape(-1).index_select(0, self.index)
        layer = torch.zeros_like(black).reshape(3, -1)
        layer = layer.index_copy(1, self.index, (part[:, None] * colours).T)
        return black + layer.view_as(black)

    def to(self, device: torch.device) -> Scene:
        """Same scene with its tensors on a device."""
        moved = {k: getattr(self, k).to(device) for k in ("black", "share", "index")}
        matrix = None if self.matrix is None else self.matrix.to(device)
        return replace(self, **moved, matrix=matrix)


def scene_of(picture: Picture, layer: Layer, most: int) -> Scene:
    """Makes the scene of a layer.

    Args:
        picture: The picture.
        layer: A layer of it.
        most: Most pixels of the scene along its longer side.

    Raises:
        UsageError: The layer is hidden, or shows hardly anywhere.
        LimitError: Drawing it takes too much work.
    """
    if layer.pose.hidden:
        raise UsageError(f"generate: layer {layer.name!r} is hidden; show it first")
    region = _region(picture, layer)
    scale = min(1.0, most / max(region[2:]))
    view = make_view(picture.size, scale=scale, region=region)
    black, white = (_drawn(picture, layer, view, colour) for colour in (BLACK, WHITE))
    share = np.clip((white - black).mean(2), 0, 1)
    share[share < VISIBLE] = 0
    seen = float(share.sum()) / (view.width * view.height) * region[2] * region[3]
    if seen < LEAST:
        raise UsageError(
            f"generate: layer {layer.name!r} shows in {seen:.0f} pixels only; a texture needs "
            f"{LEAST:.0f}"
        )
    index = np.flatnonzero(share)
    rows, columns = np.nonzero(share)
    x, y = _points(layer, view)
    matrix = None
    if layer.pose.colour:
        matrix = torch.tensor(layer.pose.colour, dtype=torch.float32).reshape(3, 4) / ONE
    return Scene(
        torch.from_numpy(np.ascontiguousarray(black.transpose(2, 0, 1))), torch.from_numpy(share),
        torch.from_numpy(index), x.ravel()[index], y.ravel()[index],
        (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1),
        region, matrix,
    )  # fmt: skip


def _region(picture: Picture, layer: Layer) -> tuple[int, int, int, int]:
    """Part x, y, width, height of the canvas with the layer and what surrounds it.

    Raises:
        UsageError: The layer lies outside of the canvas.
    """
    width, height = picture.size
    outline = present_outline(picture, layer)
    x0, y0, x1, y1 = (0, 0, width, height) if outline is None else outline.bounds()
    x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    if x0 >= x1 or y0 >= y1:
        raise UsageError(f"generate: layer {layer.name!r} lies outside of the canvas")
    margin = round(MARGIN * max(x1 - x0, y1 - y0))
    x0, y0 = max(x0 - margin, 0), max(y0 - margin, 0)
    x1, y1 = min(x1 + margin, width), min(y1 + margin, height)
    return x0, y0, x1 - x0, y1 - y0


def _drawn(picture: Picture, layer: Layer, view: View, colour: Sequence[int]) -> Floats:
    """Scene [h, w, 3] in which the layer has one colour, before grey where it is clear."""
    painted = replace(layer, pose=replace(layer.pose, colour=tuple(colour)))
    layers = Layers(painted if v is layer else v for v in picture.layers)
    region = (view.x, view.y, view.region_width, view.region_height)
    found = render(
        replace(picture, layers=layers), width=view.width, height=view.height, region=region,
        dtype=np.float32,
    )  # fmt: skip
    alpha = found[..., 3:] if found.shape[2] == 4 else np.float32(1)
    mixed: Floats = found[..., :3] * alpha + np.float32(BACKDROP) * (1 - alpha)
    return mixed.astype(np.float32)


def _points(layer: Layer, view: View) -> tuple[Reals, Reals]:
    """Texture points x, y, float64 [h, w] each, of all pixels: means over their samples."""
    sx, sy = view.supersampling
    warp = Warp(layer.pose, layer.mesh, False, Budget())
    columns = view.width * sx
    across = view.columns(0, columns)
    found: list[Any] = []
    strip = max(STRIP // (columns * sy), 1)
    for row in range(0, view.height, strip):
        h = min(strip, view.height - row)
        down = view.rows(row * sy, (row + h) * sy)
        x, y = (v.ravel() for v in np.meshgrid(across, down))
        face = None
        if warp.meshed:
            face = warp.faces(*view.grid, (0, row * sy, columns, h * sy)).ravel()
        shown = warp.locate(x, y, face)
        found.append([v.reshape(h, sy, view.width, sx).mean((1, 3)) for v in (shown.x, shown.y)])
    return np.concatenate([v[0] for v in found]), np.concatenate([v[1] for v in found])
