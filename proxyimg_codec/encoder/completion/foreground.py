"""Colours of a soft layer without what shines through, by multi-level foreground estimation.

Source: Germer et al. 2020, "Fast multi-level foreground estimation". A pixel is a F + (1 - a) B.
Both colours are found that explain all pixels, and change little where alpha does not, at the size
of one pixel first, and then at doubled sizes up to that of the picture. The package pymatting has
it too, but compiles it by numba when it is imported; here the pixels of a chequerboard are solved
at once.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...texture.network import Floats

EVEN, SLOPE = 1e-5, 1.0
"""Weight of a difference from a neighbour, and how much it grows with the difference of alpha."""

SMALL = 32
"""Side up to which there are more rounds."""

ROUNDS_SMALL, ROUNDS = 10, 3


def foreground(picture: Floats, alpha: Floats, known: Floats) -> Floats:
    """Estimates the colours of a layer.

    Args:
        picture: float32 [H, W, 3] in 0..1.
        alpha: float32 [H, W] in 0..1, that of the layer.
        known: float32 [H, W] weights: 0 where the picture shows something else.

    Returns:
        float32 [H, W, 3] in 0..1.
    """
    height, width = alpha.shape
    levels = max((max(height, width) - 1).bit_length(), 1)
    own, behind = (
        np.einsum("hwc,hw->c", picture, known * share).reshape(1, 1, 3)
        / max(float((known * share).sum()), 1e-6)
        for share in (alpha, 1 - alpha)
    )
    for level in range(levels + 1):
        size = tuple(max(round(n ** (level / levels)), 1) for n in (width, height))
        seen, share, weight = (_resized(v, size) for v in (picture, alpha, known))
        own, behind = (_resized(v.astype(np.float32), size) for v in (own, behind))
        rounds = ROUNDS_SMALL if max(size) <= SMALL else ROUNDS
        own, behind = _balanced(own, behind, seen, share, weight, rounds)
    return np.asarray(own, np.float32)


def _resized(values: Floats, size: tuple[int, ...]) -> Floats:
    found = cv2.resize(values, size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(found.reshape(size[1], size[0], *values.shape[2:]), np.float32)


def _balanced(
    own: Floats, behind: Floats, picture: Floats, alpha: Floats, known: Floats, rounds: int
) -> tuple[Floats, Floats]:
    """Improves both colours [h, w, 3] in rounds, at every other pixel in turn."""
    height, width = alpha.shape
    near = [np.clip(np.arange(n) + k, 0, n - 1) for n in (height, width) for k in (-1, 1)]
    places = [(near[0], None), (near[1], None), (None, near[2]), (None, near[3])]

    def beside(values: Floats, place: int) -> Floats:
        rows, columns = places[place]
        return values[rows] if columns is None else values[:, columns]

    ties = [EVEN + SLOPE * np.abs(alpha - beside(alpha, k)) for k in range(4)]
    rest = 1 - alpha
    total = sum(ties)
    first, both, last = known * alpha**2 + total, known * alpha * rest, known * rest**2 + total
    scale = 1 / np.maximum(first * last - both**2, 1e-12)
    even = (np.arange(height)[:, None] + np.arange(width)) % 2 == 0
    out = np.empty((2, *picture.shape), np.float32)
    for c in range(picture.shape[2]):
        one, other, colour = own[..., c], behind[..., c], known * picture[..., c]
        for turn in range(2 * rounds):
            a, b = alpha * colour, rest * colour
            for k, tie in enumerate(ties):
                a += tie * beside(one, k)
                b += tie * beside(other, k)
            there = even if turn % 2 == 0 else ~even
            new = np.where(there, np.clip(scale * (last * a - both * b), 0, 1), one)
            other = np.where(there, np.clip(scale * (first * b - both * a), 0, 1), other)
            one = new
        out[0, ..., c], out[1, ..., c] = one, other
    return out[0], out[1]
