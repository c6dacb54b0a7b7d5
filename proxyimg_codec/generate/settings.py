"""Settings of a generated texture, as plain data."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass

from ..errors import UsageError

WEIGHTINGS = ("sds", "uniform")
PRECISIONS = ("full", "half", "bfloat")
STEPS_MAX, SIDE_MAX = 100_000, 4096


@dataclass(frozen=True)
class Settings:
    """Settings of a generated texture.

    Attributes:
        prompt: What the texture should show; only pictures as guides need none.
        guide: Folder or file of a model, or a picture, or the name of a plug-in of the kind
            `guides`.
        negative: What it should not show.
        guidance: How many times the difference that the prompt makes counts (Ho and Salimans 2022,
            classifier-free guidance); None = as the guide likes it.
        steps: Steps of the optimizer.
        seed: Seed of all random numbers, 0..2**32 - 1.
        resolution: Rows and columns of what the guide sees; None = as it likes it.
        times: Least and greatest share of the timesteps, within 0..1.
        weighting: Weight of timesteps: ``sds`` is the variance of their noise (Poole 2022, "Text-
            to-3D using 2D Diffusion"), ``uniform`` is 1.
        clip: Greatest norm of the gradient of a picture, divided by the root of its number of
            samples; None = not limited.
        precision: Numbers that the guide computes with: ``full``, ``half`` or ``bfloat``.
        keep_structure: How strongly the edges of the old texture stay; 0 = not at all.
        effort: How hard the encoder tries with the result, 1..9.

    Raises:
        UsageError: A setting has a wrong type or is out of range.
    """

    prompt: str
    guide: str
    negative: str = ""
    guidance: float | None = None
    steps: int = 400
    seed: int = 0
    resolution: int | None = None
    times: tuple[float, float] = (0.02, 0.98)
    weighting: str = "sds"
    clip: float | None = None
    precision: str = "full"
    keep_structure: float = 0.0
    effort: int = 2

    def __post_init__(self) -> None:
        try:
            for name in ("steps", "seed", "effort", "resolution"):
                value = getattr(self, name)
                if value is not None:
                    object.__setattr__(self, name, operator.index(value))
            for name in ("guidance", "clip", "keep_structure"):
                if getattr(self, name) is not None:
                    object.__setattr__(self, name, float(getattr(self, name)))
            low, high = (float(v) for v in self.times)
            object.__setattr__(self, "times", (low, high))
        except (TypeError, ValueError):
            raise UsageError("generate: numeric settings must be numbers") from None
        clip, guidance, side = self.clip, self.guidance, self.resolution
        checks = [
            (bool(self.guide) and "\0" not in self.guide, "guide", "a path or a name"),
            (guidance is None or 0 <= guidance <= 1000, "guidance", "0..1000"),
            (1 <= self.steps <= STEPS_MAX, "steps", f"1..{STEPS_MAX}"),
            (0 <= self.seed < 1 << 32, "seed", "0..2^32-1"),
            (side is None or 8 <= side <= SIDE_MAX, "resolution", f"8..{SIDE_MAX}"),
            (0 <= low < high <= 1, "times", "two ascending numbers within 0 and 1"),
            (self.weighting in WEIGHTINGS, "weighting", " or ".join(WEIGHTINGS)),
            (clip is None or 0 < clip < math.inf, "clip", "more than 0"),
            (self.precision in PRECISIONS, "precision", " or ".join(PRECISIONS)),
            (0 <= self.keep_structure <= 1000, "keep_structure", "0..1000"),
            (1 <= self.effort <= 9, "effort", "1..9"),
        ]
        for good, name, range_ in checks:
            if not good:
                raise UsageError(f"generate: {name} is {getattr(self, name)}, but must be {range_}")
