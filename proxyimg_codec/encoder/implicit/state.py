"""State of a fit: its parameters and quantization steps, and the interface of trainers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...texture.network import Floats, NetShape

Progress = Callable[[int], None]


@dataclass(eq=False)
class State:
    """Parameters of a fit, and their quantization.

    Attributes:
        codes: float32 [rows, D] codes of all planes.
        weights: float32 [parameters] of the network: for each layer weights [out, in] row by row,
            then biases [out].
        code_steps: float32 [planes, D] quantization steps of codes; only used if `code_bits` > 0.
        row_steps: float32 [rows of the network] quantization steps of the weights of each output.
        code_bits: Bits per code; 0 = not quantized.
        net_bits: Bits per weight; 0 = not quantized.
    """

    codes: Floats
    weights: Floats
    code_steps: Floats
    row_steps: Floats
    code_bits: int = 0
    net_bits: int = 0


class Trainer(Protocol):
    """Optimizer of a state, which keeps the moments of Adam between calls."""

    def run(
        self, state: State, pixels: NDArray[np.int32], lr_codes: Floats, lr_net: Floats
    ) -> float:
        """Runs optimizer steps.

        Args:
            state: The state; it is changed.
            pixels: int32 [steps, batch] numbers of the pixels of each step.
            lr_codes: float32 [steps] learning rates of codes.
            lr_net: float32 [steps] learning rates of the network.

        Returns:
            Mean loss of the steps.
        """


def rows_of(shape: NetShape, flat: Floats) -> list[tuple[Floats, Floats]]:
    """Views of the weights [out, in] and biases [out] of each layer in flat parameters."""
    out, at = [], 0
    for inputs, outputs in shape.layers:
        middle = at + inputs * outputs
        out.append((flat[at:middle].reshape(outputs, inputs), flat[middle : middle + outputs]))
        at = middle + outputs
    return out


def best_steps(values: Floats, bits: int) -> Floats:
    """Quantization steps with the least squared rounding error among a few candidates.

    Args:
        values: float32 [N, M] values.
        bits: Bits per quantized value.

    Returns:
        float32 [N] a step for each row.
    """
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
    """Quantizes values: values / steps, rounded half to even, clamped to `bits` bits with sign.

    Args:
        values: float32 values.
        steps: float32 steps, which broadcast with the values.
        bits: Bits per quantized value, 2..8.

    Returns:
        int8 array of the shape of `values`.
    """
    top = (1 << (bits - 1)) - 1
    return np.asarray(np.clip(np.rint(values / steps), -top - 1, top), np.int8)
