"""Guides: what says how a picture should change so that it shows the words of a prompt.

A guide is a plug-in (`plugins`, kind `guides`): a function from `Wishes` to a `Guide`. Those of
this package are chosen by what a path holds (`find_guide`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from ..errors import UnsupportedError, UsageError
from .run import Run
from .settings import Settings

INDEX = "model_index.json"
"""The file that tells a folder of a pipeline from others."""


class Batch(NamedTuple):
    """Pictures that a guide judges.

    Attributes:
        images: [B, 3, S, S] pictures in 0..1.
        times: [B] shares of the timesteps, 0 is without noise, 1 nothing but noise.
        shown: [B, 1, S, S] how much of each sample is the texture, 0..1; the rest is around it.
        random: Generator, on the CPU, of all noise.
    """

    images: Tensor
    times: Tensor
    shown: Tensor
    random: torch.Generator


class Judged(NamedTuple):
    """Judgement of a guide.

    Attributes:
        gradient: [B, 3, S, S] gradient that lowers the loss when it is subtracted from images.
        loss: [B] how far the pictures are from what is wanted.
    """

    gradient: Tensor
    loss: Tensor


class Guide(Protocol):
    """Judge of pictures."""

    @property
    def side(self) -> int:
        """Rows and columns of the pictures that it is best at."""

    @property
    def retries(self) -> int:
        """Number of times that half precision was not enough, and full precision was used."""

    def judge(self, batch: Batch) -> Judged:
        """Judges pictures at timesteps."""


@dataclass(frozen=True)
class Wishes:
    """Purpose of a guide.

    Attributes:
        settings: Settings of the texture.
        run: Where it is computed.
    """

    settings: Settings
    run: Run


def device_of(run: Run) -> torch.device:
    """Device of a run.

    Raises:
        UsageError: There is no such kind of device.
        UnsupportedError: There is none of this kind.
    """
    if run.device not in ("cpu", "cuda"):
        raise UsageError(f"generate: device {run.device!r} is not cpu or cuda")
    if run.device == "cuda" and not torch.cuda.is_available():
        raise UnsupportedError("device cuda: torch finds no CUDA device; use --device cpu")
    return torch.device(run.device)
