"""Random samples for the layers network: parts of pictures, with sprites pasted on some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .layers_data import Bytes, Shot
from .pictures import drawn

Floats = NDArray[np.floating[Any]]

SHARES = {"bsds": 0.3, "coco": 0.17, "things": 0.18, "photo": 0.25, "drawn": 0.1}
"""How often a sample starts from each kind of picture, if there are any."""

PASTED = 0.45
"""Share of photographs on which sprites are pasted."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A sample of `size` pixels a side.

    Attributes:
        rgb: float32 [size, size, 3] in 0..1.
        figure: float32 [size, size] in 0..1.
        edge: float32 [size, size] in 0..1, or -1 where unknown.
        owner: float32 [size, size, 2], unit vectors x, y towards what is in front, at its edges.
        known: float32 [size, size], 1 where `owner` counts.
    """

    rgb: Floats
    figure: Floats
    edge: Floats
    owner: Floats
    known: Floats


class Sampler:
    """Random samples.

    Args:
        pictures: Pictures by kind.
        pasted: Sprites by kind, uint8 [H, W, 4], with the share of each kind.
        seed: Seed of all random choices.
    """

    def __init__(
        self,
        pictures: dict[str, list[Shot]],
        pasted: Sequence[tuple[float, list[Bytes]]],
        seed: int,
    ) -> None:
        self.pictures, self.pasted, self.seed = pictures, pasted, seed
        self.kinds = [kind for kind in SHARES if kind in pictures or kind == "drawn"]
        shares = np.array([SHARES[kind] for kind in self.kinds])
        self.shares = shares / shares.sum()

    def sample(self, number: int, size: int) -> Sample:
        """Makes the sample of a number; the same for the same seed."""
        rng = np.random.default_rng([self.seed, number])
        kind = rng.choice(self.kinds, p=self.shares)
        if kind == "drawn":
            canvas = _Canvas.plain(_backdrop(rng, size))
        else:
            canvas = _framed(self.pictures[kind][rng.integers(len(self.pictures[kind]))], size, rng)
        if kind == "drawn" or rng.random() < PASTED:
            for _ in range(rng.integers(1, 4)):
                canvas.paste(self._sprite(size, rng), rng)
            if rng.random() < 0.5:
                canvas.save_as_jpeg(rng)
        return canvas.finished(rng)

    def _sprite(self, size: int, rng: np.random.Generator) -> Floats:
        """Draws a sprite, turned and scaled; float32 [h, w, 4], premultiplied, in 0..1."""
        shares = [share for share, _ in self.pasted]
        group = self.pasted[rng.choice(len(shares), p=shares)][1]
        sprite = group[rng.integers(len(group))]
        scale = rng.uniform(0.2, 0.8) * size / max(sprite.shape[:2])
        angle, mirrored = rng.normal(0, 12) * (rng.random() < 0.4), rng.random() < 0.5
        high, wide = sprite.shape[:2]
        flat: NDArray[Any] = sprite.astype(np.float32)
        flat[..., :3] *= flat[..., 3:] / 255
        if scale < 1:
            flat = cv2.resize(flat, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        elif scale > 1:
            flat = cv2.resize(flat, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        if angle:
            high, wide = flat.shape[:2]
            turn = cv2.getRotationMatrix2D((wide / 2, high / 2), angle, 1.0)
            cos, sin = abs(turn[0, 0]), abs(turn[0, 1])
            box = (int(wide * cos + high * sin) + 1, int(high * cos + wide * sin) + 1)
            turn[:, 2] += (box[0] - wide) / 2, (box[1] - high) / 2
            flat = cv2.warpAffine(flat, turn, box)
        blur = rng.uniform(0, 1.2)
        if blur > 0.4:
            flat = cv2.GaussianBlur(flat, (0, 0), blur)
        return np.asarray(flat[:, ::-1] if mirrored else flat) / 255


def _backdrop(rng: np.random.Generator, size: int) -> Floats:
    """Plain or graded ground, or drawn shapes, float32 [size, size, 3] in 0..1."""
    if rng.random() < 0.25:
        return np.asarray(cv2.resize(drawn(rng), (size, size)), np.float32) / 255
    first, second = rng.random((2, 3)) if rng.random() < 0.6 else np.ones((2, 3))
    if rng.random() < 0.5:
        second = first
    ramp = np.linspace(0, 1, size)[:, None, None] * np.ones((1, size, 1))
    ground = first + (second - first) * ramp
    return np.ascontiguousarray(
        ground if rng.random() < 0.5 else ground.transpose(1, 0, 2), np.float32
    )


def _framed(shot: Shot, size: int, rng: np.random.Generator) -> _Canvas:
    """Cuts a square out of a picture that is enlarged or reduced: mostly of nearly all of it."""
    high, wide = shot.rgb.shape[:2]
    zoom = rng.uniform(1.0, 1.25) if rng.random() < 0.65 else rng.uniform(1.25, 2.2)
    scale = zoom * size / min(high, wide)
    h = max(size, round(high * scale * rng.uniform(0.9, 1.1)))
    w = max(size, round(wide * scale * rng.uniform(0.9, 1.1)))
    y, x = rng.integers(h - size + 1), rng.integers(w - size + 1)

    def cut(plane: Bytes, way: int) -> NDArray[Any]:
        return np.asarray(cv2.resize(plane, (w, h), interpolation=way))[y : y + size, x : x + size]

    soft = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    canvas = _Canvas.plain(cut(shot.rgb, soft).astype(np.float32) / 255)
    canvas.figure[:] = cut(shot.figure, soft) / np.float32(255)
    canvas.edge[:] = -1 if shot.edge is None else cut(shot.edge, soft) / np.float32(255)
    if shot.sure is not None:
        canvas.edge[cut(shot.sure.astype(np.uint8), cv2.INTER_NEAREST) == 0] = -1
    if shot.front is not None:
        front = cut(shot.front, cv2.INTER_NEAREST)
        unsure = cv2.dilate((front == 0).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        canvas.own(front == 2, ~unsure)
    return canvas


class _Canvas:
    """A sample in the making; attributes as in `Sample`."""

    def __init__(self, rgb: Floats) -> None:
        self.rgb = rgb
        shape = rgb.shape[:2]
        self.figure, self.edge, self.known = np.zeros((3, *shape), np.float32)
        self.owner = np.zeros((*shape, 2), np.float32)

    @classmethod
    def plain(cls, rgb: Floats) -> _Canvas:
        """Starts from a picture without figures and edges."""
        return cls(np.array(rgb, np.float32))

    def own(self, mask: NDArray[np.bool_], where: NDArray[np.bool_] | None = None) -> None:
        """Marks the edges of a mask, bool [size, size], as owned by its inside."""
        soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 2.0)
        slope = np.dstack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)])
        length = np.linalg.norm(slope, axis=2)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
        plane = mask.astype(np.uint8)
        band = (cv2.dilate(plane, disc) > cv2.erode(plane, disc)) & (length > 1e-3)
        if where is not None:
            band &= where
        self.known[mask] = 0
        self.known[band] = 1
        self.owner[band] = (slope / np.maximum(length, 1e-6)[..., None])[band]

    def paste(self, sprite: Floats, rng: np.random.Generator) -> None:
        """Pastes a sprite, float32 [h, w, 4] premultiplied, at a random place."""
        size = len(self.rgb)
        high, wide = sprite.shape[:2]
        out = 0.25 if rng.random() < 0.4 else 0.0  # beyond the frame
        y = int(rng.uniform(-out * high, max(size - high * (1 - out), 1)))
        x = int(rng.uniform(-out * wide, max(size - wide * (1 - out), 1)))
        full = np.zeros((size, size, 4), np.float32)
        top, left = max(y, 0), max(x, 0)
        part = sprite[top - y : size - y, left - x : size - x]
        full[top : top + part.shape[0], left : left + part.shape[1]] = part
        gain = rng.uniform(0.75, 1.1)
        self.rgb = self.rgb * (1 - full[..., 3:]) + np.minimum(full[..., :3] * gain, 1)
        mask = full[..., 3] > 0.5
        self.figure = np.where(mask, np.float32(1), self.figure)
        self.edge = np.where(mask, np.float32(0), self.edge)
        rim = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8))
        self.edge[rim > 0] = 1
        self.own(mask)

    def save_as_jpeg(self, rng: np.random.Generator) -> None:
        """Adds grain and the artefacts of JPEG, so that seams do not give sprites away."""
        grain = rng.normal(0, rng.uniform(0, 0.02), self.rgb.shape)
        levels = np.clip((self.rgb + grain) * 255, 0, 255).astype(np.uint8)
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(60, 96))]
        saved = cv2.imencode(".jpg", levels, quality)[1]
        self.rgb = np.asarray(cv2.imdecode(saved, cv2.IMREAD_COLOR), np.float32) / 255

    def finished(self, rng: np.random.Generator) -> Sample:
        """Changes colours, mirrors at random."""
        rgb = np.clip(self.rgb, 0, 1) ** np.float32(rng.uniform(0.75, 1.3))
        rgb = rgb * rng.uniform(0.8, 1.2) + rng.uniform(-0.08, 0.08)
        grey = rgb.mean(2, keepdims=True)
        rgb = grey + (rgb - grey) * (0 if rng.random() < 0.12 else rng.uniform(0.6, 1.4))
        planes = [np.clip(rgb, 0, 1), self.figure, self.edge, self.owner, self.known]
        if rng.random() < 0.5:
            planes = [plane[:, ::-1] for plane in planes]
            planes[3] = planes[3] * np.array([-1, 1])
        return Sample(*(np.ascontiguousarray(plane, np.float32) for plane in planes))
