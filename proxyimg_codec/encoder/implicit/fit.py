"""Fitting codes and network to the pixels: float, then with quantization in the loop.

Optimization is Adam on random pixel batches, through the compositing, with a warm-up and a cosine
decay. Batches grow with the picture, so that the number of steps does not, and cost a pixel is
constant. The second half trains through rounding (straight-through estimator; Bengio 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats, NetShape
from .fit_problem import Problem

LR_CODES, LR_NET = 1.2e-2, 8e-3
"""Peak learning rates of the float phase."""

QAT_LR_CODES, QAT_LR_NET = 1.2e-2, 6e-3
"""Peak learning rates with quantization in the loop."""

STEP_SCALE = 0.7
"""Code steps below the least-squares step: finer steps gain more than clipping costs."""

INIT_CODES = 0.01
"""Standard deviation of initial codes."""

Progress = Callable[[int], None]


@dataclass(eq=False)
class State:
    """Parameters and what quantization needs.

    Attributes:
        codes: float32 [rows, D].
        weights: float32 [parameters], per layer [out][in] rows and then the biases.
        code_steps: float32 [planes, D]; used with `code_bits` > 0.
        row_steps: float32 [rows of the network].
        code_bits: 0 = not quantized.
        net_bits: Bits a weight.
    """

    codes: Floats
    weights: Floats
    code_steps: Floats
    row_steps: Floats
    code_bits: int = 0
    net_bits: int = 0


class Trainer(Protocol):
    """Runs optimizer steps on a state; keeps Adam moments between calls."""

    def run(
        self, state: State, pixels: NDArray[np.int32], lr_codes: Floats, lr_net: Floats
    ) -> float:
        """Steps with batches `pixels` [steps, batch]; returns the mean loss."""


def initial(problem: Problem, seed: int) -> State:
    """Random codes and weights; the output bias is the mean colour."""
    rng = np.random.default_rng(seed)
    shape = problem.shape
    codes = rng.standard_normal((problem.codes, shape.dim)).astype(np.float32) * INIT_CODES
    parts = []
    for i, (inputs, outputs) in enumerate(shape.layers):
        bound = 1 / math.sqrt(inputs)
        last = i + 1 == len(shape.layers)
        bias = problem.target.mean(0) if last else np.zeros(outputs)
        parts += [rng.uniform(-bound, bound, inputs * outputs), bias]
    return State(
        codes.astype(np.float32),
        np.concatenate(parts).astype(np.float32),
        np.ones((len(problem.planes), shape.dim), np.float32),
        np.ones(shape.rows, np.float32),
    )


def batch_size(pixels: int) -> int:
    """Pixels a step: 1/128 of the picture, at least 256, in whole blocks of 256."""
    return 256 * max(round(pixels / 128 / 256), 1)


def _schedule(steps: int) -> NDArray[np.float64]:
    t = np.arange(steps)
    return np.minimum(1, (t + 1) / (0.02 * steps + 1)) * (0.5 + 0.5 * np.cos(np.pi * t / steps))


def train(
    problem: Problem,
    state: State,
    trainer: Trainer,
    steps: int,
    rates: tuple[float, float],
    seed: int,
    progress: Progress | None = None,
) -> None:
    """Optimizes `state` in place; batches are permutations of the pixels, epoch after epoch."""
    rng = np.random.default_rng([seed, state.code_bits])
    batch = batch_size(problem.pixels)
    decay = _schedule(steps)
    queue = np.zeros(0, np.int32)
    for start in range(0, steps, 50):
        count = min(50, steps - start)
        while len(queue) < count * batch:
            queue = np.concatenate([queue, rng.permutation(problem.pixels).astype(np.int32)])
        pixels, queue = queue[: count * batch].reshape(count, batch), queue[count * batch :]
        pixels.sort(axis=1)  # neighbours together: the trainer touches memory in order
        part = decay[start : start + count]
        trainer.run(
            state,
            np.ascontiguousarray(pixels),
            (rates[0] * part).astype(np.float32),
            (rates[1] * part).astype(np.float32),
        )
        if progress:
            progress(count)


def rows_of(shape: NetShape, flat: Floats) -> list[tuple[Floats, Floats]]:
    """Views (weights [out, in], biases [out]) of each layer in flat parameters."""
    out, at = [], 0
    for inputs, outputs in shape.layers:
        middle = at + inputs * outputs
        out.append((flat[at:middle].reshape(outputs, inputs), flat[middle : middle + outputs]))
        at = middle + outputs
    return out


def choose_steps(problem: Problem, state: State, code_bits: int, net_bits: int) -> None:
    """Sets quantization steps, rounded to float16, by least squares on the present parameters."""
    state.code_bits, state.net_bits = code_bits, net_bits
    for k, (plane, stored) in enumerate(zip(problem.planes, problem.stored(), strict=True)):
        codes = state.codes[plane.start : plane.start + plane.size][stored.ravel()]
        state.code_steps[k] = STEP_SCALE * best_steps(codes.T, code_bits)
    rows = [best_steps(w, net_bits) for w, _ in rows_of(problem.shape, state.weights)]
    state.row_steps[:] = np.concatenate(rows)
    for steps in (state.code_steps, state.row_steps):
        steps[:] = np.maximum(steps.astype(np.float16), np.finfo(np.float16).tiny)


def best_steps(values: Floats, bits: int) -> Floats:
    """Step [N] that minimizes the squared rounding error of each row of `values` [N, M]."""
    top = (1 << (bits - 1)) - 1
    peak = np.abs(values).max(1, initial=0) + 1e-6
    best, error = peak / max(top, 1), np.full(len(values), np.inf)
    for fraction in np.linspace(0.3, 1, 15):
        step = fraction * peak / max(top, 1)
        rounded = np.clip(np.rint(values / step[:, None]), -top - 1, top) * step[:, None]
        e = ((rounded - values) ** 2).sum(1)
        best, error = np.where(e < error, step, best), np.minimum(e, error)
    return np.asarray(best, np.float32)


def quantize(values: Floats, steps: Floats, bits: int) -> NDArray[np.int8]:
    """Integers round(values / steps), clamped to `bits` bits; half to even, as in training."""
    top = (1 << (bits - 1)) - 1
    return np.asarray(np.clip(np.rint(values / steps), -top - 1, top), np.int8)


def make_trainer(problem: Problem, device: str, jobs: int) -> Trainer:
    """The compiled trainer on a CPU where it was built, otherwise torch."""
    from ...native import kernel

    if device == "cpu" and kernel.available():
        from .fit_native import NativeTrainer

        return NativeTrainer(problem, jobs)
    from .fit_torch import TorchTrainer

    return TorchTrainer(problem, device, jobs)


def fit_float(
    problem: Problem, trainer: Trainer, steps: int, seed: int, progress: Progress | None = None
) -> State:
    """Fits unquantized parameters from a random start."""
    state = initial(problem, seed)
    train(problem, state, trainer, steps, (LR_CODES, LR_NET), seed, progress)
    return state


def fit(
    problem: Problem,
    steps: int,
    code_bits: int,
    net_bits: int,
    seed: int,
    device: str = "cpu",
    jobs: int = 1,
    progress: Progress | None = None,
) -> State:
    """Fits quantized parameters: half of the steps in float, half through rounding."""
    state = fit_float(problem, make_trainer(problem, device, jobs), steps // 2, seed, progress)
    choose_steps(problem, state, code_bits, net_bits)
    trainer = make_trainer(problem, device, jobs)
    train(problem, state, trainer, steps - steps // 2, (QAT_LR_CODES, QAT_LR_NET), seed, progress)
    return state
