"""Filled Bézier paths, fitted layer by layer (DiffVG, Li et al. 2020; LIVE, Ma et al. 2022).

A path is closed, of four cubic segments, with one colour and one opacity: 28 numbers, as LIVE has
it. Its edge is a ramp over the distance to the path, which narrows from `BLURS[0]` to `BLURS[1]`
pixels while a fit goes on; DiffVG integrates the edge over each pixel instead. Losses are squared
errors alone. Colours lie on white.
"""

from __future__ import annotations

import math
import time

import cv2
import numpy as np
from numpy.typing import NDArray

from ...encoder.yielding import torch
from ..measure import ms_ssim, psnr
from .fitting import Fitted, Pixels, Rival, picture, places

POINTS = 12
"""Control points of a path."""

EACH = 2 * POINTS + 4
"""Parameters of a path: points, red, green, blue and opacity."""

PIECES = 6
"""Straight pieces that a segment is drawn as."""

BLURS = (4.0, 1.0)
"""Widths in pixels of the ramp of an edge at the beginning and the end of a fit."""

POINT_RATE, COLOUR_RATE = 1.0, 0.01
"""Learning rates of points, in pixels, and of colours (LIVE)."""

LEVELS = 6
"""Levels of a channel by which the picture is cut into parts that a new path may start from."""

BATCH = 4096
"""Pixels of a batch."""

LEAST = 2.0
"""Least radius of a new path in pixels."""


