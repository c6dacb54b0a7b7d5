"""What a back layer learns where others hide it: the colours around, continued smoothly.

Without such pixels, codes at the rim of an object are bent by the few visible pixels they touch,
and the network is free to make anything of the codes that decoders fill in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats
from ..implicit.fit_problem import Problem, entries_of, prior_of
from .membrane import KNOWN, continued

BAND = 6
"""Pixels from the rim up to which all hidden pixels are learnt; these reach the stored codes."""

LATTICE = 3
"""Farther inside, one pixel in LATTICE x LATTICE is enough: codes there are smooth."""

RIM = 8.0
"""Weight of visible pixels at the rim, whose colour may be mixed with the front's."""


@dataclass(frozen=True, eq=False)
class Extended(Problem):
    """A problem with hidden pixels after the visible ones.

    Attributes:
        seen: What the visible pixels touch.
    """

    seen: tuple[NDArray[np.bool_], ...]

    def stored(self) -> list[NDArray[np.bool_]]:
        """As without the hidden pixels: what they teach costs no codes."""
        return [mask.copy() for mask in self.seen]


def extended(problem: Problem, width: int, height: int, spacing: float) -> Problem:
    """The problem, and hidden pixels of the back layer, which it learns alone.

    Args:
        problem: Of a canvas that the back layer covers, so that it has all pixels in order.
        width: Columns of the canvas.
        height: Its rows.
        spacing: Canvas pixels between codes.
    """
    assert problem.pixels == width * height, "the back layer must cover the canvas"
    back = problem.planes[0]
    rearmost = problem.first[1:] - 1
    free = (problem.base[rearmost] < back.size) & (problem.learn[rearmost] > 0)
    if free.all() or not free.any():
        return problem
    at, colour = _lesson(problem.target.reshape(height, width, -1), ~free.reshape(height, width))
    ones = np.ones(len(at), np.float32)
    base, stride, fx, fy, coverage, learn = (
        np.concatenate([getattr(problem, name), more])
        for name, more in zip(
            ("base", "stride", "fx", "fy", "coverage", "learn"),
            entries_of(back, at, width, ones, ones),
            strict=True,
        )
    )
    end = problem.first[-1] + np.arange(1, len(at) + 1, dtype=np.int32)
    target = np.concatenate([problem.target, colour])
    weight = coverage * learn
    return Extended(
        problem.shape, problem.planes, np.concatenate([problem.first, end]),
        base, stride, fx, fy, coverage, learn, target,
        prior_of(problem.planes, spacing, len(target), base, stride, fx, fy, weight),
        problem.areas, tuple(problem.stored()),
    )  # fmt: skip


def _lesson(picture: Floats, hidden: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Floats]:
    """Flat positions [N] of hidden pixels to learn and their colours [N, C].

    Args:
        picture: [H, W, C] visible pixels.
        hidden: bool [H, W], where something hides the back layer.
    """
    mask = hidden.astype(np.uint8)
    weight = np.where(cv2.dilate(mask, np.ones((3, 3), np.uint8)) > 0, RIM, KNOWN)
    colour = continued(picture, np.where(hidden, 0, weight).astype(np.float32))
    # Rounding must not take a mean out of the range of its terms: flat pictures stay flat.
    colour = np.clip(colour, picture[~hidden].min(0), picture[~hidden].max(0))
    chosen = cv2.distanceTransform(mask, cv2.DIST_L2, 5) <= BAND
    chosen[LATTICE // 2 :: LATTICE, LATTICE // 2 :: LATTICE] = True
    at = np.flatnonzero(chosen & hidden)
    return at, colour.reshape(-1, picture.shape[2])[at]
