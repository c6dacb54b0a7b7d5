"""Composites: sprites with known masks and order on photographs. A part of `benchmarks.layers`.

Sprites are the cliparts of ``clipart/`` and a tenth of ``emoji/``, which training leaves out;
photographs are those of ``kodak/`` and ``photo2k/``. Sprites are blurred and get noise as the
photograph has it, and the whole is saved once as JPEG, so that seams do not give them away.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.common import Pixels, read_rgb
from benchmarks.layer_scores import Mask, Point
from proxyimg_codec.bench.sprites import Sprite, scaled, solid

Floats = NDArray[np.float32]

SIDE = 768
"""Longer side of composites in pixels."""

SIZES = (0.15, 0.45)
"""Longer sides of sprites as shares of that of the photograph."""

JPEG_QUALITY = 90

LEAST = 0.015
"""Share of the picture from which on the visible part of a sprite counts."""

OVERLAP = (0.1, 0.5)
"""Share of the rear sprite of an overlapping pair that the front one covers."""

EDGES, RESAMPLED, REBLUR = 99, 0.5, 1.0
"""Percentile of gradients that are edges; standard deviations, in pixels, of the blur that reducing
a sprite leaves, and of the one that edges are compared with."""

APART = np.ones((9, 9), np.uint8)
"""Neighbourhood that sprites which do not overlap leave free."""

TRIES = 200
"""Places that are tried for sprites, before others are chosen."""


class Composite(NamedTuple):
    """A composite.

    Attributes:
        rgb: uint8 [H, W, 3].
        masks: Visible parts bool [H, W] of the sprites that count, back to front.
        pairs: Numbers in `masks` of the sprites of each pair that overlaps: rear, front.
    """

    rgb: Pixels
    masks: list[Mask]
    pairs: list[Point]


def composites(data: Path, count: int) -> Iterator[Composite]:
    """Yields composites, always the same; in every second one two sprites overlap."""
    photographs = [*sorted((data / "kodak").glob("*.png")), *sorted((data / "photo2k").glob("*.*"))]
    cut_out = [s for f in sprite_files(data) if (s := solid(rgba(f))) is not None]
    for k in range(count):
        rng = np.random.default_rng(k)
        photograph = reduced(read_rgb(photographs[k % len(photographs)]), SIDE)
        yield composite(photograph, cut_out, rng, overlapping=k % 2 == 0)


def composite(
    photograph: Pixels, cut_out: list[Pixels], rng: np.random.Generator, overlapping: bool
) -> Composite:
    """Puts two or three sprites on a photograph.

    Args:
        photograph: uint8 [H, W, 3].
        cut_out: Sprites to choose from, uint8 [h, w, 4], cropped to what is inside.
        rng: Random numbers.
        overlapping: Whether the last two overlap; other sprites lie apart.
    """
    shape = photograph.shape[:2]
    count = 2 + int(rng.integers(2))
    placed = list[Sprite]()
    while len(placed) < count:
        placed = _placed(shape, cut_out, rng, count, overlapping)
    blur, noise = blur_of(photograph), noise_of(photograph)
    canvas: Floats = photograph.astype(np.float32)
    masks = list[Mask]()
    for sprite in placed:
        layer = _softened(sprite.on(shape), blur)
        grain = rng.normal(0, noise, canvas.shape).astype(np.float32)
        alpha = layer[..., 3:] / 255
        canvas += (layer[..., :3] + grain - canvas) * alpha
        front = layer[..., 3] >= 128
        masks = [*(m & ~front for m in masks), front]
    # Placing made them so: only the last two of an overlapping composite do.
    pairs = [(count - 2, count - 1)] if overlapping else []
    counted = [k for k, m in enumerate(masks) if m.mean() >= LEAST]
    both = [(counted.index(a), counted.index(b)) for a, b in pairs if {a, b} <= set(counted)]
    return Composite(saved(canvas), [masks[k] for k in counted], both)


def _placed(
    shape: tuple[int, ...], cut_out: list[Pixels], rng: np.random.Generator, count: int,
    overlapping: bool,
) -> list[Sprite]:  # fmt: skip
    """Sprites in places that are as asked for; fewer if `TRIES` found none."""
    chosen = [cut_out[i] for i in rng.permutation(len(cut_out))[:count]]
    placed, masks, near = list[Sprite](), list[Mask](), list[Mask]()
    for _ in range(TRIES):
        if len(placed) == count:
            break
        small = scaled(chosen[len(placed)], rng.uniform(*SIZES) * max(shape))
        room = [n - m for n, m in zip(shape, small.shape, strict=False)]
        if min(room) < 0:
            continue
        y, x = (int(rng.integers(r + 1)) for r in room)
        sprite = Sprite(small, x, y)
        mask = sprite.on(shape)[..., 3] >= 128
        last = overlapping and len(placed) == count - 1
        covered = (masks[-1] & mask).sum() / masks[-1].sum() if last else 0.0
        if last and not OVERLAP[0] <= covered <= OVERLAP[1]:
            continue
        if any((n & mask).any() for n in (near[:-1] if last else near)):
            continue
        placed.append(sprite)
        masks.append(mask)
        near.append(cv2.dilate(mask.astype(np.uint8), APART) > 0)
    return placed


def reduced(pixels: Pixels, side: int) -> Pixels:
    """Reduces a picture [H, W, C] to a longer side of at most `side` pixels."""
    scale = side / max(pixels.shape[:2])
    if scale >= 1:
        return pixels
    size = (round(pixels.shape[1] * scale), round(pixels.shape[0] * scale))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA))


def blur_of(rgb: Pixels) -> float:
    """Standard deviation, in pixels, of the blur of a picture's sharp edges (Zhuo and Sim, 2011).

    Blurring once more weakens the gradient of an edge by a factor that tells how wide it was.
    """
    grey = rgb.astype(np.float32).mean(2)
    again = cv2.GaussianBlur(grey, (0, 0), REBLUR)
    before, after = (np.hypot(*(cv2.Sobel(g, cv2.CV_32F, *d) for d in ((1, 0), (0, 1))))
                     for g in (grey, again))  # fmt: skip
    edge = before >= max(float(np.percentile(before, EDGES)), 1.0)
    if not edge.any():
        return 0.0
    ratio = max(float(np.median(before[edge] / np.maximum(after[edge], 1e-3))), 1.01)
    return float(REBLUR / np.sqrt(ratio**2 - 1))


def noise_of(rgb: Pixels) -> float:
    """Standard deviation of a picture's noise, in levels of 8 bits: that of its smoothest blocks.

    The kernel is that of Immerkaer (1996), which sees no edges that are straight.
    """
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    rough = cv2.filter2D(rgb.astype(np.float32), cv2.CV_32F, kernel) ** 2
    blocks = cv2.resize(rough, None, fx=1 / 16, fy=1 / 16, interpolation=cv2.INTER_AREA)
    return float(np.sqrt(np.percentile(blocks, 10)))


def saved(rgb: NDArray[np.floating]) -> Pixels:
    """A picture [H, W, 3] in 0..255 as it is after JPEG at quality 90."""
    file = io.BytesIO()
    whole = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
    Image.fromarray(whole).save(file, "JPEG", quality=JPEG_QUALITY)
    return np.asarray(Image.open(file))


def _softened(rgba: Pixels, blur: float) -> Floats:
    """Blurs a sprite as wide as the edges of a photograph: float32 [H, W, 4], straight alpha."""
    layer: Floats = rgba.astype(np.float32)
    more = np.sqrt(max(0.0, blur**2 - RESAMPLED**2))
    if more < 0.1:
        return layer
    # Colours of clear pixels are arbitrary, so they do not count.
    layer[..., :3] *= layer[..., 3:] / 255
    layer = np.asarray(cv2.GaussianBlur(layer, (0, 0), more), np.float32)
    layer[..., :3] /= np.maximum(layer[..., 3:] / 255, 1e-6)
    return layer


def sprite_files(data: Path) -> list[Path]:
    """Files of sprites that training leaves out: all cliparts, and a tenth of the emoji."""
    emoji = [f for f in sorted((data / "emoji").glob("*.*"))
             if int(hashlib.sha1(f.read_bytes()).hexdigest(), 16) % 10 == 0]  # fmt: skip
    return [*sorted((data / "clipart").glob("*.png")), *emoji]


def rgba(file: Path) -> Pixels:
    """Reads a picture file as uint8 [H, W, 4]."""
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGBA"))
