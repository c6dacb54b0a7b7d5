"""Trees of layers and groups as programs have them, and how a picture in layers is made of one.

The format draws all layers over each other. A layer that blends in another way becomes one with
all that lies behind it in its scope: the canvas, or the innermost group around it whose layers
blend with nothing outside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from numpy.typing import NDArray

from ...errors import InputError, UnsupportedError
from ...limits import Limits
from ..shapes.masks import unique_names
from .source import LayeredPicture, SourceLayer, check_limit, clipped

MODES = ("flatten", "refuse")
"""What may become of layers that blend in a way that the format lacks."""


class Patch(NamedTuple):
    """Pixels in their place.

    Attributes:
        pixels: uint8 or uint16 [h, w, 1..4], as `SourceLayer` has them; may leave the canvas.
        x: Canvas column of the left edge.
        y: Canvas row of the upper edge.
    """

    pixels: NDArray[Any]
    x: int
    y: int


@dataclass(frozen=True, eq=False)
class Node:
    """Layer or group of a file.

    Attributes:
        name: Printable name, perhaps empty; several may have the same.
        groups: Names of the groups around it, outermost first.
        opacity: Opacity in 0..1, without that of the groups around it.
        hidden: Whether it is switched off itself.
        blend: How it mixes with what lies behind, such as ``blending mode multiply``; empty if it
            is just drawn over it.
        problem: Why it cannot be drawn, if it shows; empty if it can.
        draw: Draws a layer alone, at full opacity, given a name for messages; None if it has no
            pixels. Not called for groups.
        children: Layers and groups in it, back to front; None for a layer.
        isolated: Whether layers in a group blend with nothing outside.
        handle: What the reader knows it by.
    """

    name: str
    groups: tuple[str, ...] = ()
    opacity: float = 1.0
    hidden: bool = False
    blend: str = ""
    problem: str = ""
    draw: Callable[[str], Patch | None] = lambda where: None
    children: tuple[Node, ...] | None = None
    isolated: bool = True
    handle: Any = None

    @property
    def shows(self) -> bool:
        """Whether it can be seen if the groups around it can."""
        return not self.hidden and self.opacity > 0


Merge = Callable[[Sequence[Node], Node | None], Patch | None]
"""Draws nodes that show, back to front, as they look together in a scope: a group, whose own
opacity does not count, or None for the canvas."""


def layered_picture(
    nodes: Sequence[Node],
    size: tuple[int, int],
    blend: str,
    merge: Merge,
    limits: Limits,
    where: str,
) -> LayeredPicture:
    """Makes a picture in layers of a tree. Groups give their opacity to their layers.

    Args:
        nodes: What lies on the canvas, back to front.
        size: Width and height of the canvas in pixels.
        blend: One of `MODES`: what becomes of layers that blend.
        merge: Draws several nodes as one layer.
        limits: Bounds on the number of layers, and on their pixels together.
        where: Name of the file in messages.

    Raises:
        InputError: No layer has a visible pixel.
        UnsupportedError: Something that shows cannot be drawn, or blends and may not be flattened.
        LimitError: There are more layers or pixels than `limits` allow.
    """
    _check(nodes, blend, where)
    notes: list[str] = []
    found = list(_leaves(_settled(nodes, None, merge, notes)))
    check_limit(limits, "layers", len(found), where)
    names = unique_names(node.name or f"layer {k + 1}" for k, node in enumerate(found))
    layers, left_out, pixels = list[SourceLayer](), list[str](), 0
    for name, node in zip(names, found, strict=True):
        place = f"{where}: layer {name!r}"
        patch = None if node.blend or node.problem else node.draw(place)
        if patch is not None:
            pixels += patch.pixels.shape[0] * patch.pixels.shape[1]
            check_limit(limits, "output_pixels", pixels, f"{place}, with those behind it")
        layer = patch and clipped(
            SourceLayer(name, *patch, node.opacity, node.hidden, node.groups), *size
        )
        if layer is None:
            left_out.append(name)
        else:
            layers.append(layer)
    if not layers:
        raise InputError(f"{where}: no layer has a pixel on the canvas of {size[0]}x{size[1]}")
    return LayeredPicture(*size, tuple(layers), {}, tuple(left_out), tuple(notes))


def _check(nodes: Sequence[Node], blend: str, where: str) -> None:
    """Raises `UnsupportedError` for what shows and cannot be imported."""
    for node in nodes:
        if not node.shows:
            continue
        kind = "layer" if node.children is None else "group"
        place = f"{where}: {kind} {node.name!r}"
        if node.problem:
            raise UnsupportedError(f"{place}: {node.problem}")
        if node.blend and blend == "refuse":
            raise UnsupportedError(
                f"{place}: the format has no {node.blend}; set it to normal, hide it, or have it "
                "flattened with what lies behind it (--blend flatten)"
            )
        _check(node.children or (), blend, where)


def _settled(
    nodes: Sequence[Node], scope: Node | None, merge: Merge, notes: list[str]
) -> list[Node]:
    """Nodes of a scope without any that blends and shows; a note tells what was flattened."""
    flat = [one for node in nodes for one in _opened(node, merge, notes)]
    count = 1 + max((k for k, node in enumerate(flat) if node.blend and node.shows), default=-1)
    if not count:
        return flat
    below = [node for node in flat[:count] if node.shows]
    rest = [node for node in flat[:count] if not node.shows]
    name = next((node.name for node in below if node.name), "")
    front = below[-1]
    behind = f" with the {len(below) - 1} behind it" if len(below) > 1 else ""
    notes.append(f"layer {front.name!r} ({front.blend}) is flattened{behind}")
    # Hidden layers lie in front of the new one, so that they can still be switched on.
    merged = Node(name, _common(below), draw=lambda _: merge(below, scope))
    return [merged, *rest, *flat[count:]]


def _common(nodes: Sequence[Node]) -> tuple[str, ...]:
    """Groups that are around all nodes, outermost first."""
    least, most = (f(node.groups for node in nodes) for f in (min, max))
    count = next((k for k, (a, b) in enumerate(zip(least, most, strict=False)) if a != b), None)
    return least[:count]


def _opened(node: Node, merge: Merge, notes: list[str]) -> list[Node]:
    """The node, or what is in it if it is a group through which layers blend."""
    if node.children is None or not node.shows or node.blend:
        return [node]
    if node.isolated:
        return [replace(node, children=tuple(_settled(node.children, node, merge, notes)))]
    inside = [one for child in node.children for one in _opened(child, merge, notes)]
    if not any(child.blend and child.shows for child in inside):
        return [replace(node, children=tuple(inside))]
    return [replace(child, opacity=child.opacity * node.opacity) for child in inside]


def _leaves(nodes: Sequence[Node], around: Node | None = None) -> Iterator[Node]:
    """Layers of a tree, back to front, with opacity and visibility of the groups around them.

    Groups that blend, or cannot be drawn, come as one.
    """
    for node in nodes:
        if around is not None:
            node = replace(
                node, opacity=node.opacity * around.opacity, hidden=node.hidden or around.hidden
            )
        if node.children is None or node.blend or node.problem:
            yield node
        else:
            yield from _leaves(node.children, node)
