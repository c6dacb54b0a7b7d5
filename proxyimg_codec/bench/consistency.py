"""Consistency of the frames of an animation along its flow."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..api import Image
from ..geometry import coverage as cover
from ..geometry.mesh import FRACTION_BITS
from ..geometry.warp import Warp
from ..render.compose import outline
from ..render.view import View, make_view

Real = NDArray[np.float64]

MARGIN = 2
"""Distance from outlines, in pixels, within which pixels are left out."""

ENLARGED = 4
"""Samples per pixel, across and down, of the frames that are warped; so many that interpolation is
almost exact."""

NOWHERE = -1
"""Label of pixels near outlines."""

CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
DISC = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * MARGIN + 1, 2 * MARGIN + 1))


def rms(values: NDArray[Any]) -> float:
    """Root mean square of values; 0 for an empty array."""
    return float(np.sqrt((values.astype(np.float64) ** 2).mean())) if values.size else 0.0


def labels(image: Image, view: View) -> NDArray[np.int64]:
    """Layer that each pixel of a still shows, int64 [H, W]; `NOWHERE` near outlines."""
    seen = np.zeros((view.height, view.width), np.int64)
    near = np.zeros(seen.shape, np.uint8)
    for number, layer in enumerate(image.layers):
        paths = outline(layer.outline, view)
        if paths is None:
            continue
        covered = cover.coverage(paths, 0, 0, view.width, view.height)
        seen[covered > 0] = number
        # The rim of the fully covered pixels counts too, as outlines may lie on edges of pixels.
        full = (covered == cover.FULL).astype(np.uint8)
        near |= np.asarray(cv2.morphologyEx(full, cv2.MORPH_GRADIENT, CROSS), np.uint8)
        near |= ((covered > 0) & (covered < cover.FULL)).astype(np.uint8)
    return np.where(cv2.dilate(near, DISC) > 0, NOWHERE, seen)


def origins(before: Image, after: Image, seen: NDArray[np.int64], view: View) -> Real:
    """Canvas points, in an earlier still, of the texture points that a later still shows.

    Args:
        before: The earlier still.
        after: The later still of the same picture.
        seen: int64 [H, W] layer that each pixel of `after` shows, or `NOWHERE`.
        view: View of the whole canvas.

    Returns:
        float64 [H, W, 2] x, y; NaN for pixels that show no layer with a mesh.
    """
    out = np.full((*seen.shape, 2), np.nan)
    box = (0, 0, view.width, view.height)
    for number, (old, new) in enumerate(zip(before.layers, after.layers, strict=True)):
        row, column = np.nonzero(seen == number)
        if new.mesh is None or not len(row):
            continue
        refined = new.mesh.refined
        warp = Warp(new.pose, new.mesh, meshed=True)
        face = warp.faces(*view.grid, box)[row, column]
        x, y = view.columns(0, view.width)[column], view.rows(0, view.height)[row]
        found = warp.locate(x, y, face)
        assert found.face is not None
        assert found.weights is not None
        corners = old.pose.present(refined)[refined.faces[found.face]] / (1 << FRACTION_BITS)
        out[row, column] = (found.weights[..., None] * corners).sum(1)
    return out


def warped(picture: NDArray[np.float32], points: Real, scale: int) -> NDArray[np.float32]:
    """Samples a picture at canvas points.

    Args:
        picture: float32 [h, w, 3] picture.
        points: float64 [H, W, 2] x, y in canvas pixels; NaN counts as 0.
        scale: Samples of the picture per canvas pixel.

    Returns:
        float32 [H, W, 3].
    """
    at = np.nan_to_num(points * scale - 0.5, nan=0.0).astype(np.float32)
    x, y = np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 1])
    border = cv2.BORDER_REPLICATE
    return np.asarray(cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=border), np.float32)


def pair(before: Image, after: Image) -> list[float]:
    """Compares two stills at pixels that show the same point of the same moving layer.

    Returns:
        The number of these pixels; sums over them of squared differences in 8-bit levels (mean over
        channels) along the flow from enlarged frames, along the flow from frames as they are, and
        without flow; and the sum of displacements in pixels.
    """
    view = make_view((after.width, after.height))
    then, now = labels(before, view), labels(after, view)
    points = origins(before, after, now, view)
    last = np.array([view.width, view.height]) - MARGIN
    inside = np.asarray((points >= MARGIN).all(2) & (points < last).all(2))
    x, y = np.where(inside[..., None], points, 0).astype(int).transpose(2, 0, 1)
    good = inside & (now > 0) & (then[y, x] == now)
    small, large, result = (
        255 * still.render(dtype=np.float32, scale=scale)[..., :3]
        for still, scale in ((before, 1), (before, ENLARGED), (after, 1))
    )
    tries = (warped(large, points, ENLARGED), warped(small, points, 1), small)
    squares = [float(((t - result)[good].astype(float) ** 2).mean(1).sum()) for t in tries]
    row, column = np.nonzero(good)
    centres = np.stack(
        [view.columns(0, view.width)[column], view.rows(0, view.height)[row]], axis=1
    )
    return [float(len(row)), *squares, float(np.hypot(*(points[good] - centres).T).sum())]
