"""Operations on which layers there are, in which order, and what belongs together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..errors import UsageError
from ..image import Image, Layer
from .operations import (
    changed,
    checked_name,
    free_name,
    one,
    operation,
    parents,
    shown_together,
    substituted,
)
from .transforms import TARGET

ONE = "layer: a layer's name or position"


@operation("remove", layer=TARGET)
def remove(image: Image, layer: str | int) -> Image:
    """Removes a layer, or a group with its layers; what they hid shows."""
    gone = {v.name for v in shown_together(image, layer)}
    if isinstance(layer, str) and layer in image.groups:
        gone |= {name for name in image.groups if _within(image, name, layer)}
    kept = [v for v in image.layers if v.name not in gone]
    return _without(image, kept, gone)


def _without(image: Image, layers: Sequence[Layer], gone: set[str]) -> Image:
    """The image without some layers and groups; what was below them moves up."""
    above = parents(image)

    def parent(name: str) -> str | None:
        node = above[name]
        while node in gone:
            node = above[node]
        return node

    groups = {name: parent(name) for name in image.groups if name not in gone}
    return changed(image, [replace(v, parent=parent(v.name)) for v in layers], groups=groups)


def _within(image: Image, name: str, group: str) -> bool:
    above = parents(image)
    node: str | None = name
    while node is not None and node != group:
        node = above[node]
    return node == group


@operation("duplicate", layer=ONE, name="text?: the copy's name")
def duplicate(image: Image, layer: str | int, name: str | None = None) -> Image:
    """Copies a layer, in front of it; both share one texture."""
    chosen = one(image, layer)
    if name is None:
        name = free_name(image, f"{chosen.name} copy")
    copy = replace(chosen, name=checked_name(image, name))
    layers = list(image.layers)
    layers.insert(_position(image, chosen) + 1, copy)
    return changed(image, layers)


def _position(image: Image, layer: Layer) -> int:
    return next(i for i, v in enumerate(image.layers) if v is layer)


@operation("rename", layer=TARGET, name="text: a name that is free")
def rename(image: Image, layer: str | int, name: str) -> Image:
    """Gives a layer or group another name."""
    old = layer if layer in image.groups else one(image, layer).name
    checked_name(image, name)

    def renamed(value: str | None) -> str | None:
        return name if value == old else value

    layers = [
        replace(v, name=name if v.name == old else v.name, parent=renamed(v.parent))
        for v in image.layers
    ]
    groups = {name if k == old else k: renamed(v) for k, v in image.groups.items()}
    return changed(image, layers, groups=groups)


@operation("order", layer=ONE,
           to="place: a position from the back, or front, back, forward, backward")  # fmt: skip
def order(image: Image, layer: str | int, to: int | str) -> Image:
    """Puts a layer elsewhere in the stack; `back` is just in front of an opaque back layer."""
    chosen = one(image, layer)
    last, now = len(image.layers) - 1, _position(image, chosen)
    bottom = 1 if image.opaque and now > 0 else 0
    places = {
        "front": last, "back": bottom,
        "forward": min(now + 1, last), "backward": max(now - 1, bottom),
    }  # fmt: skip
    place = to if isinstance(to, int) else places.get(to)
    if place is None or not 0 <= place <= last:
        raise UsageError(f"order: {to!r} is neither 0..{last} nor one of {', '.join(places)}")
    layers = [v for v in image.layers if v is not chosen]
    layers.insert(place, chosen)
    return changed(image, layers)


@operation("group", layers="layers: names or positions of layers, or names of groups",
           name="text: the group's name; one that exists grows")  # fmt: skip
def group(image: Image, layers: Sequence[str | int], name: str) -> Image:
    """Puts layers and groups into a group, which is edited as one."""
    groups = dict(image.groups)
    if name not in groups:
        groups[checked_name(image, name)] = None
    inner = [v if v in image.groups else one(image, v).name for v in layers]
    for each in inner:
        if each in groups:
            if each == name or (name in image.groups and _within(image, name, str(each))):
                raise UsageError(f"group: {each!r} would become a part of itself")
            groups[str(each)] = name
    new = [replace(v, parent=name) if v.name in inner else v for v in image.layers]
    result = changed(image, new, groups=groups)
    _check_acyclic(result, "group")
    return result


@operation("ungroup", name="text: a group")
def ungroup(image: Image, name: str) -> Image:
    """Dissolves a group; its layers stay."""
    if name not in image.groups:
        raise UsageError(f"ungroup: there is no group {name!r}")
    return _without(image, list(image.layers), {name})


@operation("parent", layer=TARGET, to="text: a layer or group that it follows; empty for none")
def parent(image: Image, layer: str | int, to: str) -> Image:
    """Lets a layer or group follow another one."""
    if to and to not in parents(image):
        raise UsageError(f"parent: there is no layer or group {to!r}")
    above = to or None
    if layer in image.groups:
        groups = {**image.groups, str(layer): above}
        result = changed(image, list(image.layers), groups=groups)
    else:
        result = substituted(image, [replace(one(image, layer), parent=above)])
    _check_acyclic(result, "parent")
    return result


def _check_acyclic(image: Image, what: str) -> None:
    above = parents(image)
    for name in above:
        seen, node = set(), above[name]
        while node is not None:
            if node == name or node in seen:
                raise UsageError(f"{what}: {name!r} would become a part of itself")
            seen.add(node)
            node = above[node]
