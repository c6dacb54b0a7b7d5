"""The fitting problem: which codes, with which weights, make each visible pixel."""

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
"""A code is known if its pixels weigh at least this share of a whole cell."""

PRIOR = 100.0
"""Weight of the prior of a code that no pixel weighs on, times the number of pixels."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Where a layer's codes lie: its box, columns and rows, and its first row in the table."""

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
    """Codes that little is known of, which are drawn to the mean of their neighbours.

    Attributes:
        rows: int32 [P] rows of the table.
        next: int32 [P, 4] rows of the neighbours; the code itself at the rim of its plane.
        weight: float32 [P] weight of the squared distance.
    """

    rows: NDArray[np.int32]
    next: NDArray[np.int32]
    weight: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """Pixels, their entries (one per layer seen in the pixel, front to back), and targets.

    Attributes:
        shape: The network.
        planes: One a layer, back to front.
        first: int32 [pixels + 1] range of entries of each pixel.
        base: int32 [entries] table row of the upper left code.
        stride: int32 [entries] table rows to the code below.
        fx: float32 [entries] horizontal fraction.
        fy: float32 [entries] vertical fraction.
        coverage: float32 [entries] coverage of the layer, 0..1.
        learn: float32 [entries] 1, or 0 where a layer shows through the rim of another: there
            only the front layer learns, so that the one behind stays clean.
        target: float32 [pixels, channels], premultiplied.
        prior: Smoothness of codes that pixels barely determine.
        areas: Visible pixels of each layer.
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
        """How features are found, as in LAYR."""
        return DIRECT

    @property
    def codes(self) -> int:
        """Rows of the table of codes."""
        return self.planes[-1].start + self.planes[-1].size

    @property
    def pixels(self) -> int:
        """Number of pixels that any layer covers."""
        return len(self.target)

    def stored(self) -> list[NDArray[np.bool_]]:
        """For each layer bool [rows, columns]: the codes that a visible pixel touches."""
        touched = np.zeros(self.codes, bool)
        for offset in (0, 1):
            touched[self.base + offset] = True
            touched[self.base + self.stride + offset] = True
        for p in self.planes:
            if not touched[p.start : p.start + p.size].any():
                touched[p.start] = True  # a layer that is hidden entirely keeps one code
        return [touched[p.start : p.start + p.size].reshape(p.rows, p.columns) for p in self.planes]


def plane_for(
    boundary: Boundary | None, width: int, height: int, spacing: float, start: int
) -> Plane:
    """The plane of a layer: its box is the boundary's, within the canvas."""
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
    """The problem of a picture [H, W, 4] (premultiplied) with layers back to front."""
    height, width = picture.shape[:2]
    planes = _planes(boundaries, width, height, spacing)
    clear = np.ones(height * width, np.float32)
    rim = np.zeros(height * width, bool)
    # Where a front layer is translucent, those behind show through and learn together with it.
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
    """The problem of layers that are known one by one: each learns all of its own pixels.

    Args:
        picture_of: The picture [H, W, 4] of layer k, straight alpha; clean under its outline.
        boundaries: Of the layers, back to front.
        shape: The network; without a fourth channel the alpha of pictures is that of outlines.
        spacing: Canvas pixels between codes.
        size: Width and height of the canvas.
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
            # What the outline's rim takes away counts already.
            target[:, 3] = np.minimum(target[:, 3] / share[at], 1)
            target[:, :3] *= target[:, 3:]
        else:
            target[:, 3] = 1
        targets.append(target[:, : shape.channels])
        # A rim pixel is one to be sure of as far as it is covered.
        parts.append(entries_of(plane, at, width, np.ones_like(share[at]), share[at]))
    entries = tuple(np.concatenate(p) for p in zip(*parts, strict=True))
    target = np.concatenate(targets)
    return _problem(shape, planes, spacing, np.ones(len(target), np.int64), entries, target, areas)


Entries = tuple[NDArray[Any], ...]
"""base, stride, fx, fy, coverage and learn of some entries, as in `Problem`."""


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
    """The entries of a layer in the pixels `at` [N] of a canvas of `width` columns."""
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
    """The problem of entries, `counts` of them in each pixel."""
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
    """The prior of all codes whose pixels weigh less than `KNOWN` of what inner codes see."""
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
