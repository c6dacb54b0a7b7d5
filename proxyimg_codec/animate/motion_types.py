"""Parts of a motion. Lengths are canvas pixels with y down, times are seconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .materials import MATERIALS, Material

Pair = tuple[float, float]


@dataclass(frozen=True)
class Disc:
    """Disc that chooses the nodes in it.

    Attributes:
        at: Centre.
        radius: Radius.
    """

    at: Pair
    radius: float


@dataclass(frozen=True)
class Rectangle:
    """Rectangle that chooses the nodes in it.

    Attributes:
        box: x, y, width, height.
    """

    box: tuple[float, float, float, float]


Spot = Literal["top", "bottom", "left", "right", "border", "centre"] | Disc | Rectangle
"""Choice of nodes of a layer: a side of its box, its border, its centre, a disc or a rectangle."""


@dataclass(frozen=True)
class Impulse:
    """Sudden change of velocity.

    Attributes:
        velocity: Velocity that is added, in pixels per second.
        time: Time at which it is added.
        at: Centre; None for the whole layer alike.
        radius: Distance from the centre at which the impulse has faded to 0; None for the whole
            layer alike.
    """

    velocity: Pair
    time: float = 0.0
    at: Pair | None = None
    radius: float | None = None


@dataclass(frozen=True)
class Key:
    """Place of a handle at a time: it is turned and scaled about its centre, then moved.

    Attributes:
        time: The time.
        offset: Displacement of the handle.
        scale: Factor of distances from its centre.
        turn: Angle in degrees, clockwise.
    """

    time: float
    offset: Pair = (0.0, 0.0)
    scale: float = 1.0
    turn: float = 0.0


@dataclass(frozen=True)
class Handle:
    """Handle, whose nodes follow keys.

    Attributes:
        at: Centre of the handle at rest.
        radius: Radius within which nodes belong to the handle.
        keys: Keys with ascending times.
        ease: Interpolation between keys.
    """

    at: Pair
    radius: float
    keys: tuple[Key, ...]
    ease: Literal["linear", "smooth"] = "smooth"


@dataclass(frozen=True)
class LayerMotion:
    """Motion of a layer.

    Attributes:
        material: Material of the layer.
        pins: Nodes that do not move.
        mass: Factor of the density of the material.
        floor: Whether the layer stands on a floor at its lowest node at rest.
        upright: Whether the shape that the layer returns to moves but does not turn.
        impulses: Impulses that act on the layer.
        handles: Handles that lead parts of the layer.
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
    """Wind with gusts that travel along it.

    It grows from 0 at the pins of a layer to its full strength at the node farthest from them.

    Attributes:
        direction: Vector that the wind blows along; only its angle counts.
        strength: Acceleration of a layer whose `Material.wind` is 1, in diagonals of the layer per
            second squared.
        scale: Length of the largest gusts in pixels.
        frequency: Frequency of the slowest gusts in Hz.
        gust: Share of the wind that comes in gusts, 0..1; the rest is steady.
        across: Share of the power of gusts that blows across the direction, 0..1.
    """

    direction: Pair = (1.0, 0.0)
    strength: float = 1.0
    scale: float = 200.0
    frequency: float = 0.5
    gust: float = 0.5
    across: float = 0.3


@dataclass(frozen=True)
class Collide:
    """Kinds of collisions.

    Attributes:
        canvas: Whether layers stay on the canvas.
        layers: Whether layers push each other away.
    """

    canvas: bool = False
    layers: bool = False


@dataclass(frozen=True)
class Attachment:
    """Attachment of one layer to another.

    Attributes:
        layers: Names of two layers; nodes of the first keep their place on the second.
        at: Centre of the disc of these nodes.
        radius: Radius of the disc.
    """

    layers: tuple[str, str]
    at: Pair
    radius: float
