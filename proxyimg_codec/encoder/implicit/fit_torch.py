"""Trainer that uses torch: for CUDA, and for installations without the compiled kernel."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UnsupportedError
from ...texture.network import Floats
from .fit_problem import Problem
from .state import State, rows_of


class TorchTrainer:
    """`Trainer` on a torch device; the same as that of the kernel but for rounding errors.

    Args:
        problem: The fitting problem.
        device: ``cpu`` or ``cuda``.

    Raises:
        UnsupportedError: torch is not installed, or finds no CUDA device.
    """

    def __init__(self, problem: Problem, device: str) -> None:
        try:
            from ..yielding import torch
        except ImportError:
            raise UnsupportedError(
                "encoding needs torch here: pip install 'proxyimg-codec[encode]'"
            ) from None
        if device == "cuda" and not torch.cuda.is_available():
            raise UnsupportedError("device cuda: torch finds no CUDA device; use --device cpu")
        self._torch, self._device, self._shape = torch, device, problem.shape
        self._first = self.tensor(problem.first).long()
        self._taps = [
            self.tensor(a) for a in (problem.base, problem.stride, problem.fx, problem.fy)
        ]
        self._coverage = self.tensor(problem.coverage)
        self._learn = self.tensor(problem.learn)[:, None]
        prior = problem.prior
        self._prior = [self.tensor(a) for a in (prior.rows, prior.next, prior.weight)]
        self._target = self.tensor(problem.target)
        plane = np.repeat(np.arange(len(problem.planes)), [p.size for p in problem.planes])
        self._plane = self.tensor(plane)
        self._parameters: list[Any] = []

    def tensor(self, array: NDArray[Any]) -> Any:
        """Tensor of an array on the device; on a CPU both share their memory."""
        return self._torch.from_numpy(array).to(self._device)

    def run(
        self, state: State, pixels: NDArray[np.int32], lr_codes: Floats, lr_net: Floats
    ) -> float:
        """Runs optimizer steps; see `Trainer.run`."""
        torch = self._torch
        flat = [a for pair in rows_of(self._shape, state.weights) for a in pair]
        if not self._parameters:
            self._parameters = [
                self.tensor(a.copy()).requires_grad_() for a in (state.codes, *flat)
            ]
            groups = [{"params": self._parameters[:1]}, {"params": self._parameters[1:]}]
            self._adam = torch.optim.Adam(groups, lr=0.0, betas=(0.9, 0.99), eps=1e-8)
        steps = self.tensor(state.code_steps)[self._plane] if state.code_bits else None
        ends = np.cumsum([o for _, o in self._shape.layers])[:-1]
        rows = [self.tensor(s) for s in np.split(state.row_steps, ends)]
        batches = self.tensor(pixels).long()
        self._clamp(steps, state.code_bits)
        total = 0.0
        for i, batch in enumerate(batches):
            for group, rate in zip(self._adam.param_groups, (lr_codes[i], lr_net[i]), strict=True):
                group["lr"] = float(rate)
            codes, *net = self._parameters
            if steps is not None:
                codes = self._round(codes, steps, state.code_bits)
                net = [
                    self._round(p, rows[k // 2][:, None], state.net_bits) if k % 2 == 0 else p
                    for k, p in enumerate(net)
                ]
            loss = self._loss(codes, net, batch)
            self._adam.zero_grad(set_to_none=True)
            (loss + self._smoothness(self._parameters[0])).backward()
            self._adam.step()
            self._clamp(steps, state.code_bits)
            total += float(loss.detach())
        for array, p in zip((state.codes, *flat), self._parameters, strict=True):
            array[...] = p.detach().cpu().numpy()
        return total / len(batches)

    def _clamp(self, steps: Any, bits: int) -> None:
        """Clamps codes to a little more than their quantized range, from which they can return."""
        if steps is not None:
            top = (1 << (bits - 1)) - 1
            with self._torch.no_grad():
                self._parameters[0].clamp_(-(top + 1.5) * steps, (top + 0.5) * steps)

    def _round(self, x: Any, step: Any, bits: int) -> Any:
        top = (1 << (bits - 1)) - 1
        rounded = self._torch.clamp(self._torch.round(x / step), -top - 1, top) * step
        return x + (rounded - x).detach()

    def _loss(self, codes: Any, net: list[Any], batch: Any) -> Any:
        """Mean squared error of composited pixels; `batch` [B] has their numbers."""
        torch = self._torch
        start, count = self._first[batch], self._first[batch + 1] - self._first[batch]
        owner = torch.repeat_interleave(torch.arange(len(batch), device=batch.device), count)
        offset = torch.arange(len(owner), device=batch.device)
        rank = offset - (torch.cumsum(count, 0) - count)[owner]
        entry = start[owner] + rank
        output = run_network(self.features(codes, entry), net, self._shape.octaves)
        learn = self._learn[entry]
        output = learn * output + (1 - learn) * output.detach()
        coverage = self._coverage[entry]
        result = torch.zeros_like(self._target[batch])
        clear = torch.ones(len(batch), device=batch.device)
        for k in range(int(count.max())):
            at = torch.nonzero(rank == k)[:, 0]
            pixel, c, p = owner[at], coverage[at], output[at]
            weight = clear[pixel] * c
            result = result.index_add(0, pixel, weight[:, None] * p)
            alpha = p[:, 3].clamp(0, 1) if p.shape[1] == 4 else 1.0
            clear = clear.index_copy(0, pixel, clear[pixel] * (1 - c * alpha))
        return ((result - self._target[batch]) ** 2).mean()

    def features(self, codes: Any, entry: Any) -> Any:
        """Features [N, D] of the entries numbered `entry` [N], before the frequency encoding."""
        return interpolate(codes, *(t[entry] for t in self._taps))

    def _smoothness(self, codes: Any) -> Any:
        """Prior: half the weighted squared distances of codes from the mean of their neighbours."""
        row, neighbours, weight = self._prior
        off = codes.index_select(0, row) - codes[neighbours].mean(1).detach()
        return (weight[:, None] * off**2).sum() / 2


def interpolate(codes: Any, base: Any, stride: Any, fx: Any, fy: Any) -> Any:
    """Interpolates features bilinearly.

    Args:
        codes: float32 [rows, D] table of codes.
        base: int [N] table row of the upper left code of each point.
        stride: Number of table rows to the code below; an int, or int [N].
        fx: float32 [N] horizontal fraction in 0..1.
        fy: float32 [N] vertical fraction in 0..1.

    Returns:
        float32 [N, D] features.
    """
    base, fx, fy = base.long(), fx[:, None], fy[:, None]

    def row(start: Any) -> Any:
        # Unlike that of codes[...], the gradient of this does not depend on the number of threads.
        left, right = codes.index_select(0, start), codes.index_select(0, start + 1)
        return left * (1 - fx) + right * fx

    return row(base) * (1 - fy) + row(base + stride) * fy


def run_network(features: Any, net: list[Any], octaves: int) -> Any:
    """Runs a decoder network.

    Args:
        features: float32 [N, D] features.
        net: Weights [out, in] and biases [out] of each layer in turn.
        octaves: Octaves of the frequency encoding; 0 = none.

    Returns:
        float32 [N, channels] outputs.
    """
    import torch

    x = [features]
    if octaves:
        s, c = torch.sin(math.pi * features), torch.cos(math.pi * features)
        for _ in range(octaves):
            x += [s, c]
            s, c = 2 * s * c, 1 - 2 * s * s
    y = torch.cat(x, 1)
    for k in range(0, len(net), 2):
        y = y @ net[k].T + net[k + 1]
        if k + 2 < len(net):
            y = torch.relu(y)
    return y
