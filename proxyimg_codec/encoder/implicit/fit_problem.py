"""Fitting problem of implicit textures: the codes, and their weights, that make each pixel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.boundary import Boundary
from ...texture.implicit import Box, taps
from ...texture.network import Floats, NetShape
from ...texture.node_sampling import DIRECT
from ..settings import LAYERS_MAX
from ..shapes.coverage import coverage_of

KNOWN = 0.25
"""Weight of its pixels, relative to that of all pixels in a cell, from which on a code needs no
prior."""

PRIOR = 100.0
"""Weight of the prior, times the number of pixels, of a code whose pixels have no weight."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Plane of the codes of a layer, as a part of the table of all codes.

    Attributes:
        box: Rectangle of the canvas that the plane is stretched over: x, y, width, height.
        columns: Columns of the plane.
        rows: Rows of the plane.
        start: Table row of the first code.
    """

    box: Box
    columns: int
    rows: int
    start: int

    @property
    def size(self) -> int:
        """Number of code positions."""
        return self.columns * self.rows


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of codes that pixels barely determine: they are near the mean of their neighbours.

    Attributes:
        rows: int32 [P] table rows of the codes.
        next: int32 [P, 4] table rows of their neighbours; the code itself instead of neighbours
            that do not exist or that no pixel depends on.
        weight: float32 [P] weight of the squared distance from the mean.
    """

    rows: NDArray[np.int32]
    next: NDArray[np.int32]
    weight: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """Fitting problem: pixels, their entries, and the colours that they should have.

    An entry stands for one layer that shows in a pixel. The entries of a pixel are ordered front to
    back.

    Attributes:
        shape: Sizes of the decoder network.
        planes: Plane of each layer, back to front.
        first: int32 [pixels + 1] first entry of each pixel, and the number of entries.
        base: int32 [entries] table row of the upper left code.
        stride: int32 [entries] number of table rows to the code below.
        fx: float32 [entries] horizontal fraction in 0..1.
        fy: float32 [entries] vertical fraction in 0..1.
        coverage: float32 [entries] coverage of the pixel by the layer, 0..1.
        learn: float32 [entries] factor of the gradient, 0..1. It is 0 where a layer shows through
            the rim of another: only the front layer learns from such a pixel, so that the mixed
            colour does not stain the one behind.
        target: float32 [pixels, channels] premultiplied colours in 0..1.
        prior: Prior of codes that pixels barely determine.
        areas: Number of visible pixels of each layer.
    """

    shape: NetShape
    planes: tuple[Plane, ...]
    first: NDArray[np.int32]
    base: NDArray[np.int32]
    stride: NDArray[np.int32]
    fx: Floats
    fy: Floats
    coverage: Floats
    learn: Floats
    target: Floats
    prior: Prior
    areas: tuple[int, ...]

    @property
    def sampling(self) -> int:
        """Sampling mode of the layers, as in LAYR."""
        return DIRECT

    @property
    def codes(self) -> int:
        """Number of rows of the table of codes."""
        return self.planes[-1].start + self.planes[-1].size

    @property
    def pixels(self) -> int:
        """Number of pixels to learn."""
        return len(self.target)

    def stored(self) -> list[NDArray[np.bool_]]:
        """For each layer bool [rows, columns], True at codes that a visible pixel depends on."""
        touched = np.zeros(self.codes, bool)
        for offset in (0, 1):
            touched[self.base + offset] = True
            touched[self.base + self.stride + offset] = True
        for p in self.planes:
            if not touched[p.start : p.start + p.size].any():
                touched[p.start] = True  # a layer that is wholly hidden keeps one code
        return [touched[p.start : p.start + p.size].reshape(p.rows, p.columns) for p in self.planes]


