"""Weights of errors at the borders of a raster.

Lines are mirrored there, and nothing beyond helps to code what is cut in two. So the cheapest
latents show a smooth border worse than the same samples inside, though few bits more mend that.
Inside busy borders, bits are dear and errors hidden: there is no more weight than elsewhere.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats

RING = 12
"""Samples at a border with the full weight; beyond, it falls to 1 over as many again."""

COLOUR, ALPHA = 2.0, 4.0
"""Weight that is added at a smooth border, and at any of alpha, which is seen against all grounds
and costs few bits."""

SMOOTH = 0.02
"""Mean squared difference of neighbours, in squares of the step, that halves what is added."""

NEAR = 17
"""Side of the square around a sample in which neighbours are compared."""


def bordered(samples: Floats, weight: Floats | None, alpha: bool, step: int) -> Floats:
    """Weights of squared errors float32 [H, W] that are larger at borders.

    Args:
        samples: float32 [H, W, 3] samples in 0..255.
        weight: float32 [H, W] weights of the samples themselves; None = 1.
        alpha: Whether the samples are alpha.
        step: Index s of the quantization step 2**(s / 64).
    """
    own = np.float32(1) if weight is None else weight
    away = 1 - _near(samples.shape[0])[:, None], 1 - _near(samples.shape[1])
    near = 1 - away[0] * away[1]
    if alpha:
        return own * (1 + np.float32(ALPHA) * near)
    busy = cv2.blur(own * _differences(samples), (NEAR, NEAR), borderType=cv2.BORDER_REPLICATE)
    more = COLOUR / (1 + busy / (SMOOTH * 4.0 ** (step / 64)))
    return np.asarray(own * (1 + more * near), np.float32)


def _near(size: int) -> Floats:
    """Nearness of samples to the ends of an axis, float32 [size] in 0..1."""
    ring = max(min(RING, size / 8), 1)
    place = np.arange(size, dtype=np.float32)
    return np.clip(2 - np.minimum(place, size - 1 - place) / ring, 0, 1).astype(np.float32)


def _differences(samples: Floats) -> NDArray[np.float32]:
    """Squared differences of samples [H, W, 3] from the next ones, across and down: [H, W]."""
    total = np.zeros(samples.shape[:2], np.float32)
    total[:, :-1] += (np.diff(samples, axis=1) ** 2).mean(2)
    total[:-1] += (np.diff(samples, axis=0) ** 2).mean(2)
    return total
