"""Training pixels for the hidden part of a back layer: colours around it, continued smoothly.

Without them, codes at the rim of an object would be decided by the few visible pixels that depend
on them, and the network could give any colour to the codes that decoders fill in between.
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
"""Distance from the rim, in pixels, up to which all hidden pixels are learnt; some of these depend
on stored codes."""

LATTICE = 3
"""Farther inside, where codes are smooth, one pixel in LATTICE x LATTICE is learnt."""

RIM = 8.0
"""Weight of visible pixels at the rim, whose colour may be mixed with that of the object."""


@dataclass(frozen=True, eq=False)
class Extended(Problem):
    """Fitting problem that has hidden pixels after the visible ones.

    Attributes:
        seen: For each layer bool [rows, columns], True at codes that visible pixels depend on.
    """

    seen: tuple[NDArray[np.bool_], ...]

    def stored(self) -> list[NDArray[np.bool_]]:
        """For each layer bool [rows, columns], True at stored codes; hidden pixels add none."""
        return [mask.copy() for mask in self.seen]


def extended(problem: Problem, width: int, height: int, spacing: float) -> Problem:
    """Adds hidden pixels to a problem; only the back layer learns them.

    Args:
        problem: Problem with all pixels of the canvas in order, because the back layer covers it.
        width: Width of the canvas in pixels.
        height: Height of the canvas in pixels.
        spacing: Distance of codes in canvas pixels.

    Returns:
        The extended problem; `problem` itself if nothing or everything of the back layer is hidden.
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
    """Chooses hidden pixels to learn.

    Args:
        picture: float32 [H, W, C] visible colours.
        hidden: bool [H, W], True where another layer hides the back layer.

    Returns:
        int64 [N] positions of the pixels, row by row, and float32 [N, C] their colours.
    """
    mask = hidden.astype(np.uint8)
    weight = np.where(cv2.dilate(mask, np.ones((3, 3), np.uint8)) > 0, RIM, KNOWN)
    colour = continued(picture, np.where(hidden, 0, weight).astype(np.float32))
    # Rounding must not carry a mean out of the range of its terms, so that flat pictures stay flat.
    colour = np.clip(colour, picture[~hidden].min(0), picture[~hidden].max(0))
    chosen = cv2.distanceTransform(mask, cv2.DIST_L2, 5) <= BAND
    chosen[LATTICE // 2 :: LATTICE, LATTICE // 2 :: LATTICE] = True
    at = np.flatnonzero(chosen & hidden)
    return at, colour.reshape(-1, picture.shape[2])[at]
