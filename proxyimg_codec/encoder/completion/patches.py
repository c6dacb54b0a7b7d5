"""Completion of a hole by patches: what the hidden part may look like, and where that comes from.

From coarse to fine, patches that touch the hole look for the most similar patch of what is known
(PatchMatch: Barnes and others 2009), and each hidden pixel becomes a weighted mean of what the
patches over it have found, several times (Wexler, Shechtman and Irani 2007, "Space-Time Completion
of Video"). Besides colours, patches compare the mean size of gradients around each pixel (Newson
and others 2014, "Video Inpainting of Complex Scenes"): without it, smooth places win. Those of the
hole are continued from its rim and not averaged, for averages of averages become smooth too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats
from .membrane import continued_from

REACH = 3
"""Patches are squares of 2 `REACH` + 1 pixels."""

TEXTURE, AROUND, STEP = 2.8, 2.5, 2
"""Weight of the sizes of gradients beside colours, standard deviation in pixels of the mean, and
pixels from one end of a gradient to the other."""

BUSIER = 1.3
"""Factor by which gradients in the hole are larger than their continuation, for what is found to
fit is smoother than what was looked for."""

ROUNDS = (10, 6, 4, 3, 2)
"""Rounds of finding and averaging at each level, the coarsest first; the last for all others."""

LEAST = 4.0
"""Greatest distance of a hidden pixel from a known one at the coarsest level, in its pixels."""

FEW = 300
"""Fewest whole patches to choose from at the coarsest level."""

MOST = 12000
"""Most patches of a level; finer levels are left out."""

FADING = 1.3
"""Factor by which the weight of patches falls with each pixel away from what is known."""

Pixels = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Guess:
    """Guess of what a hole looks like.

    Attributes:
        features: float32 [H, W, 5] colours in 0..255 and sizes of gradients across and down, times
            `TEXTURE`; in the hole those that were guessed.
        offsets: int64 [n, 2] offsets dx, dy of the patches that were found, each once, the most
            frequent first.
    """

    features: Floats
    offsets: Places


def guessed(features: Floats, known: Pixels, hole: Pixels, seed: int) -> Guess:
    """Guesses what a hole looks like.

    Args:
        features: float32 [H, W, 5] as from `features_of`, perhaps reduced since.
        known: bool [H, W], True where patches may come from; some whole patch must be.
        hole: bool [H, W], True where the guess is wanted; no pixel of it is known.
        seed: Seed of the random search.
    """
    rng = np.random.default_rng([seed, 17])
    *finer, coarsest = _levels(features, known, hole)
    found, scale = _found(_Level(*coarsest), None, ROUNDS[0], rng), 2 ** len(finer)
    for number, planes in enumerate(reversed(finer), 1):
        level = _Level(*planes)
        if len(level.rows) > MOST:
            break
        found = _found(level, found, ROUNDS[min(number, len(ROUNDS) - 1)], rng)
        scale //= 2
    return _enlarged(found, scale, features, hole)


def _found(level: _Level, coarse: _Level | None, rounds: int, rng: np.random.Generator) -> _Level:
    """A level after all of its rounds, begun with what a coarser one has found, or at random."""
    level.begin(coarse, rng)
    for k in range(rounds):
        level.search(rng, 2 if k else 3)
        level.vote()
    return level


def features_of(colours: Floats, known: Pixels) -> Floats:
    """Colours, and the mean sizes of gradients, of what is known, continued smoothly elsewhere.

    Args:
        colours: float32 [H, W, 3] in 0..255.
        known: bool [H, W].

    Returns:
        float32 [H, W, 5].
    """
    seen = known.astype(np.float32)
    soft = cv2.GaussianBlur(colours.mean(2) * seen, (0, 0), STEP / 2)
    soft /= np.maximum(cv2.GaussianBlur(seen, (0, 0), STEP / 2), np.float32(1e-3))
    square = np.ones((2 * STEP + 1,) * 2, np.uint8)
    inside = cv2.erode(known.astype(np.uint8), square).astype(np.float32)
    share = np.maximum(cv2.GaussianBlur(inside, (0, 0), AROUND), np.float32(1e-3))
    planes: list[Any] = [colours]
    for axis in (1, 0):
        ends = soft.take(np.minimum(np.arange(soft.shape[axis]) + STEP, soft.shape[axis] - 1), axis)
        size = np.abs(ends - soft)
        planes.append(cv2.GaussianBlur(size * inside, (0, 0), AROUND) / share * TEXTURE)
    features = np.dstack(planes).astype(np.float32)
    return np.where(known[..., None], features, continued_from(features, known))


def halved(plane: NDArray[Any], whole: bool) -> NDArray[Any]:
    """Halves a plane [H, W, ...]: means, or for bool whether all (`whole`) or any are True."""
    high, wide = (plane.shape[0] + 1) // 2, (plane.shape[1] + 1) // 2
    beside = [(0, 2 * high - plane.shape[0]), (0, 2 * wide - plane.shape[1])]
    even = np.pad(plane, beside + [(0, 0)] * (plane.ndim - 2), mode="edge")
    blocks = even.reshape(high, 2, wide, 2, *plane.shape[2:])
    if plane.dtype == np.bool_:
        return np.asarray(blocks.all((1, 3)) if whole else blocks.any((1, 3)))
    return np.asarray(blocks.mean((1, 3)), plane.dtype)


def _levels(features: Floats, known: Pixels, hole: Pixels) -> list[tuple[Floats, Pixels, Pixels]]:
    """Features, known and hidden pixels of all levels, the finest first."""
    found = [(features, known, hole)]
    while True:
        features, known, hole = found[-1]
        depth = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5).max()
        coarse = halved(features, True), halved(known, True), halved(hole, False)
        if depth < LEAST or whole(coarse[1]).sum() < FEW:
            break
        found.append((coarse[0], coarse[1], coarse[2] & ~coarse[1]))
    return found


def whole(known: Pixels) -> Pixels:
    """Centres of patches that are known as a whole."""
    square = np.ones((2 * REACH + 1,) * 2, np.uint8)
    plane = cv2.erode(
        known.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=(0,)
    )
    return np.asarray(plane > 0)


class _Level:
    """One level of the search.

    Attributes:
        features: float32 [H, W, 5]; colours of the hole are changed by `vote`.
        rows, columns: int64 [n] centres of the patches that touch the hole.
        targets: int64 [n, 2] row and column of the patch that each has found.
        apart: float32 [n] sums of squared differences of the two.
    """

    def __init__(self, features: Floats, known: Pixels, hole: Pixels) -> None:
        self.features, self.hole = features.copy(), hole
        self.features[hole, 3:] *= np.float32(BUSIER)
        self.source = whole(known)
        square = np.ones((2 * REACH + 1,) * 2, np.uint8)
        near = cv2.dilate(hole.astype(np.uint8), square) > 0
        self.rows, self.columns = np.nonzero(near)
        self.number = np.full(hole.shape, -1)
        self.number[near] = np.arange(len(self.rows))
        depth = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5)[near]
        self.weight = (FADING**-depth).astype(np.float32)
        self.targets = np.zeros((len(self.rows), 2), np.int64)
        self.apart = np.ones(len(self.rows), np.float32)

    @property
    def offsets(self) -> Places:
        """Offsets dy, dx from the patches to those that they have found, int64 [n, 2]."""
        return self.targets - np.stack([self.rows, self.columns], 1)

    def begin(self, coarse: _Level | None, rng: np.random.Generator) -> None:
        """Takes over what a level of half the size has found; begins at random without one."""
        centres = np.stack([self.rows, self.columns], 1)
        there = np.argwhere(self.source)
        self.targets = there[rng.integers(len(there), size=len(centres))]
        if coarse is None:
            return
        number = coarse.number[self.rows // 2, self.columns // 2]
        moved = centres + 2 * coarse.offsets[np.maximum(number, 0)]
        limit = np.array(self.source.shape) - 1
        inside = (number >= 0) & (moved >= 0).all(1) & (moved <= limit).all(1)
        moved = np.clip(moved, 0, limit)
        inside &= self.source[moved[:, 0], moved[:, 1]]
        self.targets[inside] = moved[inside]
        larger = cv2.resize(coarse.features, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
        high, wide = self.hole.shape
        self.features[self.hole, :3] = larger[:high, :wide, :3][self.hole]
        self.vote()

    def search(self, rng: np.random.Generator, times: int) -> None:
        """Lets patches try what their neighbours have found, and random places."""
        patches = self._view()
        own = patches[self.rows, self.columns].reshape(len(self.rows), -1)
        limit = np.array(self.source.shape)

        def away(targets: Places, which: Places | slice) -> Floats:
            found = patches[targets[:, 0], targets[:, 1]].reshape(-1, own.shape[1])
            found = found - own[which]
            return np.asarray(np.einsum("ij,ij->i", found, found), np.float32)

        def attempt(targets: Places, valid: Pixels) -> None:
            valid &= (targets >= 0).all(1) & (targets < limit).all(1)
            at = np.flatnonzero(valid)
            at = at[self.source[targets[at, 0], targets[at, 1]]]
            apart = away(targets[at], at)
            better = apart < self.apart[at]
            self.targets[at[better]], self.apart[at[better]] = targets[at[better]], apart[better]

        self.apart = away(self.targets, slice(None))
        steps = [(k * y, k * x) for k in (4, 2, 1) for y, x in ((0, 1), (0, -1), (1, 0), (-1, 0))]
        for _ in range(times):
            for dy, dx in steps:
                y, x = self.rows + dy, self.columns + dx
                inside = (y >= 0) & (y < limit[0]) & (x >= 0) & (x < limit[1])
                beside = np.full(len(y), -1)
                beside[inside] = self.number[y[inside], x[inside]]
                attempt(self.targets[np.maximum(beside, 0)] - (dy, dx), beside >= 0)
            reach = int(limit.max()) // 2
            while reach >= 1:
                aside = rng.integers(-reach, reach + 1, self.targets.shape)
                attempt(self.targets + aside, np.ones(len(aside), np.bool_))
                reach //= 3

    def vote(self) -> None:
        """Gives hidden pixels the weighted means of what the patches over them have found."""
        sigma = max(float(np.percentile(self.apart, 75)), 1.0)
        weight = self.weight * np.exp(-self.apart / (2 * sigma)) + np.float32(1e-8)
        padded = self._padded()[..., :3]
        total, share = np.zeros_like(padded), np.zeros(padded.shape[:2], np.float32)
        for j in range(2 * REACH + 1):
            for i in range(2 * REACH + 1):
                seen = padded[self.targets[:, 0] + j, self.targets[:, 1] + i]
                total[self.rows + j, self.columns + i] += weight[:, None] * seen
                share[self.rows + j, self.columns + i] += weight
        inner = slice(REACH, -REACH)
        mean = total[inner, inner] / np.maximum(share[inner, inner], np.float32(1e-8))[..., None]
        self.features[self.hole, :3] = mean[self.hole]

    def _padded(self) -> Floats:
        return np.pad(self.features, ((REACH, REACH), (REACH, REACH), (0, 0)), mode="edge")

    def _view(self) -> Floats:
        """Patches float32 [H, W, 5, side, side] around all pixels, without copying."""
        return np.lib.stride_tricks.sliding_window_view(
            self._padded(), (2 * REACH + 1, 2 * REACH + 1), (0, 1)
        )


def _enlarged(level: _Level, scale: int, features: Floats, hole: Pixels) -> Guess:
    """Guess of a level, `scale` times as large, in the place of `hole`."""
    inside = level.hole[level.rows, level.columns]
    offsets, counts = np.unique(level.offsets[inside][:, ::-1], axis=0, return_counts=True)
    offsets = offsets[np.argsort(-counts, kind="stable")] * scale
    high, wide = hole.shape
    larger = cv2.resize(level.features, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    return Guess(np.where(hole[..., None], larger[:high, :wide], features), offsets)
