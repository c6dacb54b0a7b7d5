"""The parts of a motion: what moves a layer, and where. Lengths are canvas pixels with y down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .materials import MATERIALS, Material

Pair = tuple[float, float]


@dataclass(frozen=True)
class Disc:
    """The nodes within `radius` pixels of `at`."""

    at: Pair
    radius: float


@dataclass(frozen=True)
class Rectangle:
    """The nodes in a `box` of x, y, width, height in pixels."""

    box: tuple[float, float, float, float]


Spot = Literal["top", "bottom", "left", "right", "border", "centre"] | Disc | Rectangle
"""Nodes of a layer: a side of its box, its outline, its middle, a disc or a rectangle."""


@dataclass(frozen=True)
class Impulse:
    """`velocity` in pixels a second that is added at `time`.

    It fades to 0 at `radius` from `at`, or takes the whole layer if they are None.
    """

    velocity: Pair
    time: float = 0.0
    at: Pair | None = None
    radius: float | None = None


@dataclass(frozen=True)
class Key:
    """Where a handle is at `time`: scaled about its centre by `scale`, then moved by `offset`."""

    time: float
    offset: Pair = (0.0, 0.0)
    scale: float = 1.0


@dataclass(frozen=True)
class Handle:
    """The nodes within `radius` of `at` follow `keys`, whose times ascend."""

    at: Pair
    radius: float
    keys: tuple[Key, ...]
    ease: Literal["linear", "smooth"] = "smooth"


@dataclass(frozen=True)
class LayerMotion:
    """How a layer moves.

    Attributes:
        material: What it is made of.
        pins: Nodes that stay.
        mass: Factor of the material's density.
        floor: Whether the lowest node at rest stands on a floor.
        upright: Whether the shape it returns to moves but does not turn.
        impulses: What hits it.
        handles: What leads it.
    """

    material: Material = MATERIALS["cloth"]
    pins: tuple[Spot, ...] = ()
    mass: float = 1.0
    floor: bool = False
    upright: bool = False
    impulses: tuple[Impulse, ...] = ()
    handles: tuple[Handle, ...] = ()


@dataclass(frozen=True)
class Wind:
    """A wind with gusts that travel along it.

    It grows from nothing at a layer's pins to its full strength at the node farthest from them.

    Attributes:
        direction: Where it blows; only its angle counts.
        strength: Acceleration of a layer whose material takes 1, in its diagonals a second squared.
        scale: Length of the largest gusts in pixels.
        frequency: Of the slowest gusts, in Hz.
        gust: Share of the wind that comes and goes, 0..1; the rest is steady.
        across: Share of the gusts' power that blows across the direction, 0..1.
    """

    direction: Pair = (1.0, 0.0)
    strength: float = 1.0
    scale: float = 200.0
    frequency: float = 0.5
    gust: float = 0.5
    across: float = 0.3


@dataclass(frozen=True)
class Collide:
    """Whether layers stay on the `canvas`, and whether `layers` push each other away."""

    canvas: bool = False
    layers: bool = False


@dataclass(frozen=True)
class Attachment:
    """Nodes of the first of two `layers` within `radius` of `at` keep their place on the second."""

    layers: tuple[str, str]
    at: Pair
    radius: float
