"""Quantization of a trained model by block reconstruction: values are chosen to round up or down.

Blocks are rounded one after the other (BRECQ, Li et al. 2021). Each gets its inputs from the blocks
that are quantized already, and its outputs should come near those of the floating-point model on
some calibration points. Errors are weighted by how much they change the colour. The choice between
two neighbouring integers is a sigmoid that is driven to 0 or 1 (AdaRound, Nagel et al. 2020). The
target colours are not used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .fit_torch import run_network
from .state import Progress

BATCH = 1 << 10
"""Calibration points per step."""

RATE, BIAS_RATE = 2e-2, 1e-3
"""Learning rates of choices and of biases."""

STRETCH = 0.1
"""Length by which the sigmoid is stretched at either end, so that it reaches 0 and 1 (AdaRound)."""

WARM_UP, SHARP, WEIGHT = 0.2, (20.0, 2.0), 1e-2
"""Share of the steps before choices are driven to 0 or 1; first and last exponent of the penalty
that drives them; weight of the penalty."""


@dataclass(frozen=True, eq=False)
class Model:
    """Floating-point parameters of a model as tensors.

    Attributes:
        codes: [rows, D] codes.
        code_steps: [rows, D] quantization steps of the codes.
        net: Weights [out, in] and biases [out] of each linear layer in turn.
        row_steps: For each linear layer [out, 1] quantization steps of its weights.
        octaves: Octaves of the frequency encoding.
    """

    codes: Any
    code_steps: Any
    net: list[Any]
    row_steps: list[Any]
    octaves: int

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """First and last + 1 linear layer of each block; the first block includes the codes."""
        layers = len(self.row_steps)
        return [(0, 1), *((k, min(k + 2, layers)) for k in range(1, layers, 2))]

    def activate(self, x: Any, net: list[Any], start: int, stop: int) -> Any:
        """Runs the linear layers `start` to `stop` - 1 with activations.

        Args:
            x: [n, in] inputs.
            net: Weights and biases of these layers in turn.
            start: First layer.
            stop: Last layer + 1.

        Returns:
            [n, out] outputs.
        """
        import torch

        y = run_network(x, net, 0 if start else self.octaves)
        return torch.relu(y) if stop < len(self.row_steps) else y


class Choice:
    """Choice, for each value, between the two multiples of a step beside it.

    Args:
        values: Tensor of values.
        steps: Tensor of steps, which broadcasts with the values.
        bits: Bits per quantized value.

    Attributes:
        logit: Trainable tensor of the shape of the values; a value rounds up if it is positive.
    """

    def __init__(self, values: Any, steps: Any, bits: int) -> None:
        import torch

        top = (1 << (bits - 1)) - 1
        self._range, self._steps = (-top - 1, top), steps
        self._floor = torch.floor(values / steps)
        share = (values / steps - self._floor).clamp(0.01, 0.99)
        self.logit = torch.logit((share + STRETCH) / (1 + 2 * STRETCH)).requires_grad_()

    def _share(self) -> Any:
        return (self.logit.sigmoid() * (1 + 2 * STRETCH) - STRETCH).clamp(0, 1)

    def soft(self) -> Any:
        """Values that lie between both multiples while the choice is open; differentiable."""
        return (self._floor + self._share()).clamp(*self._range) * self._steps

    def hard(self) -> Any:
        """Chosen multiples, as the file will have them."""
        chosen = self._floor + (self.logit.detach() > 0)
        return chosen.clamp(*self._range) * self._steps

    def drive(self, sharp: float) -> Any:
        """Penalty for open choices: up to 1 for each, with the exponent `sharp`; 0 once made."""
        return (1 - (2 * self._share() - 1).abs() ** sharp).sum()


def reconstruct(
    model: Model,
    features: Callable[[Any, Any], Any],
    count: int,
    bits: tuple[int, int],
    steps: int,
    seed: int,
    progress: Progress | None = None,
) -> tuple[Any, list[Any]]:
    """Rounds the codes and weights of a model to multiples of their steps.

    Args:
        model: The floating-point model.
        features: Returns features [n, D] of calibration points, from codes and the numbers [n] of
            the points.
        count: Number of calibration points.
        bits: Bits per code and per weight.
        steps: Optimizer steps, divided among the blocks.
        seed: Seed of the batches.
        progress: Called with a number of steps that were done.

    Returns:
        [rows, D] codes; and the weights [out, in] and biases [out] of each layer in turn.
    """
    import torch

    rng = np.random.default_rng([seed, 1])
    every = torch.arange(count, device=model.codes.device)
    goals = _goals(model, features(model.codes, every).detach())
    net: list[Any] = []
    codes: Any = None
    hidden: Any = None

    def inputs(soft_codes: Any, at: Any) -> Any:
        return features(soft_codes, at) if hidden is None else hidden[at]

    for number, (span, goal) in enumerate(zip(model.blocks, goals, strict=True)):
        block = _Block(model, span, bits)
        done, next_done = (steps * n // len(goals) for n in (number, number + 1))
        block.optimize(inputs, goal, next_done - done, rng, progress)
        if block.codes is not None:
            codes = block.codes.hard()
        own = block.rounded()
        net += own
        x = features(codes, every) if hidden is None else hidden
        hidden = model.activate(x, own, *span)
    return codes, net


@dataclass(frozen=True, eq=False)
class _Goal:
    """Goal of a quantized block: outputs of the same block of the floating-point model.

    Attributes:
        outputs: [n, width] outputs at the calibration points.
        importance: [n, width] weight of a squared error of each output: the squared derivative of
            the colour by it, summed over channels.
    """

    outputs: Any
    importance: Any

    def loss(self, outputs: Any, at: Any) -> Any:
        """Mean weighted squared error of outputs [batch, width] at the points `at` [batch]."""
        off = outputs - self.outputs[at]
        return (off**2 * self.importance[at]).sum(1).mean()


class _Block:
    """Block that is being rounded.

    Attributes:
        codes: Choice of the codes in the first block; None in others.
    """

    def __init__(self, model: Model, span: tuple[int, int], bits: tuple[int, int]) -> None:
        """Opens the choices of a block.

        Args:
            model: The floating-point model.
            span: First and last + 1 linear layer of the block.
            bits: Bits per code and per weight.
        """
        self._model, self._span = model, span
        layers = range(*span)
        self._weights = [Choice(model.net[2 * k], model.row_steps[k], bits[1]) for k in layers]
        self._biases = [model.net[2 * k + 1].clone().requires_grad_() for k in layers]
        first = span[0] == 0
        self.codes = Choice(model.codes, model.code_steps, bits[0]) if first else None

    @property
    def _choices(self) -> list[Choice]:
        return self._weights if self.codes is None else [*self._weights, self.codes]

    def optimize(
        self,
        inputs: Callable[[Any, Any], Any],
        goal: _Goal,
        steps: int,
        rng: np.random.Generator,
        progress: Progress | None,
    ) -> None:
        """Optimizes choices and biases.

        Args:
            inputs: Returns inputs [batch, in] of the block from codes, which are None if the block
                does not include them, and numbers [batch] of calibration points.
            goal: Goal of the outputs.
            steps: Optimizer steps.
            rng: Generator that draws the batches.
            progress: Called with a number of steps that were done.
        """
        import torch

        adam = torch.optim.Adam(
            [
                {"params": [c.logit for c in self._choices], "lr": RATE},
                {"params": self._biases, "lr": BIAS_RATE},
            ]
        )
        points, device = len(goal.outputs), goal.outputs.device
        for i in range(steps):
            at = torch.from_numpy(rng.integers(points, size=BATCH)).to(device)
            loss = goal.loss(self._outputs(inputs, at), at)
            t = (i / steps - WARM_UP) / (1 - WARM_UP)
            if t > 0:
                sharp = SHARP[0] + (SHARP[1] - SHARP[0]) * t
                loss = loss + WEIGHT * sum(c.drive(sharp) for c in self._choices)
            adam.zero_grad()
            loss.backward()
            adam.step()
            if progress:
                progress(1)

    def _outputs(self, inputs: Callable[[Any, Any], Any], at: Any) -> Any:
        """Outputs [batch, width] at calibration points `at` [batch], while choices are open."""
        weights = [c.soft() for c in self._weights]
        x = inputs(None if self.codes is None else self.codes.soft(), at)
        net = [p for pair in zip(weights, self._biases, strict=True) for p in pair]
        return self._model.activate(x, net, *self._span)

    def rounded(self) -> list[Any]:
        """Weights [out, in], as the file will have them, and biases [out] of each layer in turn."""
        weights = [c.hard() for c in self._weights]
        return [p.detach() for pair in zip(weights, self._biases, strict=True) for p in pair]


def _goals(model: Model, features: Any) -> list[_Goal]:
    """Goal of each block, from features [n, D] of the calibration points.

    The importance of errors is the diagonal of the Gauss-Newton matrix; BRECQ uses that of the
    Fisher information matrix.
    """
    import torch

    outputs: list[Any] = []
    x = features.requires_grad_()
    for start, stop in model.blocks:
        x = model.activate(x, model.net[2 * start : 2 * stop], start, stop)
        outputs.append(x)
    importance = [torch.zeros_like(x) for x in outputs]
    for channel in range(x.shape[1]):
        slopes = torch.autograd.grad(x[:, channel].sum(), outputs, retain_graph=True)
        for total, slope in zip(importance, slopes, strict=True):
            total += slope**2
    return [_Goal(x.detach(), i) for x, i in zip(outputs, importance, strict=True)]
