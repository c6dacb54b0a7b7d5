"""Fit of codes and network to the pixels: in floating point, then with quantization in the loop.

Adam optimizes random batches of pixels, through the compositing, with a warm-up and a cosine decay.
Batches grow with the picture; so the number of steps does not, and the cost per pixel is constant.
The second half trains through rounding (straight-through estimator; Bengio 2013).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...native import kernel
from .fit_problem import Problem
from .state import Progress, State, Trainer, best_steps, rows_of

LR_CODES, LR_NET = 1.2e-2, 8e-3
"""Peak learning rates of codes and network in the floating-point phase."""

QAT_LR_CODES, QAT_LR_NET = 1.2e-2, 6e-3
"""Peak learning rates of codes and network with quantization in the loop."""

STEP_SCALE = 0.7
"""Quantization steps of codes relative to the least-squares steps: finer ones gain more than the
clipping of codes costs."""

INIT_CODES = 0.01
"""Standard deviation of initial codes."""


def initial(problem: Problem, seed: int) -> State:
    """Makes a state of random codes and weights; the output bias is the mean colour."""
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
    """Pixels per step for a picture of `pixels`: 1/128 of them, as a multiple of 256."""
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
    """Optimizes a state, in place.

    Batches are taken from random permutations of the pixels, one after the other.

    Args:
        problem: The fitting problem.
        state: The state.
        trainer: Trainer of the problem.
        steps: Number of optimizer steps.
        rates: Peak learning rates of codes and network.
        seed: Seed of the permutations.
        progress: Called with a number of steps that were done.
    """
    rng = np.random.default_rng([seed, state.code_bits])
    batch = batch_size(problem.pixels)
    decay = _schedule(steps)
    queue = np.zeros(0, np.int32)
    for start in range(0, steps, 50):
        count = min(50, steps - start)
        while len(queue) < count * batch:
            queue = np.concatenate([queue, rng.permutation(problem.pixels).astype(np.int32)])
        pixels, queue = queue[: count * batch].reshape(count, batch), queue[count * batch :]
        pixels.sort(axis=1)  # so that the trainer reads memory in order
        part = decay[start : start + count]
        trainer.run(
            state,
            np.ascontiguousarray(pixels),
            (rates[0] * part).astype(np.float32),
            (rates[1] * part).astype(np.float32),
        )
        if progress:
            progress(count)


def choose_steps(problem: Problem, state: State, code_bits: int, net_bits: int) -> None:
    """Chooses quantization steps by least squares on the present parameters, rounded to float16.

    Args:
        problem: The fitting problem.
        state: The state; its steps and bits are set.
        code_bits: Bits per code.
        net_bits: Bits per weight.
    """
    state.code_bits, state.net_bits = code_bits, net_bits
    for k, (plane, stored) in enumerate(zip(problem.planes, problem.stored(), strict=True)):
        codes = state.codes[plane.start : plane.start + plane.size][stored.ravel()]
        state.code_steps[k] = STEP_SCALE * best_steps(codes.T, code_bits)
    rows = [best_steps(w, net_bits) for w, _ in rows_of(problem.shape, state.weights)]
    state.row_steps[:] = np.concatenate(rows)
    for steps in (state.code_steps, state.row_steps):
        steps[:] = np.maximum(steps.astype(np.float16), np.finfo(np.float16).tiny)


def make_trainer(problem: Problem, device: str, jobs: int) -> Trainer:
    """Makes a trainer: the compiled one on a CPU if it is available, otherwise that of torch.

    Args:
        problem: The fitting problem.
        device: ``cpu`` or ``cuda``.
        jobs: Number of threads.

    Raises:
        UnsupportedError: torch is needed and not installed, or finds no CUDA device.
    """
    if device == "cpu" and kernel.available():
        from .fit_native import NativeTrainer

        return NativeTrainer(problem, jobs)
    from .fit_torch import TorchTrainer

    return TorchTrainer(problem, device)


def fit_float(
    problem: Problem, trainer: Trainer, steps: int, seed: int, progress: Progress | None = None
) -> State:
    """Fits unquantized parameters from a random start, by `steps` steps of the optimizer."""
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
    """Fits quantized parameters: half of the steps in floating point, half through rounding.

    Args:
        problem: The fitting problem.
        steps: Number of optimizer steps.
        code_bits: Bits per code.
        net_bits: Bits per weight.
        seed: Seed of initial parameters and batches.
        device: ``cpu`` or ``cuda``.
        jobs: Number of threads.
        progress: Called with a number of steps that were done.

    Raises:
        UnsupportedError: torch is needed and not installed, or finds no CUDA device.
    """
    state = fit_float(problem, make_trainer(problem, device, jobs), steps // 2, seed, progress)
    choose_steps(problem, state, code_bits, net_bits)
    trainer = make_trainer(problem, device, jobs)
    train(problem, state, trainer, steps - steps // 2, (QAT_LR_CODES, QAT_LR_NET), seed, progress)
    return state
