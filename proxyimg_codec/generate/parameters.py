"""Textures as parameters that torch can learn, and back."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor

from ..texture.network import Network
from ..texture.pyramid import Texture


class Made(NamedTuple):
    """A finished texture.

    Attributes:
        texture: The texture; that of an implicit one names no network yet.
        network: Its own network; None for pyramid textures.
    """

    texture: Texture
    network: Network | None


class Colours(NamedTuple):
    """Colours of the points of a scene.

    Attributes:
        straight: [n, 3] colours in 0..1, not premultiplied.
        penalty: Scalar loss that keeps parameters within what can be stored.
    """

    straight: Tensor
    penalty: Tensor


class Parameters(Protocol):
    """Texture of a layer as parameters."""

    def groups(self) -> list[dict[str, Any]]:
        """Groups of parameters for an optimizer, with their learning rates."""

    def colours(self, share: float) -> Colours:
        """Colours of the points of the scene, when a share 0..1 of the steps is done."""

    def extra(self) -> dict[str, Any]:
        """State beside the parameters, of tensors and plain values, to go on from."""

    def restore(self, extra: dict[str, Any]) -> None:
        """Takes the state that `extra` gave."""

    def finished(self, effort: int, seed: int) -> Made:
        """Texture as it can be stored; `KeyboardInterrupt` shortens the refinement."""


OVERFLOW = 1.0
"""Weight of the squared distance of colours from what can be stored."""


def within(values: Tensor) -> tuple[Tensor, Tensor]:
    """Clamps colours to 0..1, with gradients as if they were not, and a penalty for what is cut."""
    cut = values.clamp(0, 1).detach()
    return values + (cut - values).detach(), OVERFLOW * ((values - cut) ** 2).sum()


def straight_through(values: Tensor, steps: Tensor, bits: int) -> Tensor:
    """Rounds values to multiples of steps, of `bits` bits, with gradients as if it did not."""
    top = (1 << (bits - 1)) - 1
    rounded = torch.clamp(torch.round(values / steps), -top - 1, top) * steps
    return values + (rounded - values).detach()
