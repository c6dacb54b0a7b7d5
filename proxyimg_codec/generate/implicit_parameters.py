"""Implicit texture as parameters: its codes, and its own copy of the network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..encoder.implicit.fit import STEP_SCALE
from ..encoder.implicit.fit_torch import interpolate, run_network
from ..encoder.implicit.state import best_steps, quantize
from ..texture.implicit import Box, ImplicitTexture
from ..texture.network import Floats, Network
from .parameters import Colours, Made, straight_through, within
from .scene import Scene

RATE_CODES, RATE_NET = 1e-2, 2e-3
"""Learning rates of codes and network."""

ROUNDED = 0.5
"""Share of the steps from which parameters are rounded as they will be stored."""

FAINT = 0.05
"""Alpha below which colours are not taken apart from it."""

ALPHA = 30.0
"""Weight of the squared change of alpha, which is to stay as it was."""


class ImplicitParameters:
    """Implicit texture as parameters.

    Args:
        texture: The texture.
        network: Its network.
        box: Box of its layer.
        scene: The points where it is needed.
        device: Where it is computed.
    """

    def __init__(
        self, texture: ImplicitTexture, network: Network, box: Box, scene: Scene,
        device: torch.device,
    ) -> None:  # fmt: skip
        self._texture, self._network, self._device = texture, network, device
        taps = texture.taps(scene.x, scene.y, box)
        self._base = torch.from_numpy(taps.base).to(device)
        self._stride = taps.stride
        self._fx, self._fy = (torch.from_numpy(v).to(device) for v in (taps.fx, taps.fy))
        self._codes = self._leaf(texture.table)
        self._net = [self._leaf(a) for pair in network.layers for a in pair]
        self._steps: tuple[Tensor, list[Tensor]] | None = None
        self._used = np.zeros(len(texture.table), bool)
        for offset in (0, 1, taps.stride, taps.stride + 1):
            self._used[taps.base + offset] = True
        self._alpha: Tensor | None = None
        if network.shape.channels == 4:
            with torch.no_grad():
                self._alpha = self._output(0.0)[:, 3].clamp(0, 1)

    def _leaf(self, values: Floats) -> Tensor:
        return torch.from_numpy(values.copy()).to(self._device).requires_grad_()

    def groups(self) -> list[dict[str, Any]]:
        """Codes and network; see `Parameters`."""
        return [{"params": [self._codes], "lr": RATE_CODES}, {"params": self._net, "lr": RATE_NET}]

    def colours(self, share: float) -> Colours:
        """Colours of the points of the scene; see `Parameters`."""
        found = self._output(share)
        if self._alpha is None:
            return Colours(*within(found))
        penalty = ALPHA * ((found[:, 3] - self._alpha) ** 2).sum()
        colour, cut = within(found[:, :3] / self._alpha.clamp_min(FAINT)[:, None])
        return Colours(colour, penalty + cut)

    def _output(self, share: float) -> Tensor:
        """Outputs [n, channels] of the network, with rounded parameters if it is time."""
        codes, net = self._codes, self._net
        if share >= ROUNDED:
            if self._steps is None:
                self._steps = self._chosen()
            steps, rows = self._steps
            codes = straight_through(codes, steps, self._texture.bits)
            net = [
                straight_through(p, rows[k // 2][:, None], self._network.bits) if k % 2 == 0 else p
                for k, p in enumerate(net)
            ]
        features = interpolate(codes, self._base, self._stride, self._fx, self._fy)
        return run_network(features, list(net), self._network.shape.octaves)  # type: ignore[no-any-return] # untyped

    def _chosen(self) -> tuple[Tensor, list[Tensor]]:
        """Quantization steps of codes [D], and of the rows of each layer of the network."""
        tiny = np.finfo(np.float16).tiny

        def steps(values: Floats, bits: int, factor: float = 1.0) -> Tensor:
            best = np.maximum((factor * best_steps(values, bits)).astype(np.float16), tiny)
            return torch.from_numpy(best.astype(np.float32)).to(self._device)

        codes = _array(self._codes)[self._used]
        weights: Sequence[Tensor] = self._net[::2]
        rows = [steps(_array(w), self._network.bits) for w in weights]
        return steps(codes.T, self._texture.bits, STEP_SCALE), rows

    def extra(self) -> dict[str, Any]:
        """Quantization steps, once they are chosen; see `Parameters`."""
        return {} if self._steps is None else {"codes": self._steps[0], "rows": self._steps[1]}

    def restore(self, extra: dict[str, Any]) -> None:
        """Takes the state that `extra` gave."""
        if extra:
            to = self._device
            self._steps = extra["codes"].to(to), [v.to(to) for v in extra["rows"]]

    def finished(self, effort: int, seed: int) -> Made:
        """Rounded codes of the points that were seen, and the rounded network; see `Parameters`."""
        steps, rows = self._steps or self._chosen()
        old, shape = self._texture, self._texture.stored.shape
        stored = self._used.reshape(shape)
        codes = quantize(_array(self._codes), _array(steps), old.bits)
        codes = np.where(self._used[:, None], codes, np.int8(0)).T
        texture = replace(
            old, steps=_array(steps).astype(np.float16), stored=stored,
            codes=np.ascontiguousarray(codes).reshape(-1, *shape),
        )  # fmt: skip
        bits = self._network.bits
        network = Network(
            self._network.shape, bits,
            tuple(
                quantize(_array(w), _array(s)[:, None], bits)
                for w, s in zip(self._net[::2], rows, strict=True)
            ),
            np.concatenate([_array(s) for s in rows]).astype(np.float16),
            np.concatenate([_array(b) for b in self._net[1::2]]).astype(np.float16),
        )  # fmt: skip
        return Made(texture, network)


def _array(values: Tensor) -> Floats:
    return values.detach().cpu().numpy().astype(np.float32)
