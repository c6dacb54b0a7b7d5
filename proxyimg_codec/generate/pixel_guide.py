"""Score distillation with denoisers that work on pixels."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from ..errors import UsageError
from .denoiser import load
from .guide import Batch, Judged, Wishes, device_of
from .precision import TYPES, Careful

GUIDANCE = 15.0
"""Guidance where the settings have none."""

Predict = Callable[[Tensor, Tensor, bool], Tensor]
"""Function from noisy pictures [B, 3, S, S] of values in about -1..1, times [B] in 0..1 and whether
the prompt counts, to the noise [B, 3, S, S] that it finds in them."""


def angles(times: Tensor) -> tuple[Tensor, Tensor]:
    """Shares [B, 1, 1, 1] of picture and noise at times [B]: cosine and sine."""
    angle = times[:, None, None, None] * (math.pi / 2)
    return angle.cos(), angle.sin()


class PixelGuide:
    """Score distillation (Poole 2022, "DreamFusion", equation 3) in pixel space.

    The gradient is w(t) (e'(x_t, prompt, t) - e), where e is the noise in x_t and e' what the
    denoiser takes for it, with guidance; the derivative of the denoiser is left out.

    Args:
        predict: The denoiser.
        side: Rows and columns of its pictures.
        guidance: Factor of the difference that the prompt makes.
        weighting: ``sds`` or ``uniform``.
        careful: What the denoiser is run by; by default its results only have to be finite.

    Attributes:
        side: Rows and columns of its pictures.
    """

    def __init__(
        self, predict: Predict, side: int, guidance: float = GUIDANCE, weighting: str = "sds",
        careful: Careful | None = None,
    ) -> None:  # fmt: skip
        self.side, self._predict = side, predict
        self._guidance, self._weighting = guidance, weighting
        self._careful = careful or Careful((), torch.float32)

    @property
    def retries(self) -> int:
        """Number of times that half precision was not enough."""
        return self._careful.count

    def judge(self, batch: Batch) -> Judged:
        """Gradient of score distillation, and mean squared error of the noise with the prompt."""
        x = 2 * batch.images.detach() - 1
        noise = torch.randn(x.shape, generator=batch.random, dtype=x.dtype).to(x.device)
        cos, sin = angles(batch.times.to(x))
        noisy = cos * x + sin * noise

        @torch.no_grad()
        def attempt(kind: torch.dtype) -> tuple[Tensor, Tensor]:
            as_is = x.dtype == torch.float64
            y, t = (noisy, batch.times) if as_is else (noisy.to(kind), batch.times.to(kind))
            t = t.to(y.device)
            wanted = self._predict(y, t, True).to(x.dtype)
            if self._guidance == 1:
                return wanted, wanted
            return wanted, self._predict(y, t, False).to(x.dtype)

        wanted, plain = self._careful(attempt)
        found = plain + self._guidance * (wanted - plain)
        weight = sin**2 if self._weighting == "sds" else torch.ones_like(sin)
        # Pictures in 0..1 change half as much as those in -1..1.
        return Judged(2 * weight * (found - noise), ((wanted - noise) ** 2).mean((1, 2, 3)))


def denoiser_guide(path: Path, wishes: Wishes) -> PixelGuide:
    """Guide of a file of the small denoiser; prompts are names of its classes.

    Raises:
        UsageError: The prompt is none of its classes.
        InputError: The file is no denoiser.
        UnsupportedError: The device is not there.
    """
    settings = wishes.settings
    model = load(path).to(device_of(wishes.run))
    names = model.shape.classes

    def number(prompt: str) -> int:
        if prompt.strip().lower() not in names:
            raise UsageError(f"{path}: {prompt!r} is not one of its classes: {', '.join(names)}")
        return names.index(prompt.strip().lower())

    wanted = number(settings.prompt)
    other = number(settings.negative) if settings.negative.strip() else len(names)

    def predict(noisy: Tensor, times: Tensor, prompted: bool) -> Tensor:
        label = torch.full((len(noisy),), wanted if prompted else other, device=noisy.device)
        cos, sin = angles(times)
        return cos * model(noisy, times, label) + sin * noisy  # type: ignore[no-any-return] # untyped

    guidance = GUIDANCE if settings.guidance is None else settings.guidance
    careful = Careful([model], TYPES[settings.precision])
    return PixelGuide(predict, model.shape.side, guidance, settings.weighting, careful)