def plane_for(
    boundary: Boundary | None, width: int, height: int, spacing: float, start: int
) -> Plane:
    """Makes the plane of a layer, over the bounds of its boundary on the canvas.

    Args:
        boundary: Boundary at rest; None for the whole canvas.
        width: Width of the canvas in pixels.
        height: Height of the canvas in pixels.
        spacing: Distance of codes in canvas pixels.
        start: Table row of the first code.
    """
    x0, y0, x1, y1 = (0, 0, width, height) if boundary is None else boundary.bounds()
    x0, y0 = min(max(x0, 0), width - 1), min(max(y0, 0), height - 1)
    x1, y1 = max(min(x1, width), x0 + 1), max(min(y1, height), y0 + 1)
    columns, rows = (max(round((b - a) / spacing) + 1, 2) for a, b in ((x0, x1), (y0, y1)))
    return Plane((x0, y0, x1 - x0, y1 - y0), columns, rows, start)


def build(
    picture: Floats,
    boundaries: Sequence[Boundary | None],
    shape: NetShape,
    spacing: float,
) -> Problem:
    """Makes the problem of a flat picture, whose layers learn what shows of them.

    Args:
        picture: float32 [H, W, 4] premultiplied picture in 0..1.
        boundaries: Boundaries of the layers at rest, back to front; None for the whole canvas.
        shape: Sizes of the decoder network.
        spacing: Distance of codes in canvas pixels.
    """
    height, width = picture.shape[:2]
    planes = _planes(boundaries, width, height, spacing)
    clear = np.ones(height * width, np.float32)
    rim = np.zeros(height * width, bool)
    # Layers that show through a translucent one learn together with it.
    solid = picture[..., 3].ravel() == 1 if shape.channels == 4 else np.True_
    seen: list[NDArray[np.int64]] = []
    parts: list[Entries] = []
    areas = [0] * len(planes)
    for k in range(len(planes) - 1, -1, -1):
        share = coverage_of(boundaries[k], width, height)
        at = np.flatnonzero((share > 0) & (clear > 0))
        areas[k] = round(float((share[at] * clear[at]).sum(dtype=np.float64)))
        seen.append(at)
        learn = np.where(rim[at], 0, 1).astype(np.float32)
        parts.append(entries_of(planes[k], at, width, share[at], learn))
        hides = share * solid
        clear *= 1 - hides
        rim |= hides > 0
    pixel = np.concatenate(seen)
    order = np.argsort(pixel, kind="stable")
    ids, counts = np.unique(pixel, return_counts=True)
    assert counts.max() <= LAYERS_MAX, "the kernel composites at most LAYERS_MAX layers in a pixel"
    entries = tuple(np.concatenate(p)[order] for p in zip(*parts, strict=True))
    target = picture.reshape(-1, 4)[ids, : shape.channels].astype(np.float32)
    return _problem(shape, planes, spacing, counts, entries, target, areas)


def build_apart(
    picture_of: Callable[[int], Floats],
    boundaries: Sequence[Boundary | None],
    shape: NetShape,
    spacing: float,
    size: tuple[int, int],
) -> Problem:
    """Makes the problem of a layered picture, whose layers learn all of their own pixels.

    Args:
        picture_of: Makes the picture of a layer from its number: float32 [H, W, 4] in 0..1 with
            straight alpha, whose colours continue beyond the rim.
        boundaries: Boundaries of the layers at rest, back to front; None for the whole canvas.
        shape: Sizes of the decoder network; without a fourth channel, alpha is left to boundaries.
        spacing: Distance of codes in canvas pixels.
        size: Width and height of the canvas in pixels.
    """
    width, height = size
    planes = _planes(boundaries, width, height, spacing)
    parts: list[Entries] = []
    targets: list[Floats] = []
    areas: list[int] = []
    for k, plane in enumerate(planes):
        share = coverage_of(boundaries[k], width, height)
        areas.append(round(float(share.sum(dtype=np.float64))))
        at = np.flatnonzero(share > 0)
        target = picture_of(k).reshape(-1, 4)[at]
        if shape.channels == 4:
            # Coverage will multiply alpha once more.
            target[:, 3] = np.minimum(target[:, 3] / share[at], 1)
            target[:, :3] *= target[:, 3:]
        else:
            target[:, 3] = 1
        targets.append(target[:, : shape.channels])
        # The less a pixel is covered, the less its colour can be trusted.
        parts.append(entries_of(plane, at, width, np.ones_like(share[at]), share[at]))
    entries = tuple(np.concatenate(p) for p in zip(*parts, strict=True))
    target = np.concatenate(targets)
    return _problem(shape, planes, spacing, np.ones(len(target), np.int64), entries, target, areas)


