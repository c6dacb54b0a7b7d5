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
    pixels, weight = _hidden_pixels(plane, stored)
    table = torch.from_numpy(state.codes[: plane.size].copy())
    step = torch.from_numpy(state.code_steps[0])
    hidden = torch.from_numpy(~stored.ravel())
    start = fill(quantize(table.numpy(), state.code_steps[0], state.code_bits).T.reshape(
        -1, plane.rows, plane.columns), stored)  # fmt: skip
    size = tuple(max(8, n // DELTA) for n in plane.box[:1:-1])
    small = _small_grid(start / (1 << FRACTION_BITS), size) * step[None, :, None, None]
    small.requires_grad_()
    adam = torch.optim.Adam([small], lr=RATE)
    net = [
        torch.from_numpy(a)
        for (w, b), s in zip(
            rows_of(problem.shape, state.weights),
            np.split(state.row_steps, np.cumsum([o for _, o in problem.shape.layers])[:-1]),
            strict=True,
        )
        for a in (quantize(w, s[:, None], state.net_bits) * s[:, None], b)
    ]
    rng = np.random.default_rng([settings.seed, 2])
    for _ in range(STEPS):
        at = rng.integers(len(pixels), size=BATCH)
        codes = _with_hidden(table, hidden, small, plane, step, state.code_bits)
        loss = GAMMA * _variation(codes, net, plane, pixels[at], weight[at], problem.shape.octaves)
        adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]  # untyped in torch's stubs
        adam.step()
    with torch.no_grad():
        codes = _with_hidden(table, hidden, small, plane, step, state.code_bits)
    state.codes[: plane.size] = codes.numpy()
    return np.ones_like(stored)


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


def _small_grid(codes: NDArray[np.float64], size: tuple[int, ...]) -> torch.Tensor:
    """[1, D, *size]: the diffused codes, reduced, as a start."""
    import torch

    full = torch.from_numpy(codes.astype(np.float32))[None]
    return torch.nn.functional.interpolate(full, size, mode="bilinear", align_corners=True)


def _with_hidden(
    table: torch.Tensor,
    hidden: torch.Tensor,
    small: torch.Tensor,
    plane: Plane,
    step: torch.Tensor,
    bits: int,
) -> torch.Tensor:
    """The table with hidden rows taken from the small grid, rounded (straight-through)."""
    import torch

    size = (plane.rows, plane.columns)
    full = torch.nn.functional.interpolate(small, size, mode="bilinear", align_corners=True)
    rows = full[0].permute(1, 2, 0).reshape(-1, len(step))
    top = (1 << (bits - 1)) - 1
    rounded = torch.clamp(torch.round(rows / step), -top - 1, top) * step
    return torch.where(hidden[:, None], rows + (rounded - rows).detach(), table)


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
