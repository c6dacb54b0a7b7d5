"""Fit of a rival to a picture: Adam on random pixels, with cosine decay."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...encoder.yielding import torch
from ..measure import ms_ssim, psnr

Pixels = NDArray[np.uint8]

BATCH_SHARE, BATCH_LEAST, BATCH_MOST = 32, 512, 1 << 14
"""A batch has one of so many pixels of the picture, but at least and at most so many."""

CHUNK = 1 << 14
"""Pixels evaluated at a time."""

GAIN = 0.1
"""Gain in dB of twice as many steps below which a fit counts as converged."""


class Rival(torch.nn.Module):
    """A representation of a picture: a function from places to colours.

    Attributes:
        rate: Peak learning rate of Adam.
    """

    rate: float

    @property
    def parameters_used(self) -> int:
        """Number of parameters that are fitted."""
        return sum(p.numel() for p in self.parameters())

    def forward(self, place: torch.Tensor) -> torch.Tensor:
        """Colours float32 [N, 3] at places float32 [N, 2] (x, y), -1..1 from edge to edge."""
        raise NotImplementedError  # each rival has its own


Maker = Callable[[], Rival]


@dataclass(frozen=True)
class Fitted:
    """Result of a fit.

    Attributes:
        psnr: PSNR in dB of the picture rounded to 8 bits.
        ms_ssim: MS-SSIM of the same, 0..1.
        parameters: Number of parameters.
        steps: Number of optimizer steps.
        seconds: CPU seconds of the fit.
        shown: uint8 [H, W, 3] what it learned; None if it is only measured.
        converged: Whether half as many steps are worse by less than `GAIN`; None if unknown.
    """

    psnr: float
    ms_ssim: float
    parameters: int
    steps: int
    seconds: float
    shown: Pixels | None = None
    converged: bool | None = None


def fit(make: Maker, pixels: Pixels, steps: int, seed: int = 0) -> Fitted:
    """Fits a rival.

    Args:
        make: Makes the rival; its initial parameters are those of the global generator of torch.
        pixels: uint8 [H, W, 3] picture.
        steps: Number of optimizer steps.
        seed: Seed of initial parameters and batches.
    """
    rival, seconds = trained(make, pixels, steps, seed)
    shown = picture(rival, *pixels.shape[:2])
    count = rival.parameters_used
    quality = psnr(pixels, shown), ms_ssim(pixels, shown)
    return Fitted(*quality, count, steps, seconds, shown)


def trained(make: Maker, pixels: Pixels, steps: int, seed: int = 0) -> tuple[Rival, float]:
    """Fits a rival as `fit` does, and returns it with the CPU seconds that it took."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        started = time.process_time()
        rival = make()
        place = places(*pixels.shape[:2])
        target = torch.from_numpy(pixels.reshape(-1, 3) / np.float32(255))
        learned = [p for p in rival.parameters() if p.requires_grad]
        adam = torch.optim.Adam(learned, lr=rival.rate, betas=(0.9, 0.99))
        batch = min(max(len(place) // BATCH_SHARE, BATCH_LEAST), BATCH_MOST, len(place))
        order = torch.empty(0, dtype=torch.long)
        for step in range(steps):
            if len(order) < batch:
                order = torch.randperm(len(place))
            chosen, order = order[:batch], order[batch:]
            adam.param_groups[0]["lr"] = rival.rate * (0.5 + 0.5 * math.cos(math.pi * step / steps))
            loss = ((rival(place[chosen]) - target[chosen]) ** 2).mean()
            adam.zero_grad(set_to_none=True)
            loss.backward()
            adam.step()
        seconds = time.process_time() - started
    return rival, seconds


def fit_converged(make: Maker, pixels: Pixels, first: int, most: int) -> Fitted:
    """Fits a rival with twice as many steps as before, until that gains less than `GAIN`.

    Args:
        make: Makes the rival.
        pixels: uint8 [H, W, 3] picture.
        first: Steps of the first fit.
        most: Most steps; a fit that still gains there says that it has not converged.
    """
    found, gain = fit(make, pixels, first), math.inf
    while gain >= GAIN and 2 * found.steps <= most:
        more = fit(make, pixels, 2 * found.steps)
        gain = more.psnr - found.psnr
        found = more if gain > 0 else found
    return replace(found, converged=gain < GAIN)


def fit_for(make: Maker, pixels: Pixels, seconds: float, probe: int = 20) -> Fitted:
    """Fits a rival for about so many CPU seconds; `probe` steps tell what a step costs."""
    spent = max(fit(make, pixels, probe).seconds, 1e-6)
    return fit(make, pixels, max(round(probe * seconds / spent), 1))


def places(height: int, width: int) -> torch.Tensor:
    """Places float32 [height * width, 2] of pixel centres, row by row, -1..1 from edge to edge."""
    y, x = ((torch.arange(n) + 0.5) / n * 2 - 1 for n in (height, width))
    return torch.stack(torch.meshgrid(x, y, indexing="xy"), -1).reshape(-1, 2)


def picture(rival: Rival, height: int, width: int) -> Pixels:
    """Draws what a rival has learned, at any size, as uint8 [height, width, 3]."""
    with torch.no_grad():
        at = places(height, width)
        parts = [rival(at[i : i + CHUNK]) for i in range(0, len(at), CHUNK)]
    colours = torch.cat(parts).clamp(0, 1).numpy().reshape(height, width, 3)
    return np.asarray(np.rint(colours * 255), np.uint8)
