"""Background completion by optimization: the paper's alternative to diffusing hidden codes.

Hidden codes of the back layer are interpolated from a small grid of max(8, W / DELTA) columns and
max(8, H / DELTA) rows, which is fitted so that the decoded colours vary little: a total-variation
term of weight GAMMA, BETA times stronger on the rims of what hides the layer (ProxyImg, background
completion; rim = dilated xor eroded hidden region). The network and visible codes stay fixed.
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
"""Weight of the total variation, and its factor on rims (ProxyImg). Here nothing else is optimized
with it, so that GAMMA itself hardly matters."""

DELTA = 64
"""Canvas pixels a cell of the small grid; the paper leaves it open."""

RIM = 3
"""Half width of a rim in pixels."""

STEPS, BATCH, RATE = 300, 2048, 1e-2


def complete(
    problem: Problem, state: State, stored: NDArray[np.bool_], settings: Settings
) -> NDArray[np.bool_]:
    """Sets the hidden codes of the back layer in `state`; returns its new mask of stored codes.

    Args:
        problem: Its plane 0 is the back layer, covering the canvas.
        state: Fitted and with quantization steps.
        stored: bool [rows, columns] codes of the back layer that visible pixels touch.
        settings: For the seed.

    Raises:
        UnsupportedError: torch is not installed.
    """
    if stored.all():
        return stored
    try:
        import torch
    except ImportError:
        raise UnsupportedError("--background complete needs torch") from None
    torch.set_num_threads(1)  # sums, and so the file, would depend on the number of threads
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
    """Codes of the back layer: visible ones stay, hidden ones come from a small grid.

    Attributes:
        small: float32 [1, D, h, w] the small grid, which starts as the diffused codes.
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
        """Codes [rows * columns, D]; hidden ones are rounded, straight through."""
        import torch

        full = _resized(self.small, self._size)
        rows = full[0].permute(1, 2, 0).reshape(-1, len(self._step))
        top = (1 << (self._bits - 1)) - 1
        rounded = torch.clamp(torch.round(rows / self._step), -top - 1, top) * self._step
        return torch.where(self._hidden, rows + (rounded - rows).detach(), self._visible)


def _resized(grid: torch.Tensor, size: tuple[int, ...]) -> torch.Tensor:
    """A grid [1, D, h, w] of another size, interpolated."""
    import torch

    return torch.nn.functional.interpolate(grid, size, mode="bilinear", align_corners=True)


def _network(problem: Problem, state: State) -> list[torch.Tensor]:
    """Weights [out, in], as they will be stored, and biases [out] of each linear layer in turn."""
    import torch

    ends = np.cumsum([outputs for _, outputs in problem.shape.layers])[:-1]
    steps = np.split(state.row_steps, ends)
    return [
        torch.from_numpy(a)
        for (w, b), s in zip(rows_of(problem.shape, state.weights), steps, strict=True)
        for a in (quantize(w, s[:, None], state.net_bits) * s[:, None], b)
    ]


def _hidden_pixels(plane: Plane, stored: NDArray[np.bool_]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pixels (y, x) [N, 2] that touch hidden codes, and their weights."""
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
    """Weighted mean absolute difference of colour between pixels and their neighbours."""
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
