"""Completion of the back layer by optimization: the paper's alternative to diffusion.

Hidden codes of the back layer are interpolated from a small grid of max(8, W / DELTA) columns and
max(8, H / DELTA) rows. The grid is fitted so that the decoded colours vary little, by a
total-variation term of weight GAMMA, which is BETA times stronger on the rims of the objects that
hide the layer (ProxyImg, background completion; rim = dilated xor eroded hidden region). The
network and visible codes stay fixed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import UnsupportedError
from ...texture.diffusion import FRACTION_BITS, fill
from ...texture.implicit import taps
from ..implicit.fit_problem import Plane, Problem
from ..implicit.state import State, quantize, rows_of
from ..settings import Settings

if TYPE_CHECKING:
    import torch

GAMMA, BETA = 1e-3, 10.0
"""Weight of the total variation, and its factor on rims (ProxyImg). GAMMA itself hardly matters
here, because nothing else is optimized together with this term."""

DELTA = 64
"""Side of a cell of the small grid in canvas pixels; the paper does not say it."""

RIM = 3
"""Half the width of a rim in pixels."""

STEPS, BATCH, RATE = 300, 2048, 1e-2
"""Optimizer steps, pixels per step, and learning rate."""


def complete(
    problem: Problem, state: State, stored: NDArray[np.bool_], settings: Settings
) -> NDArray[np.bool_]:
    """Optimizes the hidden codes of the back layer, in place.

    Args:
        problem: Fitting problem whose first plane is that of the back layer and covers the canvas.
        state: Fitted state with quantization steps; its codes are changed.
        stored: bool [rows, columns], True at codes of the back layer that visible pixels depend on.
        settings: Settings of the encoder, for the seed.

    Returns:
        bool [rows, columns], True at codes of the back layer that the file has to store: all.

    Raises:
        UnsupportedError: torch is not installed.
    """
    if stored.all():
        return stored
    try:
        from ..yielding import torch
    except ImportError:
        raise UnsupportedError("--background complete needs torch") from None
    plane = problem.planes[0]
    codes = _Codes(plane, state, stored)
    pixels, weight = _hidden_pixels(plane, stored)
    net = _network(problem, state)
    adam = torch.optim.Adam([codes.small], lr=RATE)
    rng = np.random.default_rng([settings.seed, 2])
    for _ in range(STEPS):
        at = rng.integers(len(pixels), size=BATCH)
        loss = GAMMA * _variation(
            codes.all(), net, plane, pixels[at], weight[at], problem.shape.octaves
        )
        adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]  # untyped in torch's stubs
        adam.step()
    with torch.no_grad():
        state.codes[: plane.size] = codes.all().numpy()
    return np.ones_like(stored)


class _Codes:
    """Codes of the back layer: visible ones stay, hidden ones are interpolated from a small grid.

    Attributes:
        small: float32 [1, D, h, w] small grid, which starts as the diffused codes.
    """

    def __init__(self, plane: Plane, state: State, stored: NDArray[np.bool_]) -> None:
        import torch

        self._size, self._bits = (plane.rows, plane.columns), state.code_bits
        self._visible = torch.from_numpy(state.codes[: plane.size].copy())
        self._step = torch.from_numpy(state.code_steps[0])
        self._hidden = torch.from_numpy(~stored.ravel())[:, None]
        known = quantize(self._visible.numpy(), state.code_steps[0], self._bits)
        full = fill(known.T.reshape(-1, *self._size), stored) / (1 << FRACTION_BITS)
        size = tuple(max(8, n // DELTA) for n in plane.box[:1:-1])
        self.small = _resized(torch.from_numpy(full.astype(np.float32))[None], size)
        self.small = (self.small * self._step[None, :, None, None]).requires_grad_()

    def all(self) -> torch.Tensor:
        """Codes float32 [rows * columns, D]; hidden ones are rounded, straight through."""
        import torch

        full = _resized(self.small, self._size)
        rows = full[0].permute(1, 2, 0).reshape(-1, len(self._step))
        top = (1 << (self._bits - 1)) - 1
        rounded = torch.clamp(torch.round(rows / self._step), -top - 1, top) * self._step
        return torch.where(self._hidden, rows + (rounded - rows).detach(), self._visible)


def _resized(grid: torch.Tensor, size: tuple[int, ...]) -> torch.Tensor:
    """Interpolates a grid [1, D, h, w] bilinearly to another height and width."""
    import torch

    return torch.nn.functional.interpolate(grid, size, mode="bilinear", align_corners=True)


def _network(problem: Problem, state: State) -> list[torch.Tensor]:
    """Weights [out, in], as the file will have them, and biases [out] of each layer in turn."""
    import torch

    ends = np.cumsum([outputs for _, outputs in problem.shape.layers])[:-1]
    steps = np.split(state.row_steps, ends)
    return [
        torch.from_numpy(a)
        for (w, b), s in zip(rows_of(problem.shape, state.weights), steps, strict=True)
        for a in (quantize(w, s[:, None], state.net_bits) * s[:, None], b)
    ]


def _hidden_pixels(plane: Plane, stored: NDArray[np.bool_]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pixels near hidden codes.

    Returns:
        int64 [N, 2] y and x of the pixels, and float32 [N] weights of their variation.
    """
    width, height = plane.box[2:]
    size = (width, height)
    unknown = cv2.resize((~stored).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    kernel = np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)
    wide, narrow = cv2.dilate(unknown, kernel), cv2.erode(unknown, kernel)
    pixels = np.argwhere(wide > 0)
    rim = (wide != narrow)[wide > 0]
    return pixels, np.where(rim, BETA, 1.0).astype(np.float32)


def _variation(
    codes: torch.Tensor,
    net: list[torch.Tensor],
    plane: Plane,
    pixels: NDArray[Any],
    weight: NDArray[Any],
    octaves: int,
) -> torch.Tensor:
    """Weighted mean absolute difference of colour between pixels and their neighbours.

    Args:
        codes: float32 [rows * columns, D] codes of the plane.
        net: Weights and biases of the network in turn.
        plane: Plane of the back layer.
        pixels: int64 [N, 2] y and x of pixels; the neighbours lie to the right and below.
        weight: float32 [N] weights of the pixels.
        octaves: Octaves of the frequency encoding.
    """
    import torch

    from ..implicit.fit_torch import interpolate, run_network

    colours = []
    for dy, dx in ((0, 0), (0, 1), (1, 0)):
        t = taps(
            pixels[:, 1] + dx + 0.5, pixels[:, 0] + dy + 0.5, plane.box, plane.columns, plane.rows
        )
        base, fx, fy = (torch.from_numpy(a) for a in (t.base, t.fx, t.fy))
        colours.append(run_network(interpolate(codes, base, t.stride, fx, fy), net, octaves))
    here, right, below = colours
    change = ((right - here).abs() + (below - here).abs()).mean(1)
    result: torch.Tensor = (torch.from_numpy(weight) * change).mean()
    return result
