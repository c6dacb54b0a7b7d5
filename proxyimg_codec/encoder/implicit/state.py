"""The parameters that are fitted, and who fits them: what all trainers share."""

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


def rows_of(shape: NetShape, flat: Floats) -> list[tuple[Floats, Floats]]:
    """Views (weights [out, in], biases [out]) of each layer in flat parameters."""
    out, at = [], 0
    for inputs, outputs in shape.layers:
        middle = at + inputs * outputs
        out.append((flat[at:middle].reshape(outputs, inputs), flat[middle : middle + outputs]))
        at = middle + outputs
    return out


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
