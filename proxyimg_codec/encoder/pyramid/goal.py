"""Goal of the refinement of latents in a window: what they should show, and what binds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats

LEVELS = 6
"""Most levels of a pyramid that is encoded."""

RATE_WEIGHT = 0.15
"""Squared error, in squares of the quantization step, that a bit is worth.

High-rate theory gives 2 ln 2 / 12 = 0.116 for uniform quantization. Here latents are chosen by
their cost, so a finer step with dearer bits is better.
"""

DEAD_ZONE = 0.2
"""Distance by which latents of the analysis are moved towards zero before refinement."""

FIRST_SHARE, RAMP = 0.55, 6
"""Share of the best gain around a latent that its own move has to gain, in the first round; it
rises to 1 in so many rounds."""

SURE = 4
"""First round that may fail to lower the cost; after those before, it is not computed."""

LEAST_GAIN, HESITATION = 1e-3, 0.05
"""Least gain of a move, in squares of the step, and of a move that takes back the last one."""


class Effort(NamedTuple):
    """Duration of refinement.

    Attributes:
        steps: Steps with stochastic rounding, which aim at MS-SSIM.
        rounds: Rounds of moves by one, which aim at the squared error.
    """

    steps: int
    rounds: int

    def turns(self, structural: bool) -> int:
        """Number of steps or rounds."""
        return self.steps if structural else self.rounds


class Goal(NamedTuple):
    """Goal of refinement.

    Attributes:
        picture: float32 [3, H, W] samples in 0..255.
        weight: float32 [H, W] weights of the squared errors of samples; None = 1.
        support: For each level, then for the lowest planes, a float32 mask of the shape of its
            latents, 0 for those that must be 0, else 1; None = all 1.
        free: For each level, then for the lowest planes, a bool mask of the latents that may
            change; None = all.
        step: Index s of the quantization step 2**(s / 64).
        shifts: Shifts of the scale index for luma and chroma of level 1, then of level 2, and so
            on.
        model: Number of the registered model.
        price: Error that a bit is worth, in squares of the step.
        structural: Whether to aim at MS-SSIM instead of the squared error.
        done: Rounds of moves that were made before.
    """

    picture: Floats
    weight: Floats | None
    support: Sequence[Floats] | None
    free: Sequence[NDArray[np.bool_]] | None
    step: int
    shifts: Sequence[int]
    model: int
    price: float = RATE_WEIGHT
    structural: bool = False
    done: int = 0

    def held(self, latents: Sequence[Floats], fixed: Sequence[Floats]) -> list[Floats]:
        """Replaces latents that may not change by those in `fixed`, those without support by 0."""
        out = list(latents)
        if self.free is not None:
            out = [np.where(m, y, f) for y, f, m in zip(out, fixed, self.free, strict=True)]
        if self.support is not None:
            out = [y * mask for y, mask in zip(out, self.support, strict=True)]
        return out


def shrink(latents: Sequence[Floats], by: float) -> None:
    """Moves latents towards zero by at most `by`, in place; the lowest planes, the last, stay."""
    for y in latents[:-1]:
        y -= np.clip(y, -by, by)