Entries = tuple[NDArray[Any], ...]
"""Arrays base, stride, fx, fy, coverage and learn of some entries, as in `Problem`."""


def _planes(
    boundaries: Sequence[Boundary | None], width: int, height: int, spacing: float
) -> list[Plane]:
    planes: list[Plane] = []
    for boundary in boundaries:
        start = planes[-1].start + planes[-1].size if planes else 0
        planes.append(plane_for(boundary, width, height, spacing, start))
    return planes


def entries_of(
    plane: Plane, at: NDArray[Any], width: int, coverage: Floats, learn: Floats
) -> Entries:
    """Makes the entries of a layer.

    Args:
        plane: Plane of the layer.
        at: int [N] positions of the pixels, row by row.
        width: Width of the canvas in pixels.
        coverage: float32 [N] coverage of the pixels by the layer.
        learn: float32 [N] factors of the gradient.
    """
    t = taps(at % width + 0.5, at // width + 0.5, plane.box, plane.columns, plane.rows)
    stride = np.full(len(at), t.stride, np.int32)
    return t.base + np.int32(plane.start), stride, t.fx, t.fy, coverage, learn


def _problem(
    shape: NetShape,
    planes: Sequence[Plane],
    spacing: float,
    counts: NDArray[np.int64],
    entries: Entries,
    target: Floats,
    areas: Sequence[int],
) -> Problem:
    """Makes a problem of entries that are ordered by pixel; `counts` [pixels] has their numbers."""
    base, stride, fx, fy, coverage, learn = entries
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    prior = prior_of(planes, spacing, len(counts), base, stride, fx, fy, coverage * learn)
    return Problem(
        shape, tuple(planes), first, base, stride, fx, fy, coverage, learn,
        np.ascontiguousarray(target), prior, tuple(areas),
    )  # fmt: skip


def prior_of(
    planes: Sequence[Plane],
    spacing: float,
    pixels: int,
    base: NDArray[np.int32],
    stride: NDArray[np.int32],
    fx: Floats,
    fy: Floats,
    weight: Floats,
) -> Prior:
    """Makes the prior of all codes whose pixels have less than `KNOWN` of the weight of a cell.

    Args:
        planes: Plane of each layer.
        spacing: Distance of codes in canvas pixels.
        pixels: Number of pixels to learn.
        base: int32 [entries] table row of the upper left code.
        stride: int32 [entries] number of table rows to the code below.
        fx: float32 [entries] horizontal fraction.
        fy: float32 [entries] vertical fraction.
        weight: float32 [entries] weight of the entry: coverage times factor of the gradient.
    """
    total = planes[-1].start + planes[-1].size
    seen = np.zeros(total)
    touched = np.zeros(total, bool)
    corners: tuple[tuple[Any, Floats], ...] = (
        (0, (1 - fx) * (1 - fy)),
        (1, fx * (1 - fy)),
        (stride, (1 - fx) * fy),
        (stride + 1, fx * fy),
    )
    for offset, part in corners:
        seen += np.bincount(base + offset, part * weight, total)
        touched[base + offset] = True
    lack = 1 - seen / (KNOWN * spacing**2)
    rows = np.flatnonzero(touched & (lack > 0))
    neighbours = np.empty((len(rows), 4), np.int32)
    for plane in planes:
        at = (rows >= plane.start) & (rows < plane.start + plane.size)
        y, x = np.divmod(rows[at] - plane.start, plane.columns)
        for k, (dy, dx) in enumerate(((0, -1), (0, 1), (-1, 0), (1, 0))):
            ny = np.clip(y + dy, 0, plane.rows - 1)
            nx = np.clip(x + dx, 0, plane.columns - 1)
            there = plane.start + ny * plane.columns + nx
            neighbours[at, k] = np.where(touched[there], there, rows[at])
    return Prior(
        rows.astype(np.int32), neighbours, (PRIOR * lack[rows] / pixels).astype(np.float32)
    )
