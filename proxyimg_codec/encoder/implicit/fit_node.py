"""Fit with node sampling: floating-point parameters by torch, then rounding by blocks.

The paper does not describe its training in full. Here it is the same as for direct sampling: Adam
on random batches of pixels, through the compositing, with a warm-up and a cosine decay.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...texture import node_sampling
from . import fit
from .fit_torch import TorchTrainer, interpolate
from .node_problem import NodeProblem
from .rounding import Model, reconstruct
from .state import Progress, State, rows_of

INIT_CODES = 0.03
"""Standard deviation of initial codes."""

LR_CODES, LR_NET = 2e-3, 2e-3
"""Peak learning rates of codes and network."""

FLOAT_SHARE = 2 / 3
"""Share of the steps that fit floating-point parameters, before rounding."""

CALIBRATION = 1 << 14
"""Most entries that rounding is calibrated on."""


class NodeTrainer(TorchTrainer):
    """`Trainer` of a `NodeProblem`.

    Args:
        problem: The fitting problem.
        device: ``cpu`` or ``cuda``.

    Raises:
        UnsupportedError: torch is not installed, or finds no CUDA device.
    """

    def __init__(self, problem: NodeProblem, device: str) -> None:
        super().__init__(problem, device)
        self._layer = self.tensor(problem.layer)
        self._place = self.tensor(problem.place)
        self._corners = self.tensor(problem.corners)
        self._weights = self.tensor(problem.weights)
        self._anchors = [(first, self.tensor(at)) for first, at in problem.anchors]

    def features(self, codes: Any, entry: Any) -> Any:
        """Features [N, D] of the entries numbered `entry` [N], before the frequency encoding."""
        points = interpolate(codes, *self._taps)
        parts = []
        if self._corners.shape[1]:
            corners = points.index_select(0, self._corners[entry].reshape(-1))
            corners = corners.reshape(len(entry), 3, -1)
            parts.append((corners * self._weights[entry][:, :, None]).sum(1))
        if self._anchors:
            parts.append(self._global(points, self._layer[entry], self._place[entry]))
        return self._torch.cat(parts, 1)

    def _global(self, points: Any, layer: Any, place: Any) -> Any:
        torch = self._torch
        out = points.new_zeros((len(layer), points.shape[1]))
        for k, (first, anchors) in enumerate(self._anchors):
            at = torch.nonzero(layer == k)[:, 0]
            square = ((place[at, None] - anchors) ** 2).sum(2)
            weight = 1 / square.clamp(min=node_sampling.NEAR)
            weight = weight / weight.sum(1, keepdim=True)
            out = out.index_copy(0, at, weight @ points[first : first + len(anchors)])
        return out


def initial(problem: NodeProblem, seed: int) -> State:
    """Makes a state of random codes and weights; the output bias is the mean colour."""
    state = fit.initial(problem, seed)
    dim = problem.shape.dim // (bool(problem.anchors) + bool(problem.corners.shape[1]))
    scale = np.float32(INIT_CODES / fit.INIT_CODES)
    state.codes = np.ascontiguousarray(state.codes[:, :dim]) * scale
    state.code_steps = np.ones((len(problem.planes), dim), np.float32)
    return state


def fit_float(
    problem: NodeProblem,
    trainer: NodeTrainer,
    steps: int,
    seed: int,
    progress: Progress | None = None,
) -> State:
    """Fits unquantized parameters from a random start, by `steps` steps of the optimizer."""
    state = initial(problem, seed)
    fit.train(problem, state, trainer, steps, (LR_CODES, LR_NET), seed, progress)
    return state


def quantize(
    problem: NodeProblem,
    trainer: NodeTrainer,
    state: State,
    bits: tuple[int, int],
    steps: int,
    seed: int,
    progress: Progress | None = None,
) -> None:
    """Quantizes a fitted state, in place.

    Args:
        problem: Problem that the state was fitted to.
        trainer: Trainer of the problem.
        state: The state. Its steps are chosen, and codes and weights become multiples of them.
        bits: Bits per code and per weight.
        steps: Optimizer steps of the block reconstruction.
        seed: Seed of all random numbers.
        progress: Called with a number of steps that were done.
    """
    fit.choose_steps(problem, state, *bits)
    plane = np.repeat(np.arange(len(problem.planes)), [p.size for p in problem.planes])
    rows = rows_of(problem.shape, state.weights)
    flat = [a for pair in rows for a in pair]
    ends = np.cumsum([o for _, o in problem.shape.layers])[:-1]
    model = Model(
        trainer.tensor(state.codes),
        trainer.tensor(state.code_steps[plane]),
        [trainer.tensor(a) for a in flat],
        [trainer.tensor(s[:, None]) for s in np.split(state.row_steps, ends)],
        problem.shape.octaves,
    )
    entries = np.random.default_rng([seed, 2]).permutation(np.flatnonzero(problem.learn > 0))
    chosen = trainer.tensor(np.sort(entries[:CALIBRATION]))
    codes, net = reconstruct(
        model, lambda c, at: trainer.features(c, chosen[at]), len(chosen), bits, steps, seed,
        progress,
    )  # fmt: skip
    for array, tensor in zip((state.codes, *flat), (codes, *net), strict=True):
        array[...] = tensor.cpu().numpy()


def fit_quantized(
    problem: NodeProblem,
    steps: int,
    code_bits: int,
    net_bits: int,
    seed: int,
    device: str = "cpu",
    progress: Progress | None = None,
) -> State:
    """Fits floating-point parameters, then rounds them; like `fit.fit` for direct sampling.

    Args:
        problem: The fitting problem.
        steps: Number of optimizer steps.
        code_bits: Bits per code.
        net_bits: Bits per weight.
        seed: Seed of all random numbers.
        device: ``cpu`` or ``cuda``.
        progress: Called with a number of steps that were done.

    Raises:
        UnsupportedError: torch is not installed, or finds no CUDA device.
    """
    trainer = NodeTrainer(problem, device)
    first = round(FLOAT_SHARE * steps)
    state = fit_float(problem, trainer, first, seed, progress)
    quantize(problem, trainer, state, (code_bits, net_bits), steps - first, seed, progress)
    return state
