"""Trial of a model on a small picture: what it is, and whether it works."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..onnx_model import load
from .catalogue import DEPTH, FIGURES, INPAINTING, SAM
from .depth import depth_map
from .figure import figure_map
from .inpainting import inpainted
from .kinds import Kind, kind_of, tensors
from .locate import load_pair
from .sam import INSIDE, see

HEIGHT, WIDTH = 72, 96
"""Size of the picture, in pixels: a red disc before a grey slope."""


@dataclass(frozen=True)
class Trial:
    """Result of a trial.

    Attributes:
        kind: What the model is, in words.
        purpose: What it is for: ``sam``, ``saliency``, ``depth`` or ``inpainting``.
        tensors: Inputs and outputs of its files, in words.
        result: What it found, in words.
        seconds: Time that it took.
    """

    kind: str
    purpose: str
    tensors: list[str]
    result: str
    seconds: float


def picture() -> NDArray[np.uint8]:
    """Picture of the trial, uint8 [HEIGHT, WIDTH, 3]."""
    slope = np.linspace(90, 200, WIDTH).astype(np.uint8)
    rgb = np.repeat(np.tile(slope, (HEIGHT, 1))[..., None], 3, 2)
    cv2.circle(rgb, (WIDTH // 2, HEIGHT // 2), HEIGHT // 4, (210, 40, 40), -1)
    return rgb


def tried(paths: list[Path], jobs: int = 1) -> Trial:
    """Runs a model on a small picture.

    Args:
        paths: Its files; of a SAM both, or one with the other beside it.
        jobs: Threads to use.

    Raises:
        InputError: A file is no model of a known kind, or does not run.
        LimitError: There is not enough memory.
    """
    rgb = picture()
    model = load(paths[0], jobs)
    kind = kind_of(model)
    started = time.perf_counter()
    if kind in (Kind.U2NET, Kind.ISNET):
        purpose, parts = FIGURES, [model]
        found = figure_map(model, rgb)
        result = f"figure scores from {found.min():.2f} to {found.max():.2f}"
    elif kind is Kind.DEPTH:
        purpose, parts = DEPTH, [model]
        found = depth_map(model, rgb)
        result = f"nearness from {found.min():.3g} to {found.max():.3g}"
    elif kind is Kind.INPAINTING:
        purpose, parts = INPAINTING, [model]
        hole = cv2.dilate(rgb[..., 0] - rgb[..., 1], np.ones((5, 5), np.uint8)) > 0
        filled = inpainted(model, rgb.astype(np.float32) / np.float32(255), hole)[hole]
        red, green, blue = (round(255 * float(v)) for v in filled.mean(0))
        result = f"a hole filled with {red}, {green}, {blue} on average"
    else:
        encoder, decoder = load_pair(paths, jobs)
        purpose, parts = SAM, [m for m in (encoder, decoder) if m is not None]
        view = see(encoder, decoder, rgb)
        drawn, quality = view.masks([(WIDTH / 2, HEIGHT / 2)], [INSIDE])
        share = 100 * float((drawn[int(quality.argmax())] > 0).mean())
        result = f"a mask of {share:.0f} % of the picture, expected IoU {quality.max():.2f}"
    seconds = time.perf_counter() - started
    names = " + ".join(kind_of(m).value for m in parts)
    return Trial(names, purpose, [f"{m.name}: {tensors(m)}" for m in parts], result, seconds)