class Paths(Rival):
    """Closed paths, from back to front.

    Args:
        count: Number of paths.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.

    Attributes:
        used: Number of paths that are drawn.
        blur: Width of the ramp of an edge in pixels.
    """

    rate = POINT_RATE

    def __init__(self, count: int, width: int, height: int) -> None:
        super().__init__()
        self.size = torch.tensor([width, height], dtype=torch.float32)
        self.points = torch.nn.Parameter(torch.zeros(count, POINTS, 2))
        self.colours = torch.nn.Parameter(torch.ones(count, 4))
        self.used, self.blur = 0, BLURS[1]
        t = torch.arange(PIECES, dtype=torch.float32)[:, None] / PIECES
        self._basis = torch.cat([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], 1)

    def start(self, x: float, y: float, radius: float, colour: NDArray[np.float64]) -> None:
        """Adds a path: a circle of one colour [3] in 0..1."""
        angle = torch.arange(POINTS) * (2 * math.pi / POINTS)
        with torch.no_grad():
            self.points[self.used] = torch.stack(
                [x + radius * torch.cos(angle), y + radius * torch.sin(angle)], 1
            )
            self.colours[self.used, :3] = torch.from_numpy(colour)
            self.colours[self.used, 3] = 1
        self.used += 1

    def corners(self) -> torch.Tensor:
        """Corners [paths, 4 * PIECES, 2] of the polygons that the paths in use are drawn as."""
        index = (3 * torch.arange(4)[:, None] + torch.arange(4)) % POINTS
        segments = self.points[: self.used][:, index]
        return torch.einsum("tk,nskd->nstd", self._basis, segments).flatten(1, 2)

    def coverage(self, at: torch.Tensor) -> torch.Tensor:
        """Coverage [paths, N] of points [N, 2] in pixels, by the even-odd rule."""
        corners = self.corners()
        with torch.no_grad():
            near = torch.cdist(at[None].expand(len(corners), -1, -1), corners).argmin(2)
            inside = _inside(at, corners)
        rows, count = torch.arange(len(corners))[:, None], corners.shape[1]
        corner = corners[rows, near]
        # The nearest piece begins or ends at the nearest corner, unless pieces are very unequal.
        square = torch.minimum(
            _square(at, corner, corners[rows, (near + 1) % count]),
            _square(at, corner, corners[rows, (near - 1) % count]),
        )
        distance = square.add(1e-6).sqrt()
        return (0.5 + torch.where(inside, distance, -distance) / self.blur).clamp(0, 1)

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2]."""
        out = torch.ones(len(place), 3)
        if self.used:
            covered = self.coverage((place + 1) / 2 * self.size)
            for k in range(self.used):
                colour, opacity = self.colours[k, :3], self.colours[k, 3].clamp(0, 1)
                out = out + (covered[k] * opacity)[:, None] * (colour - out)
        return out


def _square(at: torch.Tensor, first: torch.Tensor, last: torch.Tensor) -> torch.Tensor:
    """Squared distances [paths, N] of points [N, 2] from pieces between corners [paths, N, 2]."""
    step, away = last - first, at - first
    along = (away * step).sum(2) / (step * step).sum(2).clamp(min=1e-9)
    return (away - along.clamp(0, 1)[..., None] * step).square().sum(2)


def _inside(at: torch.Tensor, corners: torch.Tensor) -> torch.Tensor:
    """Whether points [N, 2] lie in polygons [paths, corners, 2]: bool [paths, N]."""
    x, y = at.unbind(1)
    first, last = corners, corners.roll(-1, 1)
    slope = (last[..., 0] - first[..., 0]) / (last[..., 1] - first[..., 1] + 1e-9)
    above = y[:, None] < first[:, None, :, 1]
    crossed = above != above.roll(-1, 2)
    edge = (first[..., 0] - first[..., 1] * slope)[:, None] + y[:, None] * slope[:, None]
    return (crossed & (x[:, None] < edge)).sum(2) % 2 == 1


def fit(pixels: Pixels, count: int, steps: int, seed: int = 0) -> Fitted:
    """Fits paths: one after the other is added where the picture is worst, and all are fitted.

    Args:
        pixels: uint8 [H, W, 3] picture.
        count: Number of paths.
        steps: Number of optimizer steps of the whole fit.
        seed: Seed of batches.
    """
    height, width = pixels.shape[:2]
    started = time.process_time()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        paths = Paths(count, width, height)
        for _ in range(count):
            paths.start(*_worst(pixels, picture(paths, height, width)))
            _steps(paths, pixels, steps // (2 * count), (BLURS[0], BLURS[0]))
        _steps(paths, pixels, steps // 2, BLURS)
    seconds = time.process_time() - started
    shown = picture(paths, height, width)
    quality = psnr(pixels, shown), ms_ssim(pixels, shown)
    return Fitted(*quality, count * EACH, steps, seconds, shown)


def _steps(paths: Paths, pixels: Pixels, steps: int, blurs: tuple[float, float]) -> None:
    """Fits all paths in use by Adam on random pixels, with cosine decay."""
    place = places(*pixels.shape[:2])
    target = torch.from_numpy(pixels.reshape(-1, 3) / np.float32(255))
    groups = [{"params": [paths.points], "lr": POINT_RATE},
              {"params": [paths.colours], "lr": COLOUR_RATE}]  # fmt: skip
    adam = torch.optim.Adam(groups, betas=(0.9, 0.99))
    decay = torch.optim.lr_scheduler.CosineAnnealingLR(adam, max(steps, 1), eta_min=0.0)
    batch = min(BATCH, len(place))
    for step in range(steps):
        paths.blur = blurs[0] * (blurs[1] / blurs[0]) ** (step / steps)
        chosen = torch.randint(len(place), (batch,))
        loss = ((paths(place[chosen]) - target[chosen]) ** 2).mean()
        adam.zero_grad(set_to_none=True)
        loss.backward()
        adam.step()
        decay.step()
    paths.blur = BLURS[1]


def _worst(pixels: Pixels, shown: Pixels) -> tuple[float, float, float, NDArray[np.float64]]:
    """Place, radius and colour of a new path: in the even part of the picture that is worst.

    Parts are connected pixels of about one colour (LIVE starts paths alike). A path starts where
    it has most room.
    """
    error = ((pixels.astype(float) - shown) ** 2).sum(2)
    grey = cv2.medianBlur(np.ascontiguousarray(pixels), 5).astype(int) * LEVELS // 256
    flat = grey @ np.array([LEVELS * LEVELS, LEVELS, 1])
    best, part = -1.0, np.ones(error.shape, bool)
    for value in np.unique(flat):
        count, label = cv2.connectedComponents((flat == value).astype(np.uint8))
        sums = np.bincount(label.ravel(), error.ravel(), count)
        sums[0] = -1
        if sums.max() > best:
            best, part = float(sums.max()), label == int(sums.argmax())
    room = cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    y, x = np.unravel_index(int(room.argmax()), room.shape)
    colour = pixels[part].mean(0) / 255
    return float(x) + 0.5, float(y) + 0.5, max(float(room.max()), LEAST), colour
